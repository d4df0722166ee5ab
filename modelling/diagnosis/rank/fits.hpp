/// Fits of a hypothesis to all outputs, given the accepted explanations; intervals of a finding.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/rank/output_fit.hpp"

namespace thermocomp::diagnosis {

/// An output with fewer measured values in all runs is not judged.
inline constexpr std::size_t values_min = 12;

struct Explanation {
  const Hypothesis* hypothesis{nullptr};
  Shape shape{};
  std::vector<Eigen::VectorXd> gains{};    ///< one per output; empty: no effect on it
  std::vector<Eigen::VectorXd> gain_sd{};  ///< their standard deviations
  double score{0.0};    ///< ln L minus that of no effect and the penalty of its gains; with witness
  double witness{0.0};  ///< its part from the reading itself, for a fault of a reading
  /// ln of the cross-validated RMS before over after: sum over the outputs, and the largest of an
  /// output.
  double left_out{0.0};
  double left_out_of_best{0.0};
  double probability{0.0};  ///< of this hypothesis
};

struct Finding {
  Explanation explanation;
  std::vector<Interval> shape_ci{};               ///< 95 %, one per shape parameter
  std::vector<std::vector<Interval>> gains_ci{};  ///< 95 %, of each output's gains
  double probability{0.0};                        ///< of the cause at any place of the group
  double family_probability{0.0};
  std::vector<std::string> group{};    ///< indistinguishable places, the subject's first
  std::vector<Explanation> weighed{};  ///< all hypotheses of its round, likeliest first
};

/// Residual of each reading of the model from its prediction by the other temperatures and signals,
/// in which the fault of a reading must also appear.
class Readings {
 public:
  /// @param data  must outlive it
  explicit Readings(const MeasuredData& data) : data_(data) {}
  /// Computed at the first call.
  [[nodiscard]] const OutputFit& of(std::size_t input);

 private:
  const MeasuredData& data_;
  std::map<std::size_t, std::unique_ptr<OutputFit>> made_;
};

class Fits {
 public:
  /// All must outlive it.
  /// @param accepted  findings; their gains are fitted jointly with each hypothesis
  Fits(const MeasuredData& data, Readings& readings, const std::vector<Explanation>& accepted);

  /// Fits the hypothesis at each of the shapes.
  [[nodiscard]] std::vector<Explanation> trials(const Hypothesis& hypothesis,
                                                const Shapes& shapes) const;

  /// Whether the coefficients of an output were fitted to these rows.
  [[nodiscard]] bool fitted(std::size_t output) const {
    return measured(output) && outputs_[output]->fitted;
  }
  [[nodiscard]] bool measured(std::size_t output) const { return outputs_[output].has_value(); }
  [[nodiscard]] const OutputFit& output(std::size_t output) const { return outputs_[output]->fit; }
  /// Relative error of each coefficient of an output, fitted jointly with the accepted
  /// explanations; 0 if the coefficients are taken as exact, or if the model has terms or
  /// guideways.
  [[nodiscard]] Eigen::VectorXd coefficient_errors(std::size_t output) const;
  /// Displacement of an output by an explanation, minus each run's mean.
  [[nodiscard]] Column effect_of(const Explanation& explanation, std::size_t output) const;
  /// RMS of the residual after a fit of the runs' offsets and of the accepted explanations.
  /// @param corrected  with corrected coefficients
  [[nodiscard]] double rms_left(std::size_t output, bool corrected) const;

 private:
  struct Output {
    OutputFit fit;
    Panel free;          ///< offsets of the runs, columns of the accepted explanations
    Panel coefficients;  ///< displacement by each coefficient
    LeftOut left_out;    ///< of the residual minus each run's mean
    bool fitted;
  };
  [[nodiscard]] bool concerns(const Hypothesis& hypothesis, std::size_t output) const;
  /// Sets gains and score of a trial; `shape` is its number.
  void fit_own_gains(const std::vector<Equations>& equations, Eigen::Index shape,
                     Explanation& trial) const;
  void fit_shared_gain(const std::vector<Equations>& equations, const Equations* of_reading,
                       double shrunk_rows, Eigen::Index shape, Explanation& trial) const;
  /// Adds to each trial the cross-validated reduction of an output's residual.
  void judge_left_out(const Hypothesis& hypothesis, std::size_t output, const Panel& columns,
                      std::vector<Explanation>& trials) const;

  const MeasuredData& data_;
  Readings& readings_;
  std::vector<std::optional<Output>> outputs_;
};

/// Sets the 95 % intervals: of a shape parameter by its profile likelihood, of a gain also over the
/// shapes within these intervals.
/// @return whether the interval of any gain at the best shape excludes 0; true without gains
bool set_spread(const Fits& fits, Finding& finding);

}  // namespace thermocomp::diagnosis
