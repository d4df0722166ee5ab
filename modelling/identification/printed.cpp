#include "modelling/identification/printed.hpp"

#include <array>
#include <cstdarg>
#include <cstdio>

namespace thermocomp::identification {

std::string printed(const char* format, ...) {
  std::array<char, 501> text{};
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text.data(), text.size(), format, arguments);
  va_end(arguments);
  return text.data();
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace thermocomp::identification
