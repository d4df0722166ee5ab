/// What a piezo driver is built from.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "estimator/checks.hpp"

namespace thermocomp {

struct PiezoConfig {
  /// Displacement over voltage as measured, each voltage coming from 0 V: both strictly increase,
  /// and 0 V is the first. Beyond the ends there is nothing: they are the limits.
  std::vector<double> curve_V;
  std::vector<double> curve_um;
  bool return_to_zero{true};  ///< to 0 V before each new voltage, which is then without hysteresis
  double settle_s{0.2};       ///< at 0 V
  double steady_s{1.0};       ///< an offset must stand still for so long before it is followed
  double step_um{0.2};        ///< a smaller change is not followed
  double tolerance_V{1.0};    ///< read back and written voltage may differ by this much
  inline void validate() const;  ///< @throws InvalidValue
  bool operator==(const PiezoConfig&) const = default;
};

namespace detail {

inline void check_increasing(const std::vector<double>& values, const char* key) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    require(std::isfinite(values[i]), key, values[i], "must be finite");
    if (i > 0)
      require(values[i] > values[i - 1], key, values[i],
              "must be more than the value before it: only such a curve can be inverted");
  }
}

}  // namespace detail

inline void PiezoConfig::validate() const {
  require(curve_V.size() >= 2, "curve_V", static_cast<double>(curve_V.size()),
          "must have at least two points");
  require(curve_um.size() == curve_V.size(), "curve_um", static_cast<double>(curve_um.size()),
          "must have as many points as curve_V");
  detail::check_increasing(curve_V, "curve_V");
  detail::check_increasing(curve_um, "curve_um");
  require(curve_V.front() == 0.0, "curve_V", curve_V.front(), "must begin at 0 V");
  require(curve_V.back() <= 1000.0, "curve_V", curve_V.back(), "must be at most 1000 V");
  require(settle_s >= 0 && settle_s <= 10, "settle_s", settle_s, "must be in [0, 10]");
  require(steady_s >= 0 && steady_s <= 600, "steady_s", steady_s, "must be in [0, 600]");
  require(tolerance_V >= 0.001 && tolerance_V <= 100, "tolerance_V", tolerance_V,
          "must be in [0.001, 100]");
  require(step_um >= 0.01 && step_um <= 10, "step_um", step_um, "must be in [0.01, 10]");
}

}  // namespace thermocomp
