/// Measured runs beside what the model says of them: the material of a diagnosis.
#pragma once

#include <map>
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
  std::string name;  ///< the argument as given
  Column time_s;
  Eigen::Index begin{0};         ///< first selected row
  std::vector<Column> inputs_K;  ///< rise over the reference, order of the model's inputs
  std::vector<Column> others_K;  ///< rise of MeasuredData::others
  std::vector<Column> signals;   ///< order of MeasuredData::signals
  std::vector<double> inputs_reference_degC;
  std::vector<double> others_reference_degC;
  // What the search alone needs; of training runs only.
  std::vector<Column> others_degC;
  std::vector<Column> inputs_degC;
  /// inputs_K and others_K without the noise of single values, as far as it can be seen.
  std::vector<Column> denoised_inputs_K;
  std::vector<Column> denoised_others_K;
  std::vector<Column> model_um;     ///< order of the outputs, relative to the output's first row
  std::vector<Column> measured_um;  ///< the same; NaN: missing
  [[nodiscard]] Eigen::Index rows() const { return time_s.size(); }
};

struct MeasuredData {
  ThermalModel model;
  std::vector<std::string> others;   ///< temperatures that the model does not use
  std::vector<std::string> signals;  ///< operating signals and positions
  std::vector<MeasuredRun> runs;
  /// Least noise of a single value of each output, as the steps of its converter make it; empty:
  /// nothing is known.
  std::vector<double> least_noise_um{};
  /// How far every coefficient of the model may be wrong without being a cause of its own: standard
  /// deviation, as a share of the coefficient. 0: they are never doubted.
  double coefficient_sd{0.0};

  /// The reference of a temperature in a run. @pre an input or one of the others
  [[nodiscard]] double reference_degC(const MeasuredRun& run, const std::string& name) const;
  /// The model's coefficient of an input [um/K] in each row: matrix and guideways.
  [[nodiscard]] Column coefficient(const MeasuredRun& run, std::size_t output,
                                   std::size_t input) const;
};

/// Columns that every one of the runs and of the further ones has, in the order of the first run.
struct SharedColumns {
  std::vector<std::string> others;
  std::vector<std::string> signals;
};
[[nodiscard]] SharedColumns shared_columns(const ThermalModel& model,
                                           const std::vector<RunFile>& runs,
                                           const std::vector<RunFile>& further = {});

/// The model at every row of the run, in the estimator's own arithmetic; shape (outputs, rows).
[[nodiscard]] std::vector<Column> model_over(const ThermalModel& model, const MeasuredRun& run,
                                             const MeasuredData& data);

enum class Purpose { search, comparison };

/// @param names  the runs' arguments as given
/// @throws ConfigurationError when a run lacks an input or signal of the model, or has no measured
///         value of any output
[[nodiscard]] MeasuredData measured_data(const ThermalModel& model,
                                         const std::vector<RunFile>& runs,
                                         const std::vector<std::string>& names,
                                         const SharedColumns& columns, Purpose purpose);

/// The first of the columns that is called like a room; empty: there is none.
[[nodiscard]] std::string room_among(const std::vector<std::string>& columns);

/// The room's temperature in a run: one that the model does not use, else one of its inputs; null:
/// none is named so.
[[nodiscard]] const Column* room_degC(const MeasuredData& data, const MeasuredRun& run);

/// A place of the rows of all selected runs, one below the other.
struct StackedRows {
  std::vector<Block> runs;  ///< rows of each run
  Column time_s;
};
[[nodiscard]] StackedRows stacked_rows(const MeasuredData& data);

/// Columns over the stacked rows.
/// @param make  of a run: all its rows, a column or shape (rows, m)
/// @return shape (stacked rows, m)
template <class Make>
[[nodiscard]] Panel stacked(const MeasuredData& data, const StackedRows& rows, Make make) {
  Panel all;
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    const Panel whole = make(data.runs[i]);
    const Block& block = rows.runs[i];
    if (all.size() == 0) all.resize(rows.time_s.size(), whole.cols());
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
