/// A mutator for TOML. Random byte changes rarely get past the parser; this one moves, repeats and
/// nests statements, and inserts unusual numbers, names and types.
///
/// Linked as libFuzzer's LLVMFuzzerCustomMutator and LLVMFuzzerCustomCrossOver.
#pragma once

#include <cstddef>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace thermocomp::fuzz {

/// A table's header with its lines, or the lines before the first header. A multi-line list or text
/// is one statement.
struct TomlBlock {
  std::vector<std::string> statements;  ///< with line feeds; starts with the header, if any
};

class TomlMutator {
 public:
  explicit TomlMutator(unsigned seed) : random_(seed) {}

  /// @return the text with one to four changes, at most `size_max` bytes
  [[nodiscard]] std::string mutate(std::string_view text, std::size_t size_max);
  /// @return `text` with blocks of `other` inserted
  [[nodiscard]] std::string cross(std::string_view text, std::string_view other,
                                  std::size_t size_max);

 private:
  using Blocks = std::vector<TomlBlock>;
  [[nodiscard]] std::size_t below(std::size_t count);  ///< 0 for 0
  [[nodiscard]] std::string* any_statement(Blocks& blocks);
  /// A statement `key = value` with the positions of its parts.
  struct Assignment {
    std::string* statement{nullptr};
    std::string key;
    std::string value;
  };
  [[nodiscard]] Assignment any_assignment(Blocks& blocks);
  static void put(const Assignment& assignment);

  void change(Blocks& blocks, std::size_t room);
  void move_statement(Blocks& blocks);
  void repeat_block(Blocks& blocks, std::size_t room);
  void deepen_key(Blocks& blocks, std::size_t room);
  void deepen_value(Blocks& blocks, std::size_t room);
  void change_number(Blocks& blocks);
  void change_type(Blocks& blocks);
  void change_text(Blocks& blocks, std::size_t room);
  void change_name(Blocks& blocks);
  void lengthen_list(Blocks& blocks, std::size_t room);
  void many_keys(Blocks& blocks, std::size_t room);
  [[nodiscard]] std::size_t depth();

  std::mt19937 random_;
};

}  // namespace thermocomp::fuzz
