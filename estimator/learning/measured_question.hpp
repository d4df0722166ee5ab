/// Whether a displacement that a person gives contradicts what the model claims of itself, and
/// which slip would explain it.
#pragma once

#include <cmath>
#include <cstdint>
#include <string_view>

namespace thermocomp {

enum class Slip : std::uint8_t {
  none,     ///< it agrees
  sign,     ///< its negative agrees
  tenfold,  ///< a tenth of it agrees
  tenth,    ///< ten times it agrees
  unexplained
};

/// Beyond so many standard deviations a person is asked.
inline constexpr double question_sigma = 3.0;

/// @param sd_um  of their difference: the model's claim and the measurement; NaN: nothing is
/// claimed
[[nodiscard]] inline Slip slip_of(double value_um, double expected_um, double sd_um) noexcept {
  if (!std::isfinite(sd_um) || !std::isfinite(expected_um)) return Slip::none;
  const auto agrees = [&](double value) {
    return std::abs(value - expected_um) <= question_sigma * sd_um;
  };
  if (agrees(value_um)) return Slip::none;
  if (agrees(-value_um)) return Slip::sign;
  if (agrees(0.1 * value_um)) return Slip::tenfold;
  if (agrees(10.0 * value_um)) return Slip::tenth;
  return Slip::unexplained;
}

[[nodiscard]] constexpr std::string_view text_of(Slip slip) noexcept {
  switch (slip) {
    case Slip::none:
      return "";
    case Slip::sign:
      return "the opposite sign would fit";
    case Slip::tenfold:
      return "a tenth of it would fit";
    case Slip::tenth:
      return "ten times it would fit";
    case Slip::unexplained:
      break;
  }
  return "perhaps another axis or another tool";
}

}  // namespace thermocomp
