/// What causes make their columns of: the runs, their rows one below the other, and what all of
/// them need to know of the data.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/data/panel.hpp"
#include "modelling/diagnosis/data/place_groups.hpp"
#include "modelling/diagnosis/data/stacked_rows.hpp"

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
  [[nodiscard]] const PlaceGroups& groups() const noexcept { return groups_; }
  /// Median step between two rows.
  [[nodiscard]] double step_s() const noexcept { return step_s_; }
  /// Of the longest run.
  [[nodiscard]] double length_s() const noexcept { return length_s_; }
  /// What an output does in the end for each kelvin of an input, terms included, shape (outputs,
  /// inputs).
  /// @pre the model has no guideways
  [[nodiscard]] const Eigen::MatrixXd& settled_um_per_K() const noexcept {
    return settled_um_per_K_;
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
  /// Moments between two shares of a run.
  [[nodiscard]] std::vector<double> onsets_s(std::size_t run, double first, double last,
                                             std::size_t count) const;

  /// One column of all runs.
  /// @param make  of a run
  template <class Make>
  Column stacked(Make make) const {
    Column out(rows_.time_s.size());
    for (std::size_t i = 0; i < data_.runs.size(); ++i) {
      const Column& whole = make(data_.runs[i]);
      const Block& block = rows_.runs[i];
      out.segment(block.begin, block.end - block.begin) =
          whole.segment(data_.runs[i].begin, block.end - block.begin);
    }
    return out;
  }

  /// A column for each value of a parameter, made of whole runs.
  /// @param make  void(const MeasuredRun&, PanelPart into)
  template <class Make>
  void write_stacked(PanelPart into, Make make) const {
    for (std::size_t i = 0; i < data_.runs.size(); ++i) {
      const MeasuredRun& run = data_.runs[i];
      PanelPart of_run = into.middleRows(rows_.runs[i].begin, run.rows() - run.begin);
      if (run.begin == 0) {
        make(run, of_run);
        continue;
      }
      Panel whole(run.rows(), into.cols());
      make(run, PanelPart(whole));
      of_run = whole.bottomRows(of_run.rows());
    }
  }

  /// Zero outside of one run.
  template <class Make>
  Column in_run(std::size_t run, Make make) const {
    Column out = Column::Zero(rows_.time_s.size());
    const Block& block = rows_.runs[run];
    out.segment(block.begin, block.end - block.begin) =
        make(data_.runs[run]).segment(data_.runs[run].begin, block.end - block.begin);
    return out;
  }

  /// For each of the moments the values of a whole run from then on, else zero.
  void write_since(std::size_t run, const std::vector<double>& onsets_s, const Column& whole,
                   PanelPart into) const;

 private:
  const MeasuredData& data_;
  const StackedRows rows_;
  const PlaceGroups groups_;
  Eigen::MatrixXd settled_um_per_K_;
  double step_s_{1.0};
  double length_s_{0.0};
};

/// `count` values from low to high, each the same factor after the one before, or the same step.
[[nodiscard]] std::vector<double> logarithmic_grid(double low, double high, std::size_t count);
[[nodiscard]] std::vector<double> linear_grid(double low, double high, std::size_t count);

}  // namespace thermocomp::diagnosis
