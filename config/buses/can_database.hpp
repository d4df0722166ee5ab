/// Signals of a CAN bus by name, from the DBC file that the bus names.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "config/bus_files/dbc_file.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/can/can_config.hpp"

namespace thermocomp::sections {

/// What a bus says of its messages.
struct CanDatabase {
  bool named{false};  ///< the bus names a file
  /// Its content; none where it has problems, or where no files are opened.
  std::shared_ptr<const DbcFile> file;
};

/// The DBC files of a configuration.
class DbcFiles {
 public:
  /// @param folder  where relative paths begin; none: no file is opened, and signals by name are
  /// taken as they are given
  explicit DbcFiles(std::optional<std::filesystem::path> folder) : folder_(std::move(folder)) {}

  /// The file of the key `dbc` of a bus.
  [[nodiscard]] CanDatabase read(const TomlTable& bus);
  /// What is wrong inside the files.
  [[nodiscard]] const std::vector<Problem>& problems() const noexcept { return problems_; }

 private:
  std::optional<std::filesystem::path> folder_;
  std::vector<Problem> problems_;
};

/// A sensor's value: by the name of its signal where it has the key `signal`, else by its place.
/// What `own` leaves out is as in `base`.
[[nodiscard]] CanChannel read_can_channel(const TomlTable& own, const TomlTable& base,
                                          const CanDatabase& database);

}  // namespace thermocomp::sections
