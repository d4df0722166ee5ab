#include "config/text/printable_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <optional>

namespace thermocomp {
namespace {

/// The first character and its number of bytes. Source: RFC 3629, section 4.
/// @return nullopt: invalid UTF-8 (overlong form, surrogate, beyond U+10FFFF, truncated)
std::optional<char32_t> first_character(std::string_view text, std::size_t& bytes) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(0);
  bytes = 1;
  if (lead < 0x80) return lead;
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < length) return std::nullopt;
  auto character = static_cast<char32_t>(lead & (0xFFu >> (length + 1)));
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0u) != 0x80u) return std::nullopt;
    character = character << 6 | (byte(i) & 0x3Fu);
  }
  constexpr std::array<char32_t, 5> smallest{0, 0, 0x80, 0x800, 0x10000};
  const bool is_surrogate = character >= 0xD800 && character <= 0xDFFF;
  if (character < smallest[length] || is_surrogate || character > 0x10FFFF) return std::nullopt;
  bytes = length;
  return character;
}

bool is_c0(char32_t c) {
  return c < 0x20 || c == 0x7F;
}

bool is_shown(char32_t c) {
  struct Span {
    char32_t first, last;
  };
  // C1; Arabic letter mark; zero width, direction marks; separators, embeddings, overrides; word
  // joiner to isolates and deprecated formats; byte order mark; interlinear marks; tags.
  constexpr std::array<Span, 9> hidden{{{0x80, 0x9F},
                                        {0x61C, 0x61C},
                                        {0x200B, 0x200B},
                                        {0x200E, 0x200F},
                                        {0x2028, 0x202E},
                                        {0x2060, 0x206F},
                                        {0xFEFF, 0xFEFF},
                                        {0xFFF9, 0xFFFB},
                                        {0xE0000, 0xE007F}}};
  if (is_c0(c)) return false;
  return std::none_of(hidden.begin(), hidden.end(),
                      [c](const Span& span) { return c >= span.first && c <= span.last; });
}

}  // namespace

bool is_printable(std::string_view text) {
  while (!text.empty()) {
    std::size_t bytes = 0;
    const auto character = first_character(text, bytes);
    if (!character || !is_shown(*character)) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

std::string printable_text(std::string_view text) {
  std::string shown;
  shown.reserve(text.size());
  while (!text.empty()) {
    std::size_t bytes = 0;
    const auto character = first_character(text, bytes);
    if (!character) {
      shown += '?';
    } else if (is_shown(*character)) {
      shown += text.substr(0, bytes);
    } else if (is_c0(*character)) {
      shown += ' ';
    } else {
      std::array<char, 16> name{};
      std::snprintf(name.data(), name.size(), "<U+%04X>", static_cast<unsigned>(*character));
      shown += name.data();
    }
    text.remove_prefix(bytes);
  }
  return shown;
}

void append_number(std::string& text, double value) {
  if (std::isnan(value)) {  // to_chars would print the sign of a NaN
    text += "nan";
    return;
  }
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  text.append(buffer.data(), end);
}

std::string number_text(double value) {
  std::string text;
  append_number(text, value);
  return text;
}

}  // namespace thermocomp
