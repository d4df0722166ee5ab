#include "toml_mutator.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <numeric>

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t size_max);

namespace thermocomp::fuzz {
namespace {

constexpr std::array<std::string_view, 32> numbers{"0",
                                                   "-0.0",
                                                   "1",
                                                   "-1",
                                                   "0.5",
                                                   "1e308",
                                                   "-1e308",
                                                   "1.7976931348623157e308",
                                                   "1e-308",
                                                   "4.9e-324",
                                                   "inf",
                                                   "-inf",
                                                   "nan",
                                                   "9223372036854775807",
                                                   "-9223372036854775808",
                                                   "9223372036854775808",
                                                   "4294967296",
                                                   "2147483648",
                                                   "65536",
                                                   "65535",
                                                   "32768",
                                                   "256",
                                                   "255",
                                                   "0x7fffffffffffffff",
                                                   "0o777",
                                                   "0b1",
                                                   "1_000_000",
                                                   "1e9",
                                                   "-273.15",
                                                   "3000.0",
                                                   "00",
                                                   "1e400"};
constexpr std::array<std::string_view, 14> values{"true",
                                                  "\"\"",
                                                  "[]",
                                                  "{}",
                                                  "[[]]",
                                                  "[1, \"two\"]",
                                                  "1979-05-27",
                                                  "07:32:00",
                                                  "1979-05-27T07:32:00Z",
                                                  "'literal'",
                                                  "\"\"\"many\nlines\"\"\"",
                                                  "{ a = { b = 1 } }",
                                                  "[nan]",
                                                  "\"z\""};
/// Escape and control characters, both writing directions, invisible characters, invalid UTF-8,
/// long encodings.
constexpr std::array<std::string_view, 22> oddities{"\\u001b[31m",  "\x1b[2J",
                                                    "\\u202e",      "\xE2\x80\xAE",
                                                    "\\u2066",      "\xE2\x81\xA9",
                                                    "\\u200b",      "\\ufeff",
                                                    "\xEF\xBB\xBF", "\\u0000",
                                                    "\\u007f",      "\\u0085",
                                                    "\\n",          "\\t",
                                                    "\xFF",         "\xC3(",
                                                    "\xED\xA0\x80", "\\U0010FFFF",
                                                    "\\uD800",      "\xF0\x9F\x94\xA5",
                                                    "..",           "/"};

bool ends_line_continued(std::string_view statement) {
  // Counts open brackets outside strings; sufficient to keep multi-line lists together.
  int open = 0;
  char quote = '\0';
  for (std::size_t i = 0; i < statement.size(); ++i) {
    const char c = statement[i];
    if (quote != '\0') {
      if (c == '\\' && quote == '"')
        ++i;
      else if (c == quote || c == '\n')
        quote = '\0';
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '#') {
      i = std::min(statement.find('\n', i), statement.size());
    } else if (c == '[' || c == '{') {
      ++open;
    } else if (c == ']' || c == '}') {
      --open;
    }
  }
  return open > 0;
}

bool is_header(std::string_view statement) {
  const auto first = statement.find_first_not_of(" \t");
  return first != std::string_view::npos && statement[first] == '[' &&
         statement.find('=') == std::string_view::npos;
}

std::vector<TomlBlock> split(std::string_view text) {
  constexpr std::size_t lines_max = 200;
  std::vector<TomlBlock> blocks(1);
  std::string statement;
  std::size_t lines = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size() - 1) + 1;
    statement += text.substr(0, end);
    text.remove_prefix(end);
    if (++lines < lines_max && statement.find('=') != std::string::npos && !text.empty() &&
        ends_line_continued(statement)) {
      continue;
    }
    if (is_header(statement)) blocks.emplace_back();
    blocks.back().statements.push_back(std::move(statement));
    statement.clear();
    lines = 0;
  }
  return blocks;
}

std::string joined(const std::vector<TomlBlock>& blocks, std::size_t size_max) {
  std::string text;
  for (const TomlBlock& block : blocks) {
    for (const std::string& statement : block.statements) text += statement;
  }
  if (text.size() > size_max) text.resize(size_max);
  return text;
}

