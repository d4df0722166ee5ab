/// The words, numbers and strings of a DBC file, one after another.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace thermocomp {

/// Bytes with everything but printable ASCII replaced, for messages.
[[nodiscard]] std::string printable(std::string_view bytes);

/// Ends the reading of one statement.
struct DbcSyntaxError {
  int line{0};
  std::string found;
  std::string rule;
};

/// White space before what is asked for is skipped; a DbcSyntaxError is thrown where it is not
/// found.
class DbcScanner {
 public:
  explicit DbcScanner(std::string_view text) : text_(text) {}

  [[nodiscard]] bool at_end();
  /// Line of what comes next.
  [[nodiscard]] int line();
  [[nodiscard]] bool accept(char symbol);
  void expect(char symbol);
  /// A C identifier, or nothing.
  [[nodiscard]] std::string_view next_word();
  std::string_view word(std::string_view what);
  /// Reads a name as the files of all makers have it: also "2_Gateway", "Gateway-Load"; or nothing.
  [[nodiscard]] std::string_view next_name();
  std::string_view name(std::string_view what);
  [[nodiscard]] bool next_is(char symbol);
  double real(std::string_view what);
  std::uint64_t integer(std::string_view what, std::uint64_t max);
  /// A string without its quotes; `\"` inside it is a quote.
  std::string text(std::string_view what);
  /// Everything of this line up to and with the symbol.
  void skip_behind(char symbol);
  /// Everything up to and with the semicolon that ends the statement.
  void skip_statement();
  /// Whether what comes next is the first on its line.
  [[nodiscard]] bool begins_line();
  void skip_line() noexcept;
  /// @throws DbcSyntaxError about what comes next
  [[noreturn]] void fail(std::string_view rule);

 private:
  void skip_space() noexcept;
  [[nodiscard]] std::string_view rest() const noexcept { return text_.substr(at_); }

  std::string_view text_;
  std::size_t at_{0};
  int line_{1};
};

}  // namespace thermocomp
