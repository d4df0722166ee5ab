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

class EdsFiles {
 public:
  /// @param folder  where relative paths begin; none: no file is opened, and objects by name are
  /// left out
  explicit EdsFiles(std::optional<std::filesystem::path> folder) : folder_(std::move(folder)) {}

  /// The file of the key `eds` of a device; nullptr: it names none, or none that can be read.
  [[nodiscard]] std::shared_ptr<EdsFile> read(const TomlTable& device);
  [[nodiscard]] bool opens_files() const noexcept { return folder_.has_value(); }
  /// What is wrong inside the files.
  /// @param in_use  at objects whose name or type a configuration takes from there; else elsewhere
  [[nodiscard]] std::vector<Problem> flaws(bool in_use) const { return flaws_of(read_, in_use); }

 private:
  std::optional<std::filesystem::path> folder_;
  std::map<std::filesystem::path, std::shared_ptr<EdsFile>> read_;
};

}  // namespace thermocomp::sections