std::string repeated(std::string_view part, std::size_t count) {
  std::string text;
  text.reserve(part.size() * count);
  for (std::size_t i = 0; i < count; ++i) text += part;
  return text;
}

/// Finds a number in `text` from `from` on. @return its length; 0: none
std::size_t find_number(std::string_view text, std::size_t from, std::size_t& at) {
  const auto is_part = [](char c) {
    return std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-' || c == '+' ||
           c == 'e' || c == '_';
  };
  for (at = from; at < text.size(); ++at) {
    if (std::isdigit(static_cast<unsigned char>(text[at])) == 0) continue;
    std::size_t end = at;
    while (end < text.size() && is_part(text[end])) ++end;
    if (at > 0 && text[at - 1] == '-') --at;
    return end - at;
  }
  return 0;
}

}  // namespace

std::size_t TomlMutator::below(std::size_t count) {
  return count == 0 ? 0 : std::uniform_int_distribution<std::size_t>(0, count - 1)(random_);
}

std::size_t TomlMutator::depth() {
  constexpr std::array<std::size_t, 12> depths{2,  3,   14,  15,   16,     17,
                                               18, 255, 257, 2000, 20'000, 60'000};
  return depths[below(depths.size())];
}

std::string* TomlMutator::any_statement(Blocks& blocks) {
  TomlBlock& block = blocks[below(blocks.size())];
  if (block.statements.empty()) return nullptr;
  return &block.statements[below(block.statements.size())];
}

TomlMutator::Assignment TomlMutator::any_assignment(Blocks& blocks) {
  for (int attempt = 0; attempt < 20; ++attempt) {
    std::string* statement = any_statement(blocks);
    if (statement == nullptr || statement->starts_with('#')) continue;
    const std::size_t equal = statement->find('=');
    if (equal == std::string::npos) continue;
    return {statement, statement->substr(0, equal), statement->substr(equal + 1)};
  }
  return {};
}

void TomlMutator::put(const Assignment& assignment) {
  std::string text = assignment.key + "=" + assignment.value;
  if (!text.ends_with('\n')) text += '\n';
  *assignment.statement = std::move(text);
}

void TomlMutator::move_statement(Blocks& blocks) {
  TomlBlock& from = blocks[below(blocks.size())];
  TomlBlock& to = blocks[below(blocks.size())];
  if (from.statements.empty()) return;
  const std::size_t at = below(from.statements.size());
  std::string statement = from.statements[at];
  if (below(2) == 0) from.statements.erase(from.statements.begin() + static_cast<long>(at));
  if (below(3) == 0) return;  // delete it
  const std::size_t place = below(to.statements.size() + 1);
  to.statements.insert(to.statements.begin() + static_cast<long>(place), std::move(statement));
}

void TomlMutator::repeat_block(Blocks& blocks, std::size_t room) {
  constexpr std::array<std::size_t, 6> counts{1, 2, 16, 64, 300, 3000};
  const std::size_t at = below(blocks.size());
  TomlBlock block = blocks[at];
  if (below(4) == 0) {
    blocks.erase(blocks.begin() + static_cast<long>(at));
    if (blocks.empty()) blocks.emplace_back();
    return;
  }
  const std::size_t bytes = joined({block}, static_cast<std::size_t>(-1)).size() + 8;
  const std::size_t count = std::min(counts[below(counts.size())], room / bytes);
  const bool renamed = below(2) == 0;
  for (std::size_t i = 0; i < count; ++i) {
    TomlBlock copy = block;
    for (std::string& statement : copy.statements) {
      const std::size_t quote = statement.rfind('"');
      if (renamed && statement.starts_with("name") && quote != std::string::npos) {
        statement.insert(quote, "_" + std::to_string(i));
      }
    }
    blocks.insert(blocks.begin() + static_cast<long>(below(blocks.size() + 1)), std::move(copy));
  }
}

