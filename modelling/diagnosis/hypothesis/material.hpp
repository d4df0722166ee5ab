/// What causes make their columns of: the runs, their rows one below the other, and what all of
/// them need to know of the data.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis {

enum class SubjectKind {
  input,              ///< a temperature of the model
  other_temperature,  ///< one that the model does not use
  signal,             ///< an operating signal
  output,
  output_in_run,  ///< an output in one run
  input_in_run,   ///< a temperature of the model in one run
};

/// One thing of the data that a cause may act on.
struct Subject {
  SubjectKind kind{SubjectKind::input};
  std::size_t index{0};  ///< among the things of its kind
  std::size_t run{0};    ///< of those in one run
};

/// A column of each run.
using ColumnOf = std::function<const Column&(const MeasuredRun&)>;

class Material {
 public:
  /// @param data  must outlive it
  Material(const MeasuredData& data, const StackedRows& rows);

  [[nodiscard]] const MeasuredData& data() const noexcept { return data_; }
  [[nodiscard]] const StackedRows& rows() const noexcept { return rows_; }
  /// Median step between two rows.
  [[nodiscard]] double step_s() const noexcept { return step_s_; }
  /// Of the longest run.
  [[nodiscard]] double length_s() const noexcept { return length_s_; }
  /// What an output does in the end for each kelvin of an input, terms included, alone and with all
  /// places of its group; shape (outputs, inputs).
  /// @pre the model has no guideways
  [[nodiscard]] const Eigen::MatrixXd& settled_um_per_K() const noexcept { return settled_; }
  [[nodiscard]] const Eigen::MatrixXd& settled_of_group_um_per_K() const noexcept {
    return settled_of_group_;
  }

  [[nodiscard]] const std::string& name_of(const Subject& subject) const;
  /// The subject's values: rises calmed of the noise of single values, a signal as it is.
  /// @pre a temperature or a signal
  [[nodiscard]] ColumnOf values_of(const Subject& subject) const;
  [[nodiscard]] bool moves_anywhere(const ColumnOf& of) const;
  /// The largest distance of two values within a run.
  [[nodiscard]] double range(const ColumnOf& of) const;

  /// Time constants within the range that these rows can tell of.
  [[nodiscard]] std::vector<double> lag_times_s(double low_s, double high_s,
                                                std::size_t count) const;
  /// Moments between two shares of a run, and those at which its values jump most; ascending.
  /// @param values  of all rows of the run; NaN: missing
  [[nodiscard]] std::vector<double> onsets_s(std::size_t run, double first, double last,
                                             std::size_t count, const Column& values) const;

  /// As stacked() of all runs.
  template <class Make>
  [[nodiscard]] Panel stacked(Make make) const {
    return diagnosis::stacked(data_, rows_, make);
  }

  /// @param whole  of one run: all its rows
  /// @return the same over the stacked rows, zero in the other runs
  [[nodiscard]] Panel in_run(std::size_t run, const Panel& whole) const;

 private:
  const MeasuredData& data_;
  const StackedRows rows_;
  Eigen::MatrixXd settled_;
  Eigen::MatrixXd settled_of_group_;
  double step_s_{1.0};
  double length_s_{0.0};
};

/// 1 from each of the moments on, else 0, shape (rows, moments).
[[nodiscard]] Panel since(const Column& time_s, const std::vector<double>& onsets_s);

}  // namespace thermocomp::diagnosis
