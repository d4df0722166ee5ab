/// Reading an answer of the daemon without trusting its shape: what is absent, null or of another
/// type is NaN, empty, zero or false.
#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

[[nodiscard]] double number_of(const nlohmann::json& object, const char* key);
[[nodiscard]] std::uint64_t count_of(const nlohmann::json& object, const char* key);
[[nodiscard]] std::string text_of(const nlohmann::json& object, const char* key);  ///< one line
[[nodiscard]] bool flag_of(const nlohmann::json& object, const char* key);
/// An empty array where there is none.
[[nodiscard]] const nlohmann::json& list_of(const nlohmann::json& object, const char* key);
/// An empty object where there is none.
[[nodiscard]] const nlohmann::json& object_of(const nlohmann::json& object, const char* key);

}  // namespace thermocomp::cli
