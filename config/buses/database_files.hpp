/// EDS and DBC files named by buses and devices of a configuration.
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

/// Problems from flaws of bus files, either in use or not.
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

/// The electronic data sheets of a configuration's devices.
class EdsFiles {
 public:
  /// @param folder  base of relative paths; none: opens no file, leaves out objects given by name
  explicit EdsFiles(std::optional<std::filesystem::path> folder) : folder_(std::move(folder)) {}

  /// The file of a device's key `eds`; nullptr: not configured, or unreadable.
  [[nodiscard]] std::shared_ptr<EdsFile> read(const TomlTable& device);
  [[nodiscard]] bool opens_files() const noexcept { return folder_.has_value(); }
  /// @param in_use  flaws at objects whose name or type the configuration uses; else the others
  [[nodiscard]] std::vector<Problem> flaws(bool in_use) const { return flaws_of(read_, in_use); }

 private:
  std::optional<std::filesystem::path> folder_;
  std::map<std::filesystem::path, std::shared_ptr<EdsFile>> read_;
};

/// A bus' definitions of messages.
struct CanDatabase {
  bool named{false};  ///< the bus names a file
  /// Null if unreadable or if no files are opened. Flaws at used messages are marked.
  std::shared_ptr<DbcFile> file;
};

/// The DBC files of a configuration.
class DbcFiles {
 public:
  /// @param folder  base of relative paths; none: opens no file and accepts signal names unchecked
  explicit DbcFiles(std::optional<std::filesystem::path> folder) : folder_(std::move(folder)) {}

  /// The file of a bus' key `dbc`.
  [[nodiscard]] CanDatabase read(const TomlTable& bus);
  /// @param in_use  flaws at signals that a sensor uses; else the others
  [[nodiscard]] std::vector<Problem> flaws(bool in_use) const { return flaws_of(read_, in_use); }

 private:
  std::optional<std::filesystem::path> folder_;
  std::map<std::filesystem::path, std::shared_ptr<DbcFile>> read_;
};

/// A sensor's value: with the key `signal` by its name, else by its place. Missing keys are taken
/// from `base`, for a named signal then from the file.
/// @param stale_after_s  of the sensor
/// @param warnings  about what the file says of the signal
[[nodiscard]] CanChannel read_can_channel(const TomlTable& own, const TomlTable& base,
                                          const CanDatabase& database, double stale_after_s,
                                          std::vector<std::string>& warnings);

}  // namespace thermocomp::sections
