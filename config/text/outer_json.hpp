/// JSON from outside (a socket, a file, a browser): bounded before anything is built from it.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp {

/// Why a text is not taken; the message is a sentence without a subject: "must be ...".
class JsonError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct JsonLimits {
  /// Nesting of arrays and objects; the deepest message of this project has 6. Copying, printing
  /// and comparing what is nested 100,000 deep would need a stack as deep.
  int depth_max{16};
  /// Values and commas: each takes some tens of bytes of memory, however short its text.
  std::size_t values_max{1'000'000};
  std::size_t bytes_max{std::size_t{16} << 20};
};

/// Every text in JSON that another process, a person or a file wrote is read by this.
/// @throws JsonError  beyond a limit, or no JSON in UTF-8
[[nodiscard]] nlohmann::json parse_outer_json(std::string_view text, const JsonLimits& limits = {});

}  // namespace thermocomp
