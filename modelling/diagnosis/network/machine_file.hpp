/// A machine file of the simulator whose values are changed.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

namespace thermocomp::diagnosis {

/// SIGNAL|NODE, NODE|NODE, NODE|room: what stands before and behind the bar.
struct TwoNames {
  std::string first;
  std::string second;  ///< empty where there is no bar
};
[[nodiscard]] TwoNames two_names(const std::string& subject);

/// Each change says whether the file has what is to be changed.
class MachineFile {
 public:
  /// @throws toml::parse_error
  explicit MachineFile(const std::filesystem::path& path);
  ~MachineFile();
  MachineFile(const MachineFile&) = delete;
  MachineFile& operator=(const MachineFile&) = delete;

  /// Whether it is a body, whose matrices stand elsewhere.
  [[nodiscard]] bool is_body() const;
  bool multiply_in_node(const std::string& node, const char* key, double factor);
  /// @param nodes  in the order of the alphabet
  bool multiply_in_link(const TwoNames& nodes, const char* key, double factor);
  /// @param source  a signal and a node
  bool multiply_in_source(const TwoNames& source, const char* key, double factor);
  bool add_to_thermocouple(const std::string& name, const char* key, double more);
  /// A signal that nothing else has needed is added, constantly 0.
  /// @param source  a signal and a node
  void add_source(const TwoNames& source, double heat_W, double at, double exponent);
  /// Without the comments that it had.
  [[nodiscard]] std::string text() const;

 private:
  struct Tables;
  std::unique_ptr<Tables> tables_;
};

}  // namespace thermocomp::diagnosis
