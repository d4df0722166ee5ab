#include "cli/common/json_fields.hpp"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "estimator/types.hpp"

namespace thermocomp::cli {

namespace {

using nlohmann::json;

const json& field(const json& object, const char* key) {
  static const json nothing;
  if (!object.is_object()) return nothing;
  const auto found = object.find(key);
  return found == object.end() ? nothing : *found;
}

}  // namespace

double number_of(const json& object, const char* key) {
  const json& value = field(object, key);
  return value.is_number() ? value.get<double>() : not_a_number;
}

std::uint64_t count_of(const json& object, const char* key) {
  const double value = number_of(object, key);
  return value >= 0.0 && value < 1.8e19 ? static_cast<std::uint64_t>(value) : 0;
}

std::string text_of(const json& object, const char* key) {
  const json& value = field(object, key);
  std::string text = value.is_string() ? value.get<std::string>() : std::string();
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < ' '; }, ' ');
  return text;
}

bool flag_of(const json& object, const char* key) {
  const json& value = field(object, key);
  return value.is_boolean() && value.get<bool>();
}

const json& list_of(const json& object, const char* key) {
  static const json none = json::array();
  const json& value = field(object, key);
  return value.is_array() ? value : none;
}

const json& object_of(const json& object, const char* key) {
  static const json none = json::object();
  const json& value = field(object, key);
  return value.is_object() ? value : none;
}

}  // namespace thermocomp::cli
