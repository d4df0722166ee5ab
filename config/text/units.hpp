/// The unit of a column is the longest registered suffix of its name.
#pragma once

#include <string_view>

namespace thermocomp {

enum class QuantityKind {
  time,          ///< time_s
  temperature,   ///< *_degC, *_K
  displacement,  ///< *_um
  tilt,          ///< *_urad
  position,      ///< *_mm
  signal         ///< *_rpm *_mm_per_min *_A *_W *_V *_on *_percent, and every other name
};

struct Unit {
  std::string_view suffix;  ///< "_mm_per_min"; empty: no unit
  std::string_view symbol;  ///< "mm/min"; empty: no unit
  QuantityKind kind{QuantityKind::signal};
};

/// @param column  full name. A name that equals the suffix has no unit.
[[nodiscard]] Unit unit_of(std::string_view column);
[[nodiscard]] QuantityKind kind_of(std::string_view column);
[[nodiscard]] bool is_temperature(std::string_view column);
/// Displacement or tilt: a model's output and an axis' input.
[[nodiscard]] bool is_output(std::string_view column);
/// Position or operating signal, reported by a controller.
[[nodiscard]] bool is_operating(std::string_view column);

/// Whether a run file's column can have this name: printable UTF-8 without comma, quote, `|` (which
/// joins two subjects), blanks at the ends, and `#` at the start.
[[nodiscard]] bool is_column_name(std::string_view name);
inline constexpr std::string_view column_name_rule =
    "a column's name must be printable, without comma, quote, |, a blank at an end, # at the start";

}  // namespace thermocomp
