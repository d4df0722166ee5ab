#include "config/text/number_text.hpp"

#include <array>
#include <charconv>
#include <cmath>

namespace thermocomp {

void append_number(std::string& text, double value) {
  if (std::isnan(value)) {  // to_chars would show the sign of a NaN
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
