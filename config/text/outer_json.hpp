/// JSON from outside (a socket, a file, a browser), with limits checked before parsing.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp {

/// Reason for refusing a text, as a predicate: "must be ...".
class JsonError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct JsonLimits {
  /// Nesting of arrays and objects; our deepest message has 6. Copying, printing and comparing
  /// recurse: a depth of 100,000 would overflow the stack.
  int depth_max{16};
  /// Values and commas: each takes some tens of bytes of memory.
  std::size_t values_max{1'000'000};
  std::size_t bytes_max{std::size_t{16} << 20};
};

/// Parses JSON written by another process, a person or a file.
/// @throws JsonError  beyond a limit, or not JSON in UTF-8
[[nodiscard]] nlohmann::json parse_outer_json(std::string_view text, const JsonLimits& limits = {});

}  // namespace thermocomp
