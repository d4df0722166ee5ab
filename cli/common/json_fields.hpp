/// Reads the daemon's answers: an absent or wrongly typed field gives NaN, empty, 0 or false.
#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

[[nodiscard]] double number_of(const nlohmann::json& object, const char* key);
[[nodiscard]] std::uint64_t count_of(const nlohmann::json& object, const char* key);
[[nodiscard]] std::string text_of(const nlohmann::json& object, const char* key);  ///< one line
[[nodiscard]] bool flag_of(const nlohmann::json& object, const char* key);
/// Empty array if absent.
[[nodiscard]] const nlohmann::json& list_of(const nlohmann::json& object, const char* key);
/// Empty object if absent.
[[nodiscard]] const nlohmann::json& object_of(const nlohmann::json& object, const char* key);

}  // namespace thermocomp::cli
