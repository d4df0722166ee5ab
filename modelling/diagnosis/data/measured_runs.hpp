/// Measured runs beside what the model says of them: the material of a diagnosis.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/runs/run_file.hpp"
#include "estimator/thermal_model.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis {

/// Rows [begin, end) that are correlated with each other and with no other rows.
struct Block {
  Eigen::Index begin{0};
  Eigen::Index end{0};
};

/// One run: its rows in which no input of the model is missing, from the file's first such row to
/// the end of the selection. Missing values of other columns are held at the last one.
struct MeasuredRun {
  std::string name;       ///< the argument as given
  std::size_t number{0};  ///< among MeasuredData::runs
  Column time_s;
  Eigen::Index begin{0};               ///< first selected row
  std::vector<Column> temps_K;         ///< rises, order of MeasuredData::temperatures
  std::vector<double> reference_degC;  ///< where the rises are 0
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
  /// Least noise of a single value of each output, as the steps of its converter make it; empty:
  /// nothing is known.
  std::vector<double> least_noise_um{};
  /// How far every coefficient of the model may be wrong without being a cause of its own: standard
  /// deviation, as a share of the coefficient. 0: they are never doubted.
  double coefficient_sd{0.0};

  /// Place of a temperature; the number of temperatures where there is none of this name.
  [[nodiscard]] std::size_t place_of(const std::string& temperature) const;
  /// Adds a run and its rows.
  void add(MeasuredRun run);
  /// The model's coefficient of an input [um/K] in each row: matrix and guideways.
  [[nodiscard]] Column coefficient(const MeasuredRun& run, std::size_t output,
                                   std::size_t input) const;
};

/// Columns that every one of the runs and of the further ones has, in the order of the first run.
struct SharedColumns {
  std::vector<std::string> temperatures;  ///< after the model's inputs
  std::vector<std::string> signals;
};
[[nodiscard]] SharedColumns shared_columns(const ThermalModel& model,
                                           const std::vector<RunFile>& runs,
                                           const std::vector<RunFile>& further = {});

/// The model at every row of the run, in the estimator's own arithmetic; shape (outputs, rows).
[[nodiscard]] std::vector<Column> model_over(const ThermalModel& model, const MeasuredRun& run,
                                             const MeasuredData& data);

/// @param names  the runs' arguments as given
/// @throws ConfigurationError when a run lacks an input or signal of the model, or has no measured
///         value of any output
[[nodiscard]] MeasuredData measured_data(const ThermalModel& model,
                                         const std::vector<RunFile>& runs,
                                         const std::vector<std::string>& names,
                                         const SharedColumns& columns);

/// Place of the room's temperature: one that the model does not use, else one of its inputs;
/// nullopt: none is called so.
[[nodiscard]] std::optional<std::size_t> room_among(const MeasuredData& data);

/// Columns over the stacked rows.
/// @param make  of a run: all its rows, a column or shape (rows, m)
/// @param only  if given, the other runs are 0
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
/// Whether two subjects are the same but for places of one group.
[[nodiscard]] bool same_places(const PlaceGroups& groups, const std::string& subject,
                               const std::string& other);
/// The group of every place of a subject, without repetition, the subject's own places first; then
/// the places of other subjects.
[[nodiscard]] std::vector<std::string> group_of(const PlaceGroups& groups,
                                                const std::string& subject,
                                                const std::vector<std::string>& others = {});

/// The displacement that the model predicts too much of an output because an input reads too high,
/// f(T + e) - f(T) for each column e of errors [K] over all rows of the run, f being the
/// estimator's own arithmetic with the terms that name the input: matrix, guideways, lags, banks of
/// lags. A play of the whole output is left out. Where a term is not linear in the reading (its
/// square, a play), the answer to a multiple of e is only nearly that multiple.
/// @param errors_K  shape (rows, m)
/// @return displacement [um], the same shape
[[nodiscard]] Panel answer_to_errors(const MeasuredData& data, const MeasuredRun& run,
                                     std::size_t output, std::size_t input, Panel errors_K);

/// The same of an input that has read 1 K too high since long before the first run [um/K].
/// @pre the model has no guideways
[[nodiscard]] double settled_um_per_K(const MeasuredData& data, std::size_t output,
                                      std::size_t input);

}  // namespace thermocomp::diagnosis
