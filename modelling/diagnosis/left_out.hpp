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
  /// Sum over all outputs of ln(RMS with / RMS without): how explanations of different outputs
  /// compare. Negative: better than nothing.
  double log_left{0.0};
};

/// Each block of rows is left out in turn; shape and gains come from the other blocks, each run's
/// offset from the rows that stayed.
[[nodiscard]] LeftOutGain gain_on_left_out_blocks(const Explanation& explanation,
                                                  const StackedRows& rows,
                                                  const std::vector<OutputEvidence>& outputs);

/// The same in the rows of the fit, for a fault that is located within one run.
[[nodiscard]] LeftOutGain gain_on_fitted_rows(const Explanation& explanation,
                                              const StackedRows& rows,
                                              const std::vector<OutputEvidence>& outputs);

}  // namespace thermocomp::diagnosis
