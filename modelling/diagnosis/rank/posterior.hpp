/// A hypothesis with fitted shape and gains, its evidence, and its probability among all hypotheses
/// and "no cause of the catalogue".
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
  std::vector<Eigen::VectorXd> gains{};    ///< one per output; empty: it does not act on it
  std::vector<Eigen::VectorXd> gain_sd{};  ///< their standard deviations
  double score{0.0};  ///< ln L less that of no effect, less the penalty of its gains; with witness
  double witness{0.0};  ///< part of it that comes from the reading, for a fault of a reading
  /// ln of the ratio of the RMS before and after, over left-out rows: sum over the outputs, and the
  /// largest of an output.
  double left_out{0.0};
  double left_out_of_best{0.0};
  double probability{0.0};  ///< of the hypothesis alone
};

struct Finding {
  Explanation explanation;
  std::vector<Interval> shape_ci{};               ///< 95 %, one per shape parameter
  std::vector<std::vector<Interval>> gains_ci{};  ///< 95 %, of each output's gains
  double probability{0.0};                        ///< with all places that cannot be told apart
  double family_probability{0.0};
  std::vector<std::string> group{};    ///< these places, the subject's first
  std::vector<Explanation> weighed{};  ///< against which it was found, likeliest first
};

/// `structure`, `heat`, `datum` or `sensor`.
[[nodiscard]] const std::string& family_of(const std::string& cause);

struct Posterior {
  double none{1.0};                          ///< no cause of the catalogue
  std::map<std::string, double> families{};  ///< `none` among them
};

enum class Round { first, later };

/// ln of an explanation's weight among the others, a weighted sum of
///
///   - A(score) and A(witness), A(x) = sign(x) ln(1 + |x| / 20), since rows are correlated,
///   - the reduction of left-out rows: ln of their RMS before over after, divided by the root of
///     the number of outputs, and the share of the RMS, of the output that gains most,
///   - the number of free parameters, and whether it acts in one run only,
///
/// and Hypothesis::log_prior.
///
/// The weights maximise the probability of the true causes of simulated, physical and measured
/// campaigns; one answer in a hundred may be an outlier (research/calibrate_posterior.py).
[[nodiscard]] double utility(const Explanation& explanation);
/// Two utilities that differ by less count as equal.
inline constexpr double as_much = 1.0;

/// Sets each probability: the probability that there is any effect, from the figures of the
/// likeliest, times exp(utility) over the sum of all. It is 0 where a simpler hypothesis that this
/// one contains explains as much.
/// @param beside_fit  the coefficients were fitted to the rows
[[nodiscard]] Posterior weigh_against_each_other(std::vector<Explanation>& explanations,
                                                 Round round, bool beside_fit = false);

/// The cause to be named, and its probability.
struct Choice {
  std::size_t index{0};
  double probability{0.0};
  std::vector<std::string> other_subjects{};  ///< as possible as its own
};

/// The likeliest cause with a place and all places that cannot be distinguished from it. Where that
/// has a probability below 0.5, the likeliest cause with any of its places.
/// @param explanations  at least one
[[nodiscard]] Choice likeliest(const std::vector<Explanation>& explanations,
                               const PlaceGroups& groups);

}  // namespace thermocomp::diagnosis
