/// A model over a run file: the model alone, no smoothing, no limits.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::cli {

struct PredictedOutput {
  std::string name;                  ///< column of the model's output
  bool measured_there{false};        ///< the run file has that column
  std::vector<double> predicted_um;  ///< model(t) - model(t0); um, or urad for a tilt
  std::vector<double> measured_um;   ///< measured(t) - measured(t0); NaN: missing
  double rms_um{0.0};                ///< of measured - predicted, mean not removed; NaN: none
  double peak_um{0.0};               ///< largest |measured - predicted|; NaN: none
  std::vector<double> sd_um;         ///< of predicted_um, as the model claims; empty: it does not
};

/// The selected row that is furthest from what the model was made from.
struct FurthestRow {
  double time_s{0.0};
  double distance{0.0};  ///< over that up to which the model counts as known; 0: no row
  std::string column;    ///< that most of it is of
  double value{0.0};     ///< there
  double low{0.0};       ///< that the model was made from
  double high{0.0};
};

/// Rows of the selection that have a prediction: those in which no input of the model is missing
/// and, where the run file has any measured output, not all of them are.
struct Prediction {
  std::vector<double> time_s;
  std::vector<double>
      outside;  ///< 1 where the machine is not as the model was made; empty: unknown
  FurthestRow furthest;
  std::vector<PredictedOutput> outputs;  ///< order of the model
};

/// The reference of an input is the model's, or the first value of its column in the whole file.
/// t0 of an output is the whole file's first row with a prediction and a measured value; the
/// states of lags start at the file's first row with a prediction, whatever is selected.
/// @throws ConfigurationError when the run file lacks a column of the model or has no value in it
[[nodiscard]] Prediction predict(const ThermalModel& model, const RunFile& run);

/// Share of the rows that are outside of the model's domain.
[[nodiscard]] double outside_share(const Prediction& prediction);

/// How far from known ground, and in which quantity: one sentence; of a prediction that stays
/// inside nothing.
[[nodiscard]] std::string furthest_text(const Prediction& prediction);

/// The columns of the answer: time_s and, for each output, predicted, measured and residual; where
/// the model says what it was made from, `outside` and the standard deviation of each output.
[[nodiscard]] RunFile as_run_file(const Prediction& prediction);

}  // namespace thermocomp::cli