void TomlMutator::deepen_key(Blocks& blocks, std::size_t room) {
  const std::string_view parts[] = {"a.", "b .", "'c'.", "\"d\"."};
  const std::string_view part = parts[below(4)];
  const std::size_t count = std::min(depth(), room / part.size());
  std::string* statement = any_statement(blocks);
  if (statement == nullptr || count == 0) return;
  const std::string path = repeated(part, count) + "z";
  switch (below(4)) {
    case 0:
      *statement = "[" + path + "]\n" + *statement;
      break;
    case 1:
      *statement = "[[" + path + "]]\n" + *statement;
      break;
    case 2:
      *statement = path + " = 1\n" + *statement;
      break;
    default: {
      const Assignment assignment = any_assignment(blocks);
      if (assignment.statement == nullptr) return;
      put({assignment.statement, assignment.key + "." + path, assignment.value});
    }
  }
}

void TomlMutator::deepen_value(Blocks& blocks, std::size_t room) {
  Assignment assignment = any_assignment(blocks);
  const std::size_t count = std::min(depth(), room / 8);
  if (assignment.statement == nullptr || count == 0) return;
  std::string inside = assignment.value;
  if (inside.ends_with('\n')) inside.pop_back();
  const bool is_closed = below(4) != 0;
  switch (below(3)) {
    case 0:
      assignment.value = repeated("[", count) + inside + (is_closed ? repeated("]", count) : "");
      break;
    case 1:
      assignment.value =
          repeated("{ a = ", count) + inside + (is_closed ? repeated(" }", count) : "");
      break;
    default:
      assignment.value = " { " + repeated("a.", count) + "z = " + inside + " }";
      break;
  }
  put(assignment);
}

void TomlMutator::change_number(Blocks& blocks) {
  Assignment assignment = any_assignment(blocks);
  if (assignment.statement == nullptr) return;
  std::size_t at = 0;
  std::size_t length = find_number(assignment.value, below(assignment.value.size()), at);
  if (length == 0) length = find_number(assignment.value, 0, at);
  if (length == 0) return;
  std::string number = assignment.value.substr(at, length);
  switch (below(5)) {
    case 0:
      number += std::to_string(below(10));
      break;
    case 1:
      number = number.starts_with('-') ? number.substr(1) : "-" + number;
      break;
    case 2:
      number = repeated("9", 1 + below(400));
      break;
    default:
      number = numbers[below(numbers.size())];
      break;
  }
  assignment.value.replace(at, length, number);
  put(assignment);
}

void TomlMutator::change_type(Blocks& blocks) {
  Assignment assignment = any_assignment(blocks);
  if (assignment.statement == nullptr) return;
  const Assignment other = any_assignment(blocks);
  assignment.value = below(3) == 0 && other.statement != nullptr
                         ? other.value
                         : " " + std::string(values[below(values.size())]) + "\n";
  put(assignment);
}

void TomlMutator::change_text(Blocks& blocks, std::size_t room) {
  Assignment assignment = any_assignment(blocks);
  if (assignment.statement == nullptr) return;
  const std::size_t quote = assignment.value.find('"');
  std::string odd(oddities[below(oddities.size())]);
  if (below(8) == 0) odd = repeated("n", std::min<std::size_t>(1 + below(5000), room));
  if (quote != std::string::npos) {
    const std::size_t end = assignment.value.find('"', quote + 1);
    const std::size_t length = end == std::string::npos ? 0 : end - quote - 1;
    assignment.value.insert(quote + 1 + below(length + 1), odd);
  } else if (below(2) == 0) {
    assignment.key = "\"" + odd + "\" ";
  } else {
    assignment.value = " \"" + odd + "\"\n";
  }
  put(assignment);
}

