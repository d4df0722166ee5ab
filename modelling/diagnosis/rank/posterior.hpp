/// Hypotheses with fitted shape and gains, their evidence, and their probabilities among all
/// hypotheses and "no cause of the catalogue".
#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

namespace thermocomp::diagnosis {

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

/// `structure`, `heat`, `datum` or `sensor`.
[[nodiscard]] const std::string& family_of(const std::string& cause);

struct Posterior {
  double none{1.0};                          ///< no cause of the catalogue
  std::map<std::string, double> families{};  ///< `none` among them
};

enum class Round { first, later };

/// ln of an explanation's weight among all, a weighted sum of
///
///   - A(score) and A(witness), A(x) = sign(x) ln(1 + |x| / 20), since rows are correlated,
///   - the cross-validated reduction: ln of the RMS before over after, divided by the root of the
///     number of outputs, and the relative reduction of the output with the largest,
///   - the number of free parameters, and whether it acts in one run only,
///
/// and Hypothesis::log_prior.
///
/// The weights maximise the probability of the true causes of simulated, physical and measured
/// campaigns; one answer in a hundred may be an outlier (research/calibrate_posterior.py).
[[nodiscard]] double utility(const Explanation& explanation);
/// Utilities that differ by less count as equal.
inline constexpr double as_much = 1.0;

/// Sets each probability: the probability of any effect, from the figures of the likeliest, times
/// exp(utility) over the sum of all. It is 0 if a special case of the hypothesis explains as much.
/// @param beside_fit  the coefficients were fitted to the rows
[[nodiscard]] Posterior weigh_against_each_other(std::vector<Explanation>& explanations,
                                                 Round round, bool beside_fit = false);

/// The cause to name, and its probability.
struct Choice {
  std::size_t index{0};
  double probability{0.0};
  std::vector<std::string> other_subjects{};  ///< about as likely as its own
};

/// The likeliest cause at one place, summed over places that cannot be distinguished from it. If
/// its probability is below 0.5, the likeliest cause summed over all of its places.
/// @param explanations  at least one
[[nodiscard]] Choice likeliest(const std::vector<Explanation>& explanations,
                               const PlaceGroups& groups);

}  // namespace thermocomp::diagnosis
