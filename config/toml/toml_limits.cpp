#include "config/toml/toml_limits.hpp"

#include <algorithm>
#include <array>

namespace thermocomp {
namespace {

/// Follows the text as the parser will, without making anything of it.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  std::optional<TomlExcess> run() {
    while (at_ < text_.size() && !excess_) {
      const char c = text_[at_];
      if (c == '#') {
        at_ = std::min(text_.find('\n', at_), text_.size());
      } else if (c == '"' || c == '\'') {
        if (!skip_text(c)) break;
      } else {
        take(c);
        ++at_;
      }
    }
    return excess_;
  }

 private:
  void take(char c) {
    switch (c) {
      case '\n':
        return end_line();
      case '=':
        return begin_value();
      case '.':
        return note_dot();
      case '[':
      case '{':
        return open(c);
      case ']':
      case '}':
        return close();
      case ',':
        return note_comma();
      case ' ':
      case '\t':
      case '\r':
        return;
      default:
        line_is_empty_ = false;
    }
  }

  void end_line() {
    ++line_;
    if (nested_ > 0) return;
    if (in_header_) header_depth_ = key_depth_;
    in_header_ = false;
    in_value_ = false;
    line_is_empty_ = true;
    key_depth_ = 0;
  }

  void begin_value() {
    if (++keys_ > toml_keys_max) refuse("must have at most ", toml_keys_max, " keys");
    in_value_ = true;
  }

  /// A dot in a key goes one table deeper; in a value it is a number's.
  void note_dot() {
    if (!in_value_) deeper();
  }

  void note_comma() {
    if (++elements_ > toml_elements_max) {
      refuse("must have at most ", toml_elements_max, " elements in its lists");
    }
    if (nested_ > 0 && levels_[nested_ - 1].is_table) {
      in_value_ = false;
      key_depth_ = levels_[nested_ - 1].key_depth;
    }
  }

  void open(char c) {
    if (!in_value_) {  // a header
      if (line_is_empty_) {
        in_header_ = true;
        key_depth_ = 1;
        line_is_empty_ = false;
        if (++keys_ > toml_keys_max) refuse("must have at most ", toml_keys_max, " keys");
      }
      return;
    }
    if (depth() >= toml_depth_max) return refuse_depth();
    levels_[nested_++] = {c == '{', key_depth_};
    in_value_ = c == '[';
  }

  void close() {
    if (nested_ == 0) return;
    key_depth_ = levels_[--nested_].key_depth;
    in_value_ = true;
  }

  [[nodiscard]] std::size_t depth() const {
    return (in_header_ ? 0 : header_depth_) + key_depth_ + nested_;
  }

  void deeper() {
    ++key_depth_;
    if (depth() > toml_depth_max) refuse_depth();
  }
  void refuse_depth() {
    refuse("must be nested at most ", toml_depth_max, " deep (tables, lists, parts of a key)");
  }

  void refuse(const char* before, std::size_t limit, const char* after) {
    if (!excess_) excess_ = TomlExcess{line_, before + std::to_string(limit) + after};
  }

  /// @return false when it does not end: no TOML from here on
  bool skip_text(char quote) {
    line_is_empty_ = false;
    const std::array<char, 3> three{quote, quote, quote};
    const std::string_view fence(three.data(), three.size());
    const bool is_long = in_value_ && text_.substr(at_, fence.size()) == fence;
    at_ += is_long ? fence.size() : 1;
    for (; at_ < text_.size(); ++at_) {
      const char c = text_[at_];
      if (c == '\\' && quote == '"') {
        ++at_;
        if (at_ < text_.size() && text_[at_] == '\n') ++line_;
      } else if (c == '\n') {
        if (!is_long) return false;
        ++line_;
      } else if (c == quote) {
        if (!is_long) return ++at_, true;
        if (text_.substr(at_, fence.size()) == fence) return skip_fence(quote), true;
      }
    }
    return false;
  }

  /// Up to two quotes more belong to the text in front of the fence.
  void skip_fence(char quote) {
    at_ += 3;
    for (int more = 0; more < 2 && at_ < text_.size() && text_[at_] == quote; ++more) ++at_;
  }

  struct Level {
    bool is_table{false};
    std::size_t key_depth{0};  ///< of the keys around it
  };

  std::string_view text_;
  std::size_t at_{0};
  int line_{1};
  std::size_t keys_{0};
  std::size_t elements_{0};
  std::size_t header_depth_{0};
  std::size_t key_depth_{0};  ///< dots of the keys that lead here
  std::size_t nested_{0};     ///< lists and inline tables that are open
  std::array<Level, toml_depth_max + 1> levels_{};
  bool in_header_{false};
  bool in_value_{false};
  bool line_is_empty_{true};  ///< so far
  std::optional<TomlExcess> excess_;
};

}  // namespace

std::optional<TomlExcess> toml_excess(std::string_view text) {
  return Scanner(text).run();
}

}  // namespace thermocomp
