#include "config/text/outer_json.hpp"

#include <algorithm>
#include <string>

#include <nlohmann/json.hpp>

namespace thermocomp {
namespace {

struct Extent {
  int depth{0};
  std::size_t values{0};
};

/// Counts brackets and commas outside strings, matching or not.
Extent extent_of(std::string_view text) noexcept {
  Extent extent;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      extent.depth = std::max(extent.depth, ++depth);
      ++extent.values;
    } else if (c == ']' || c == '}') {
      --depth;
    } else if (c == ',') {
      ++extent.values;
    }
  }
  return extent;
}

}  // namespace

nlohmann::json parse_outer_json(std::string_view text, const JsonLimits& limits) {
  if (text.size() > limits.bytes_max)
    throw JsonError("must have at most " + std::to_string(limits.bytes_max) + " bytes");
  const Extent extent = extent_of(text);
  if (extent.depth > limits.depth_max)
    throw JsonError("must nest arrays and objects at most " + std::to_string(limits.depth_max) +
                    " deep");
  if (extent.values > limits.values_max)
    throw JsonError("must have at most " + std::to_string(limits.values_max) + " values");
  nlohmann::json parsed = nlohmann::json::parse(text, nullptr, false);
  if (parsed.is_discarded()) throw JsonError("must be JSON in UTF-8");
  return parsed;
}

}  // namespace thermocomp
