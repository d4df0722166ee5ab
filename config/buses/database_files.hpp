/// The files of objects (EDS) and messages (DBC) that buses and devices of a configuration name.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "config/bus_files/dbc_file.hpp"
#include "config/bus_files/eds_file.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/can/can_config.hpp"

namespace thermocomp::sections {

/// Problems of those flaws of bus files that are in use, or of those that are not.
template <class Files>
std::vector<Problem> flaws_of(const Files& files, bool in_use) {
  std::vector<Problem> problems;
  for (const auto& [path, file] : files) {
    if (file == nullptr) continue;
    for (const auto& flaw : file->flaws) {
      if (flaw.in_use == in_use) problems.push_back(flaw.problem);
    }
  }
  return problems;
}

/// The electronic data sheets that the devices of a configuration name.
class EdsFiles {
 public:
  /// @param folder  where relative paths begin; none: no file is opened, and objects by name are
  /// left out
  explicit EdsFiles(std::optional<std::filesystem::path> folder) : folder_(std::move(folder)) {}

  /// The file of the key `eds` of a device; nullptr: it names none, or none that can be read.
  [[nodiscard]] std::shared_ptr<EdsFile> read(const TomlTable& device);
  [[nodiscard]] bool opens_files() const noexcept { return folder_.has_value(); }
  /// The flaws inside the files.
  /// @param in_use  at objects whose name or type a configuration takes from there; else elsewhere
  [[nodiscard]] std::vector<Problem> flaws(bool in_use) const { return flaws_of(read_, in_use); }

 private:
  std::optional<std::filesystem::path> folder_;
  std::map<std::filesystem::path, std::shared_ptr<EdsFile>> read_;
};

/// What a bus says of its messages.
struct CanDatabase {
  bool named{false};  ///< the bus names a file
  /// Its content; none where it cannot be read, or where no files are opened. What is named of it
  /// is marked at its flaws.
  std::shared_ptr<DbcFile> file;
};

/// The DBC files of a configuration.
class DbcFiles {
 public:
  /// @param folder  where relative paths begin; none: no file is opened, and signals by name are
  /// taken as they are given
  explicit DbcFiles(std::optional<std::filesystem::path> folder) : folder_(std::move(folder)) {}

  /// The file of the key `dbc` of a bus.
  [[nodiscard]] CanDatabase read(const TomlTable& bus);
  /// The flaws inside the files.
  /// @param in_use  where a sensor stands on it; else elsewhere
  [[nodiscard]] std::vector<Problem> flaws(bool in_use) const { return flaws_of(read_, in_use); }

 private:
  std::optional<std::filesystem::path> folder_;
  std::map<std::filesystem::path, std::shared_ptr<DbcFile>> read_;
};

/// A sensor's value: by the name of its signal where it has the key `signal`, else by its place.
/// What `own` leaves out is as in `base`; what both leave out of a named signal is as in the file.
[[nodiscard]] CanChannel read_can_channel(const TomlTable& own, const TomlTable& base,
                                          const CanDatabase& database);

}  // namespace thermocomp::sections
