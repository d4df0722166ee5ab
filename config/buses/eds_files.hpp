/// The electronic data sheets that the devices of a configuration name.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "config/bus_files/eds_file.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::sections {

class EdsFiles {
 public:
  /// @param folder  where relative paths begin; none: no file is opened, and objects by name are
  /// left out
  explicit EdsFiles(std::optional<std::filesystem::path> folder) : folder_(std::move(folder)) {}

  /// The file of the key `eds` of a device; nullptr: it names none, or none that can be read.
  [[nodiscard]] std::shared_ptr<const EdsFile> read(const TomlTable& device);
  [[nodiscard]] bool opens_files() const noexcept { return folder_.has_value(); }
  /// What is wrong inside the files.
  [[nodiscard]] const std::vector<Problem>& problems() const noexcept { return problems_; }

 private:
  std::optional<std::filesystem::path> folder_;
  std::map<std::filesystem::path, std::shared_ptr<const EdsFile>> read_;
  std::vector<Problem> problems_;
};

}  // namespace thermocomp::sections
