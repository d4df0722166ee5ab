/// What a model leaves of runs that were not used to find anything, and what an extension gains.
#pragma once

#include <vector>

#include "modelling/diagnosis/answer.hpp"

namespace thermocomp::diagnosis {

/// What a finding changes that no term of the model file carries, in one output: a shift in time,
/// or a sine of known period and size. The sine's phase is another one in every run and is taken
/// from the run itself.
struct Correction {
  std::size_t output{0};
  double shift_s{0.0};
  double period_s{0.0};
  double amplitude_um{0.0};
};
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
