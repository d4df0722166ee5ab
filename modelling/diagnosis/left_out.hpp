/// How well an explanation predicts rows that it was not fitted to.
#pragma once

#include "modelling/diagnosis/evidence.hpp"

namespace thermocomp::diagnosis {

struct LeftOutGain {
  /// 1 - RMS with the explanation / RMS without, over all outputs that it acts on, each in units of
  /// its own RMS.
  double share{0.0};
  /// The same with all outputs in one unit: what is large counts.
  double share_of_all{0.0};
  /// Sum over its outputs of ln(RMS that is left / RMS of the residual): how explanations of
  /// different outputs compare. Negative: better than nothing.
  double log_left{0.0};
};

/// Each block of rows is left out in turn; shape and gains come from the other blocks, each run's
/// offset from the rows that stayed.
[[nodiscard]] LeftOutGain gain_on_left_out_blocks(const Explanation& explanation,
                                                  const StackedRows& rows,
                                                  const std::vector<OutputEvidence>& outputs);

/// The log_left of an output that no hypothesis acts on: what errors of the coefficients alone
/// leave of rows that they were not fitted to; 0 where they are taken as right.
[[nodiscard]] double log_left_without(const OutputEvidence& evidence, const StackedRows& rows);

/// For a fault that is located within one run: its shape and gains from all rows, everything else
/// from the other blocks.
[[nodiscard]] LeftOutGain gain_on_fitted_rows(const Explanation& explanation,
                                              const StackedRows& rows,
                                              const std::vector<OutputEvidence>& outputs);

}  // namespace thermocomp::diagnosis
