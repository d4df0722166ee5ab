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

/// `value` with so many digits after the point, "-" for NaN, in a field of at least `width`.
[[nodiscard]] std::string fixed(double value, int digits, int width = 0);
/// The same with its sign always shown.
[[nodiscard]] std::string fixed_signed(double value, int digits, int width = 0);
/// `text` with blanks to its right (left-aligned) up to `width` characters (UTF-8).
[[nodiscard]] std::string padded(const std::string& text, int width);
/// A duration for people: "7 s", "12 min 5 s", "3 h 20 min", "5 d 2 h"; "-" for NaN.
[[nodiscard]] std::string duration_text(double seconds);

}  // namespace thermocomp::cli
