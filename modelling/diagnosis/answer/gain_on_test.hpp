/// What a model leaves of runs that were not used to find anything, and what an extension gains.
#pragma once

#include <vector>

#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis {

/// A model with what no term of it carries.
struct Extended {
  ThermalModel model;
  std::vector<Correction> corrections;
};

struct Residuals {
  std::vector<Column> by_run;  ///< over the selected rows; NaN where nothing was measured
};

/// measured - model of every output over the selected rows of every run, both from the run's first
/// row on: the data's own model, or another.
[[nodiscard]] std::vector<Residuals> residuals(const MeasuredData& data);
[[nodiscard]] std::vector<Residuals> residuals(const Extended& extended, const MeasuredData& data);
[[nodiscard]] double root_mean_square(const Residuals& residuals);
/// Of what the model leaves of training and test runs, and the extended model of test runs.
[[nodiscard]] OutputFigures output_figures(const Residuals& train, const Residuals& test,
                                           const Residuals& extended_test,
                                           double unexplained_fraction);
/// The interval is from blocks of rows drawn anew.
[[nodiscard]] TestGain test_gain(const Residuals& before, const Residuals& after);
/// Whether no output gains by it on the test runs. The extended model goes without it then.
[[nodiscard]] bool fails_on_test_runs(const NamedFinding& finding);

}  // namespace thermocomp::diagnosis
