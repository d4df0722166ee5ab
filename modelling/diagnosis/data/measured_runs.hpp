/// Columns and their filters; measured runs with the model's prediction.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/runs/run_file.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::diagnosis {

using Column = Eigen::VectorXd;

/// Row-major, since filters process all columns of a row at once.
using Panel = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The series filtered by the estimator's LowPass with each tau_s, shape (rows, taus).
[[nodiscard]] Panel lagged(const Column& time_s, const Column& values,
                           const std::vector<double>& taus_s);
[[nodiscard]] Column lagged(const Column& time_s, const Column& values, double tau_s);

/// Output of the estimator's Play with each width, minus the series; shape (rows, widths).
[[nodiscard]] Panel played_less_values(const Column& values, const std::vector<double>& widths);

/// The series shifted by `shift_s` (positive: late), interpolated, held at the ends.
[[nodiscard]] Column shifted(const Column& time_s, const Column& values, double shift_s);

/// Smoothed forwards and backwards with tau_s, without a phase shift.
[[nodiscard]] Column smoothed(const Column& time_s, const Column& values, double tau_s);

/// The values smoothed forwards and backwards over 0, 1, 2, 4 or 8 rows, whichever predicts a
/// left-out row best: it removes the noise of single values.
[[nodiscard]] Column denoised(const Column& time_s, const Column& values);

/// The derivative [1/s] of the values smoothed with tau_s.
[[nodiscard]] Column slope(const Column& time_s, const Column& values, double tau_s);

/// `count` values from low to high with a constant ratio, or with a constant step.
[[nodiscard]] std::vector<double> logarithmic_grid(double low, double high, std::size_t count);
[[nodiscard]] std::vector<double> linear_grid(double low, double high, std::size_t count);

/// Rows [begin, end), correlated only with each other.
struct Block {
  Eigen::Index begin{0};
  Eigen::Index end{0};
};

/// One run: its rows with all inputs of the model, from the first such row of the file to the end
/// of the selection. Missing values of other columns hold the last one.
struct MeasuredRun {
  std::string name;       ///< RunFile::argument
  std::size_t number{0};  ///< among MeasuredData::runs
  Column time_s;
  Eigen::Index begin{0};               ///< first selected row
  std::vector<Column> temps_K;         ///< rises, order of MeasuredData::temperatures
  std::vector<double> reference_degC;  ///< reference of each rise
  std::vector<Column> denoised_K;      ///< temps_K without the noise of single values
  std::vector<Column> signals;         ///< order of MeasuredData::signals
  std::vector<Column> model_um;        ///< order of the outputs, relative to the output's first row
  std::vector<Column> measured_um;     ///< the same; NaN: missing
  [[nodiscard]] Eigen::Index rows() const { return time_s.size(); }
};

/// Rows of all selected runs, one run below the other.
struct StackedRows {
  std::vector<Block> runs;  ///< rows of each run
  Column time_s;
};

struct MeasuredData {
  ThermalModel model;
  std::vector<std::string> temperatures;  ///< inputs of the model, then those that it does not use
  std::vector<std::string> signals;       ///< operating signals and positions
  std::vector<MeasuredRun> runs;
  StackedRows rows{};
  /// Least noise of a single value per output, from the resolution of its converter; empty:
  /// unknown.
  std::vector<double> least_noise_um{};
  /// Prior standard deviation of the relative errors of the model's coefficients; 0: they are
  /// exact.
  double coefficient_sd{0.0};

  /// Index of a temperature; the number of temperatures if there is none of this name.
  [[nodiscard]] std::size_t place_of(const std::string& temperature) const;
  /// Adds a run and its rows.
  void add(MeasuredRun run);
  /// Coefficient of an input [um/K] in each row, from matrix and guideways.
  [[nodiscard]] Column coefficient(const MeasuredRun& run, std::size_t output,
                                   std::size_t input) const;
};

/// Columns that all runs have, in the order of the first run.
struct SharedColumns {
  std::vector<std::string> temperatures;  ///< after the model's inputs
  std::vector<std::string> signals;
};
[[nodiscard]] SharedColumns shared_columns(const ThermalModel& model,
                                           const std::vector<RunFile>& runs,
                                           const std::vector<RunFile>& further = {});

/// Prediction in every row of the run by the estimator's DisplacementModel; shape (outputs, rows).
[[nodiscard]] std::vector<Column> model_over(const ThermalModel& model, const MeasuredRun& run,
                                             const MeasuredData& data);

/// @throws ConfigurationError when a run lacks an input or signal of the model, or has no measured
///         value of any output
[[nodiscard]] MeasuredData measured_data(const ThermalModel& model,
                                         const std::vector<RunFile>& runs,
                                         const SharedColumns& columns);

/// Index of the room's temperature by its name: one that the model does not use, else an input.
[[nodiscard]] std::optional<std::size_t> room_among(const MeasuredData& data);

/// Columns over the stacked rows.
/// @param make  returns all rows of a run, a column or shape (rows, m)
/// @param only  if given, rows of the other runs are 0
/// @return shape (stacked rows, m)
template <class Make>
[[nodiscard]] Panel stacked(const MeasuredData& data, Make make,
                            std::optional<std::size_t> only = std::nullopt) {
  Panel all;
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    if (only && *only != i) continue;
    const Panel whole = make(data.runs[i]);
    const Block& block = data.rows.runs[i];
    if (all.size() == 0) all.setZero(data.rows.time_s.size(), whole.cols());
    all.middleRows(block.begin, block.end - block.begin) =
        whole.bottomRows(block.end - block.begin);
  }
  return all;
}

/// Temperatures whose rises over the selected rows correlate above 0.98, by name; every temperature
/// is in its own group.
using PlaceGroups = std::map<std::string, std::vector<std::string>>;
[[nodiscard]] PlaceGroups place_groups(const MeasuredData& data);
/// Whether two subjects differ only by places of one group.
[[nodiscard]] bool same_places(const PlaceGroups& groups, const std::string& subject,
                               const std::string& other);
/// The group of every place of a subject, without repetition, the subject's own places first; then
/// the places of other subjects.
[[nodiscard]] std::vector<std::string> group_of(const PlaceGroups& groups,
                                                const std::string& subject,
                                                const std::vector<std::string>& others = {});

/// Change of the prediction of an output by errors of an input, f(T + e) - f(T) for each column e
/// of errors over all rows of the run. f is the estimator's DisplacementModel with matrix,
/// guideways and the terms that use the input, without a play of the whole output. It is not linear
/// in e if a term is not (square, play).
/// @param errors_K  shape (rows, m)
/// @return displacement [um], the same shape
[[nodiscard]] Panel answer_to_errors(const MeasuredData& data, const MeasuredRun& run,
                                     std::size_t output, std::size_t input, Panel errors_K);

/// Steady-state change for an error of 1 K [um/K].
/// @pre the model has no guideways
[[nodiscard]] double settled_um_per_K(const MeasuredData& data, std::size_t output,
                                      std::size_t input);

}  // namespace thermocomp::diagnosis
