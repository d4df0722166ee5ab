/// Applies a model to a run file, without smoothing and limits.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::cli {

struct PredictedOutput {
  std::string name;                  ///< column of the model's output
  bool measured_there{false};        ///< the run file has this column
  std::vector<double> predicted_um;  ///< model(t) - model(t0); um, or urad for a tilt
  std::vector<double> measured_um;   ///< measured(t) - measured(t0); NaN: missing
  double rms_um{0.0};                ///< of measured - predicted, mean not removed; NaN: none
  double peak_um{0.0};               ///< largest |measured - predicted|; NaN: none
  std::vector<double> sd_um;         ///< of predicted_um, claimed by the model; empty: none
};

/// The selected row furthest outside the model's domain.
struct FurthestRow {
  double time_s{0.0};
  double distance{0.0};  ///< relative to the domain's limit; 0: no row
  std::string column;    ///< largest contribution to the distance
  double value{0.0};     ///< of `column` in this row
  double low{0.0};       ///< lower limit in the model's records
  double high{0.0};
};

/// The selected rows with every input and, if outputs were measured, at least one measured value.
struct Prediction {
  std::vector<double> time_s;
  std::vector<double> outside;  ///< 1: outside the model's domain; empty: unknown
  FurthestRow furthest;
  std::vector<PredictedOutput> outputs;  ///< in the model's order
};

/// The reference of an input is the model's, else the first value of its column in the file. t0 of
/// an output is the file's first row with a prediction and a measured value. The states of lags
/// start at the file's first row with a prediction. None of these depends on the selection. Each
/// stretch between two references of a daemon's export is predicted by itself.
/// @throws ConfigurationError if a column of the model is missing or empty
[[nodiscard]] Prediction predict(const ThermalModel& model, const RunFile& run);

[[nodiscard]] double outside_share(const Prediction& prediction);

/// A sentence with the furthest row's distance and column; empty if every row is inside.
[[nodiscard]] std::string furthest_text(const Prediction& prediction);

/// Columns: time_s, and predicted, measured and residual of each output; if the model has a domain,
/// `outside` and each output's standard deviation.
[[nodiscard]] RunFile as_run_file(const Prediction& prediction);

}  // namespace thermocomp::cli
