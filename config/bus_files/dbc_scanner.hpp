/// Tokenizer of DBC files: words, numbers and strings.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace thermocomp {

/// Replaces all bytes but printable ASCII, for messages.
[[nodiscard]] std::string printable(std::string_view bytes);

/// Syntax error; the rest of the statement is skipped.
struct DbcSyntaxError {
  int line{0};
  std::string found;
  std::string rule;
};

/// Skips white space before each token; throws DbcSyntaxError if the token is not found.
class DbcScanner {
 public:
  explicit DbcScanner(std::string_view text) : text_(text) {}

  [[nodiscard]] bool at_end();
  /// Line of the next token.
  [[nodiscard]] int line();
  [[nodiscard]] bool accept(char symbol);
  void expect(char symbol);
  /// A C identifier; may be empty.
  [[nodiscard]] std::string_view next_word();
  std::string_view word(std::string_view what);
  /// A name as found in practice, such as "2_Gateway", "Gateway-Load"; may be empty.
  [[nodiscard]] std::string_view next_name();
  std::string_view name(std::string_view what);
  [[nodiscard]] bool next_is(char symbol);
  double real(std::string_view what);
  [[nodiscard]] std::optional<double> accept_real();
  std::uint64_t integer(std::string_view what, std::uint64_t max);
  /// A string without its quotes; `\"` is a quote in it.
  std::string text(std::string_view what);
  /// Skips this line up to and including the symbol.
  void skip_behind(char symbol);
  /// Skips up to and including the semicolon that ends the statement.
  void skip_statement();
  /// Whether the next token is the first on its line.
  [[nodiscard]] bool begins_line();
  void skip_line() noexcept;
  /// @throws DbcSyntaxError at the next token
  [[noreturn]] void fail(std::string_view rule);

 private:
  void skip_space() noexcept;
  [[nodiscard]] std::string_view rest() const noexcept { return text_.substr(at_); }

  std::string_view text_;
  std::size_t at_{0};
  int line_{1};
};

}  // namespace thermocomp
