// Parsing of a document, and its problems.

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include <toml++/toml.h>

#include "config/toml/toml_node.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {
namespace {

// Limits of a TOML text, checked before parsing: the parser recurses into nested tables and lists,
// and its result takes thirty times the text's size.

/// Nesting depth of tables and lists: `[a.b]` has 2, `c = [[1]]` under it 4.
constexpr std::size_t toml_depth_max = 16;
/// Number of keys and headers.
constexpr std::size_t toml_keys_max = 50'000;
/// Number of elements in all lists.
constexpr std::size_t toml_elements_max = 1'000'000;

struct TomlExcess {
  int line{1};
  std::string rule;
};
/// The first place that exceeds a limit; nullopt: none. Checks an invalid text up to its first
/// syntax error. Does not recurse, O(size).
[[nodiscard]] std::optional<TomlExcess> toml_excess(std::string_view text);

/// Scans the text as the parser does, without building anything.
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

  /// A dot in a key adds a level; in a value it is part of a number.
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

  /// @return false when the string does not end: no valid TOML from here on
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

  /// Up to two quotes before the closing delimiter belong to the text.
  void skip_fence(char quote) {
    at_ += 3;
    for (int more = 0; more < 2 && at_ < text_.size() && text_[at_] == quote; ++more) ++at_;
  }

  struct Level {
    bool is_table{false};
    std::size_t key_depth{0};  ///< depth of the enclosing keys
  };

  std::string_view text_;
  std::size_t at_{0};
  int line_{1};
  std::size_t keys_{0};
  std::size_t elements_{0};
  std::size_t header_depth_{0};
  std::size_t key_depth_{0};  ///< dots of the enclosing keys
  std::size_t nested_{0};     ///< open lists and inline tables
  std::array<Level, toml_depth_max + 1> levels_{};
  bool in_header_{false};
  bool in_value_{false};
  bool line_is_empty_{true};  ///< so far
  std::optional<TomlExcess> excess_;
};

std::optional<TomlExcess> toml_excess(std::string_view text) {
  return Scanner(text).run();
}

}  // namespace

TomlDocument::TomlDocument(std::shared_ptr<detail::TomlState> state) : state_(std::move(state)) {}

TomlDocument TomlDocument::from_file(const std::filesystem::path& path) {
  return from_text(read_text_file(path), path.string());
}

TomlDocument TomlDocument::from_text(std::string text, std::string name) {
  auto state = std::make_shared<detail::TomlState>();
  state->name = std::move(name);
  state->text = std::move(text);
  if (const auto excess = toml_excess(state->text)) {
    throw ConfigurationError({{state->name, excess->line, "", "", excess->rule}});
  }
  try {
    state->root = toml::parse(std::string_view(state->text));
  } catch (const toml::parse_error& error) {
    throw ConfigurationError({{state->name, detail::line_of(error.source()), "", "",
                               "not TOML: " + std::string(error.description())}});
  }
  return TomlDocument(std::move(state));
}

TomlTable TomlDocument::root() const {
  return {state_, &state_->root, "", 1, false};
}

const std::string& TomlDocument::text() const noexcept {
  return state_->text;
}
const std::string& TomlDocument::name() const noexcept {
  return state_->name;
}

namespace {

/// A key that was never read.
struct UnknownKey {
  const detail::TomlState::Opened* table;
  const toml::key* key;
  const toml::node* value;
};

Problem unknown_problem(const std::string& file, const UnknownKey& unknown, bool is_suggested) {
  const std::string name(unknown.key->str());
  std::string rule = "unknown key";
  if (is_suggested) {
    const auto& asked = unknown.table->asked;
    const std::string meant = nearest_name(name, {asked.begin(), asked.end()});
    if (!meant.empty()) rule += "; did you mean \"" + meant + "\"?";
  }
  const std::string& path = unknown.table->path;
  return {file, detail::line_of(unknown.key->source()), path.empty() ? name : path + "." + name,
          detail::shown(*unknown.value), rule};
}

}  // namespace

std::vector<Problem> TomlDocument::all_problems() const {
  constexpr std::size_t suggestions_max = 100;  // matches the number reported
  std::vector<UnknownKey> unknown;
  for (const auto& [table, opened] : state_->opened) {
    if (opened.ignore_rest) continue;
    for (const auto& [key, value] : *table) {
      if (!opened.asked.contains(key.str())) unknown.push_back({&opened, &key, &value});
    }
  }
  std::stable_sort(unknown.begin(), unknown.end(), [](const UnknownKey& a, const UnknownKey& b) {
    return a.key->source().begin.line < b.key->source().begin.line;
  });
  std::vector<Problem> problems = state_->problems;
  for (const UnknownKey& key : unknown) {
    if (problems.size() >= detail::kept_problems_max) break;
    const auto place = static_cast<std::size_t>(&key - unknown.data());
    problems.push_back(unknown_problem(state_->name, key, place < suggestions_max));
  }
  return problems;
}

void TomlDocument::finish() const {
  std::vector<Problem> problems = all_problems();
  if (!problems.empty()) throw ConfigurationError(std::move(problems));
}

}  // namespace thermocomp
