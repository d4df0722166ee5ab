#include "config/buses/eds_files.hpp"

#include "config/toml/file_limits.hpp"

namespace thermocomp::sections {

std::shared_ptr<EdsFile> EdsFiles::read(const TomlTable& device) {
  if (!device.has("eds")) return nullptr;
  const std::filesystem::path named = device.text("eds");
  if (!folder_ || named.empty()) return nullptr;
  const std::filesystem::path path = *folder_ / named;
  if (const auto known = read_.find(path); known != read_.end()) return known->second;
  std::shared_ptr<EdsFile>& file = read_[path];
  try {
    file = std::make_shared<EdsFile>(
        read_eds_text(read_text_file(path, bus_table_bytes_max), path.string()));
  } catch (const ConfigurationError& error) {
    device.problem("eds", error.problems().front().rule);
  }
  return file;
}

}  // namespace thermocomp::sections
