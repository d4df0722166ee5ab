#include "config/text/outer_json.hpp"

#include <string>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

using namespace thermocomp;
using Catch::Contains;

namespace {

std::string nested(std::size_t depth) {
  return std::string(depth, '[') + std::string(depth, ']');
}

}  // namespace

TEST_CASE("JSON from outside is accepted up to its limits and refused beyond", "[json]") {
  CHECK(parse_outer_json(nested(16)).is_array());
  CHECK_THROWS_WITH(parse_outer_json(nested(17)), Contains("at most 16 deep"));
  CHECK_THROWS_AS(parse_outer_json(nested(2'000'000)), JsonError);
  JsonLimits small;
  small.values_max = 4;
  small.bytes_max = 40;
  CHECK(parse_outer_json("[1,2,3]", small).size() == 3);
  CHECK_THROWS_WITH(parse_outer_json("[1,2,3,4,5]", small), Contains("at most 4 values"));
  CHECK_THROWS_WITH(parse_outer_json(std::string(41, ' '), small), Contains("at most 40 bytes"));
  for (const char* bad : {"", "{", "[1,]", "\xFF", "\"\xC3\"", "[[}]", "nul"})
    CHECK_THROWS_WITH(parse_outer_json(bad), Contains("JSON in UTF-8"));
}

TEST_CASE("brackets in strings are not counted and do not hide others", "[json]") {
  const std::string brackets = "\"" + std::string(100, '[') + "\\\"" + std::string(100, ']') + "\"";
  CHECK(parse_outer_json(brackets).is_string());
  CHECK_THROWS_AS(parse_outer_json("[" + brackets + "," + nested(100) + "]"), JsonError);
  CHECK_THROWS_AS(parse_outer_json("{\"a\\\\\":" + nested(100) + "}"), JsonError);
}
