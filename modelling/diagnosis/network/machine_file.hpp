/// Editor of a simulator's machine file.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

namespace thermocomp::diagnosis {

/// SIGNAL|NODE, NODE|NODE, NODE|room: the parts before and after the bar.
struct TwoNames {
  std::string first;
  std::string second;  ///< empty: no bar
};
[[nodiscard]] TwoNames two_names(const std::string& subject);

/// Each change returns whether the file has its target.
class MachineFile {
 public:
  /// @throws toml::parse_error
  explicit MachineFile(const std::filesystem::path& path);
  ~MachineFile();
  MachineFile(const MachineFile&) = delete;
  MachineFile& operator=(const MachineFile&) = delete;

  /// True for a body, whose matrices are in another file.
  [[nodiscard]] bool is_body() const;
  bool multiply_in_node(const std::string& node, const char* key, double factor);
  /// @param nodes  in alphabetical order
  bool multiply_in_link(const TwoNames& nodes, const char* key, double factor);
  /// @param source  a signal and a node
  bool multiply_in_source(const TwoNames& source, const char* key, double factor);
  bool add_to_thermocouple(const std::string& name, const char* key, double more);
  /// Adds a source. A signal that is new in the file is added with the constant value 0.
  /// @param source  a signal and a node
  void add_source(const TwoNames& source, double heat_W, double at, double exponent);
  /// The file's text without its comments.
  [[nodiscard]] std::string text() const;

 private:
  struct Tables;
  std::unique_ptr<Tables> tables_;
};

}  // namespace thermocomp::diagnosis