void TomlMutator::change_name(Blocks& blocks) {
  Assignment assignment = any_assignment(blocks);
  const Assignment other = any_assignment(blocks);
  if (assignment.statement == nullptr || other.statement == nullptr) return;
  switch (below(4)) {
    case 0:
      assignment.key = other.key;
      break;
    case 1:
      std::swap(assignment.value, assignment.key);
      break;
    case 2:
      assignment.key.insert(below(assignment.key.size() + 1), 1, 'x');
      break;
    default:
      assignment.value = other.value;
      break;
  }
  put(assignment);
}

void TomlMutator::lengthen_list(Blocks& blocks, std::size_t room) {
  constexpr std::array<std::size_t, 6> counts{1, 2, 30, 600, 5000, 40'000};
  Assignment assignment = any_assignment(blocks);
  if (assignment.statement == nullptr) return;
  const std::size_t open = assignment.value.find('[');
  const std::size_t end = assignment.value.find_first_of(",]", open);
  if (open == std::string::npos || end == std::string::npos) return;
  const std::string element = assignment.value.substr(open + 1, end - open - 1) + ", ";
  const std::size_t count = std::min(counts[below(counts.size())], room / element.size());
  assignment.value.insert(open + 1, repeated(element, count));
  put(assignment);
}

void TomlMutator::many_keys(Blocks& blocks, std::size_t room) {
  constexpr std::array<std::size_t, 4> counts{3, 90, 200, 8000};
  std::string* statement = any_statement(blocks);
  if (statement == nullptr) return;
  const std::size_t count = std::min(counts[below(counts.size())], room / 12);
  std::string keys;
  for (std::size_t i = 0; i < count; ++i) keys += "k" + std::to_string(i) + " = 1\n";
  *statement += keys;
}

void TomlMutator::change(Blocks& blocks, std::size_t room) {
  switch (below(12)) {
    case 0:
      return move_statement(blocks);
    case 1:
      return repeat_block(blocks, room);
    case 2:
      return deepen_key(blocks, room);
    case 3:
      return deepen_value(blocks, room);
    case 4:
      return change_type(blocks);
    case 5:
      return change_text(blocks, room);
    case 6:
      return change_name(blocks);
    case 7:
      return lengthen_list(blocks, room);
    case 8:
      return many_keys(blocks, room);
    default:
      return change_number(blocks);
  }
}

std::string TomlMutator::mutate(std::string_view text, std::size_t size_max) {
  Blocks blocks = split(text);
  const std::size_t changes = 1 + below(4);
  for (std::size_t i = 0; i < changes; ++i) {
    const std::size_t size = joined(blocks, size_max).size();
    change(blocks, size_max - size);
  }
  return joined(blocks, size_max);
}

std::string TomlMutator::cross(std::string_view text, std::string_view other,
                               std::size_t size_max) {
  Blocks blocks = split(text);
  const Blocks others = split(other);
  const std::size_t count = 1 + below(3);
  for (std::size_t i = 0; i < count; ++i) {
    const TomlBlock& block = others[below(others.size())];
    blocks.insert(blocks.begin() + static_cast<long>(below(blocks.size() + 1)), block);
  }
  return joined(blocks, size_max);
}

namespace {

std::string_view as_text(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace
}  // namespace thermocomp::fuzz

using thermocomp::fuzz::TomlMutator;

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t size_max, unsigned seed) {
  // Sometimes mutates bytes, for invalid TOML.
  if (seed % 8 == 0 || size == 0) return LLVMFuzzerMutate(data, size, size_max);
  const std::string text =
      TomlMutator(seed).mutate(thermocomp::fuzz::as_text(data, size), size_max);
  std::memcpy(data, text.data(), text.size());
  return text.size();
}

extern "C" std::size_t LLVMFuzzerCustomCrossOver(const std::uint8_t* first, std::size_t first_size,
                                                 const std::uint8_t* second,
                                                 std::size_t second_size, std::uint8_t* out,
                                                 std::size_t size_max, unsigned seed) {
  const std::string text =
      TomlMutator(seed).cross(thermocomp::fuzz::as_text(first, first_size),
                              thermocomp::fuzz::as_text(second, second_size), size_max);
  std::memcpy(out, text.data(), text.size());
  return text.size();
}
