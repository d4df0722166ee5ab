/// How much of what a model leaves could be predicted at all from what was recorded.
#pragma once

#include <vector>

#include "modelling/diagnosis/evidence/evidence.hpp"

namespace thermocomp::diagnosis {

/// Shares of the variance that a model leaves of an output; they add to 1.
struct Headroom {
  double noise{0.0};         ///< of single values
  double named{0.0};         ///< what the findings carry
  double predictable{0.0};   ///< from what was recorded, but without a name
  double not_recorded{1.0};  ///< by nothing in this recording
};

/// The share of an output's remainder that everything recorded predicts in rows left out: ridge on
/// lag_bank(), the penalty of each left-out block chosen on blocks of the other rows. Never below
/// 0.
/// @param bank  over the stacked rows, shape (rows, columns)
[[nodiscard]] double predictable_share(const StackedRows& rows, const OutputEvidence& evidence,
                                       const Eigen::MatrixXd& bank);

/// Every recorded temperature and signal (and its square) at several lags over the stacked rows,
/// each run's mean taken off, of spread 1.
[[nodiscard]] Eigen::MatrixXd lag_bank(const MeasuredData& data, const StackedRows& rows);

/// @param carried  share of the variance, noise taken out, that the findings carry
/// @param predictable  of the remainder with nothing named
[[nodiscard]] Headroom headroom(double noise_share, double carried, double predictable);

}  // namespace thermocomp::diagnosis
