/// What a model leaves of runs that were not used to find anything, and what an extension gains.
#pragma once

#include <vector>

#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis {

/// What no term carries, in all outputs.
using Corrections = std::vector<Correction>;

struct Residuals {
  std::vector<Column> by_run;  ///< over the selected rows; NaN where nothing was measured
};

/// measured - model over the selected rows of every run, both from the run's first row on: the
/// data's own model, or another.
[[nodiscard]] Residuals residuals(const MeasuredData& data, std::size_t output);
[[nodiscard]] Residuals residuals(const ThermalModel& model, const Corrections& corrections,
                                  const MeasuredData& data, std::size_t output);
[[nodiscard]] double root_mean_square(const Residuals& residuals);
[[nodiscard]] double peak(const Residuals& residuals);
/// The interval is from blocks of rows drawn anew.
[[nodiscard]] TestGain test_gain(const Residuals& before, const Residuals& after);
/// Whether no output gains by it on the test runs. The extended model goes without it then.
[[nodiscard]] bool fails_on_test_runs(const NamedFinding& finding);

}  // namespace thermocomp::diagnosis
