#include "config/bus_files/dbc_scanner.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <system_error>

#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

/// "CM_ ...", " SG_ ...": not part of a string but a statement reached through an unbalanced quote.
bool begins_statement(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  const std::size_t end = text.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ_");
  return end != std::string_view::npos && end > 2 && text[end] == ' ' && text[end - 1] == '_';
}

bool begins_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

}  // namespace

std::string printable(std::string_view bytes) {
  std::string text(bytes);
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

void DbcScanner::skip_space() noexcept {
  while (at_ < text_.size()) {
    const char c = text_[at_];
    if (c == '\n') {
      ++line_;
    } else if (c != ' ' && c != '\t' && c != '\r') {
      return;
    }
    ++at_;
  }
}

bool DbcScanner::at_end() {
  skip_space();
  return at_ == text_.size();
}

int DbcScanner::line() {
  skip_space();
  return line_;
}

void DbcScanner::fail(std::string_view rule) {
  constexpr std::size_t shown_max = 24;
  const std::string_view left = at_end() ? "the end of the file" : rest();
  const std::string_view shown = left.substr(0, left.find_first_of("\r\n")).substr(0, shown_max);
  throw DbcSyntaxError{line_, printable(shown), std::string(rule)};
}

bool DbcScanner::next_is(char symbol) {
  return !at_end() && text_[at_] == symbol;
}

bool DbcScanner::accept(char symbol) {
  if (!next_is(symbol)) return false;
  ++at_;
  return true;
}

void DbcScanner::expect(char symbol) {
  if (!accept(symbol)) fail(std::string("must be '") + symbol + "'");
}

std::string_view DbcScanner::next_word() {
  if (at_end() || !begins_word(text_[at_])) return {};
  std::size_t end = at_;
  while (end < text_.size() && (begins_word(text_[end]) || is_digit(text_[end]))) ++end;
  return text_.substr(at_, end - at_);
}

std::string_view DbcScanner::word(std::string_view what) {
  const std::string_view found = next_word();
  if (found.empty()) fail(std::string("must be ").append(what));
  at_ += found.size();
  return found;
}

std::string_view DbcScanner::next_name() {
  if (at_end()) return {};
  const std::string_view left = rest();
  const auto ends = [](char c) {
    return static_cast<unsigned char>(c) <= ' ' ||
           std::string_view(":,;|@\"()[]").find(c) != std::string_view::npos;
  };
  const auto* const end = std::find_if(left.begin(), left.end(), ends);
  return left.substr(0, static_cast<std::size_t>(end - left.begin()));
}

std::string_view DbcScanner::name(std::string_view what) {
  const std::string_view found = next_name();
  if (found.empty()) fail(std::string("must be ").append(what));
  at_ += found.size();
  return found;
}

bool DbcScanner::begins_line() {
  skip_space();
  const std::string_view before = text_.substr(0, at_);
  const auto last = before.find_last_not_of(" \t");
  return last == std::string_view::npos || before[last] == '\n';
}

void DbcScanner::skip_line() noexcept {
  at_ = std::min(text_.find('\n', at_), text_.size());
  skip_space();
}

double DbcScanner::real(std::string_view what) {
  if (at_end()) fail(std::string("must be ").append(what));
  const std::optional<double> value = accept_real();
  if (!value) fail(std::string("must be ").append(what).append(", a number"));
  return *value;
}

std::optional<double> DbcScanner::accept_real() {
  if (at_end()) return std::nullopt;
  std::string_view number = rest();
  if (number.front() == '+') number.remove_prefix(1);
  const std::string_view digits = number.substr(number.starts_with('-') ? 1 : 0);
  const bool is_number = !digits.empty() && (is_digit(digits.front()) || digits.front() == '.');
  double value = 0.0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
  if (!is_number || error != std::errc{} || !std::isfinite(value)) return std::nullopt;
  at_ = static_cast<std::size_t>(end - text_.data());
  return value;
}

std::uint64_t DbcScanner::integer(std::string_view what, std::uint64_t max) {
  skip_space();
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
  if (error != std::errc{} || value > max) {
    fail(std::string("must be ").append(what) + ", a whole number of at most " +
         std::to_string(max));
  }
  at_ = static_cast<std::size_t>(end - text_.data());
  return value;
}

std::string DbcScanner::text(std::string_view what) {
  if (!next_is('"')) fail(std::string("must be ").append(what).append(" in quotes"));
  const int first_line = line_;
  std::string found;
  for (std::size_t i = at_ + 1; i < text_.size(); ++i) {
    const char c = text_[i];
    if (c == '"') {
      at_ = i + 1;
      return found;
    }
    if (c == '\n') {
      if (begins_statement(text_.substr(i + 1))) break;
      ++line_;
    }
    const bool quoted = c == '\\' && i + 1 < text_.size() && text_[i + 1] == '"';
    if (quoted) ++i;
    found.push_back(text_[i]);
  }
  line_ = first_line;
  throw DbcSyntaxError{first_line, "", "the string that begins here has no end"};
}

void DbcScanner::skip_behind(char symbol) {
  while (!at_end() && !accept(symbol)) {
    if (begins_line()) fail(std::string("must be '") + symbol + "'");
    ++at_;
  }
}

void DbcScanner::skip_statement() {
  while (!accept(';')) {
    if (at_end() || (begins_line() && begins_statement(rest()))) fail("must be ';'");
    if (next_is('"')) {
      static_cast<void>(text("a text"));
    } else {
      ++at_;
    }
  }
}

}  // namespace thermocomp
