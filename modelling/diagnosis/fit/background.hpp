/// What is left of a displacement when nothing acts: noise of single values, and a part that
/// wanders.
#pragma once

#include <vector>

#include "modelling/diagnosis/data/block.hpp"
#include "modelling/diagnosis/data/panel.hpp"

namespace thermocomp::diagnosis {

/// Covariance of two rows of one run, s the standard deviation of the white part:
///
///   s^2 (delta(t - t') + ratio^2 exp(-|t - t'| / tau))
struct Background {
  double ratio{0.0};  ///< of the wandering part's standard deviation to the white part's
  double tau_s{1.0};
};

/// Those that are reckoned with; each as likely as another beforehand.
[[nodiscard]] const std::vector<Background>& backgrounds();

/// Turns each column into innovations of standard deviation s (Kalman filter of each run), shape
/// (rows, m), in place.
/// @return ln of the determinant of the covariance over s^2
double whiten(const Background& background, const Column& time_s, const std::vector<Block>& runs,
              Panel& columns);

}  // namespace thermocomp::diagnosis
