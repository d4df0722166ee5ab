/// Every output under one set of accepted explanations, and what a hypothesis explains of them.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/fit/left_out.hpp"
#include "modelling/diagnosis/fit/output_fit.hpp"
#include "modelling/diagnosis/rank/posterior.hpp"

namespace thermocomp::diagnosis {

/// Each reading of the model beside what the other temperatures and the signals predict of it: the
/// fault of a reading must be seen here too.
class Readings {
 public:
  /// @param data  must outlive it
  explicit Readings(const MeasuredData& data) : data_(data) {}
  /// Made when it is asked for first.
  [[nodiscard]] const OutputFit& of(std::size_t input);

 private:
  const MeasuredData& data_;
  std::map<std::size_t, std::unique_ptr<OutputFit>> made_;
};

class Fits {
 public:
  /// All must outlive it.
  /// @param accepted  what is found: gains of theirs are fitted anew beside each hypothesis
  Fits(const MeasuredData& data, Readings& readings, const std::vector<Explanation>& accepted);

  /// The hypothesis at each of the shapes.
  [[nodiscard]] std::vector<Explanation> trials(const Hypothesis& hypothesis,
                                                const Shapes& shapes) const;
  /// At the best point of its grid.
  [[nodiscard]] Explanation weigh(const Hypothesis& hypothesis) const;
  /// What the choice between values of a shape parameter goes by.
  enum class By { worth, likelihood };
  /// The same between the points of the grid.
  void refine(Explanation& explanation, By by = By::worth) const;

  /// Whether the coefficients of an output were fitted to these very rows.
  [[nodiscard]] bool fitted(std::size_t output) const {
    return measured(output) && outputs_[output]->fitted;
  }
  [[nodiscard]] bool measured(std::size_t output) const { return outputs_[output].has_value(); }
  [[nodiscard]] const OutputFit& output(std::size_t output) const { return outputs_[output]->fit; }
  /// By what share each coefficient of an output is wrong, fitted beside what is accepted; 0 where
  /// they are not doubted, and of a model with terms or guideways, which keeps its own.
  [[nodiscard]] Eigen::VectorXd coefficient_errors(std::size_t output) const;
  /// What an explanation moves the rows of an output by, each run's mean off.
  [[nodiscard]] Column effect_of(const Explanation& explanation, std::size_t output) const;
  /// RMS of the remainder beside the runs' offsets and what is accepted.
  /// @param corrected  with the coefficients fitted anew
  [[nodiscard]] double rms_left(std::size_t output, bool corrected) const;

 private:
  struct Output {
    OutputFit fit;
    Panel free;          ///< offsets of the runs, columns of what is accepted
    Panel coefficients;  ///< the displacement that each makes
    LeftOut left_out;    ///< of the remainder, each run's mean off
    bool fitted;
  };
  [[nodiscard]] bool concerns(const Hypothesis& hypothesis, std::size_t output) const;
  /// Set gains and score of a trial, shape number `shape`.
  void fit_own_gains(const std::vector<Equations>& equations, Eigen::Index shape,
                     Explanation& trial) const;
  void fit_shared_gain(const std::vector<Equations>& equations, const Equations* of_reading,
                       double shrunk_rows, Eigen::Index shape, Explanation& trial) const;
  /// Adds to each trial what its columns take of an output's left-out rows.
  void judge_left_out(const Hypothesis& hypothesis, std::size_t output, const Panel& columns,
                      std::vector<Explanation>& trials) const;

  const MeasuredData& data_;
  Readings& readings_;
  std::vector<std::optional<Output>> outputs_;
};

}  // namespace thermocomp::diagnosis
