/// Greedy search: fits all hypotheses, ranks them by their probabilities among all and "no cause of
/// the catalogue", accepts the likeliest, and repeats.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "modelling/diagnosis/rank/fits.hpp"

namespace thermocomp::diagnosis {

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

/// The likeliest cause at one place, summed over places that are indistinguishable from it. If its
/// probability is below 0.5, the likeliest cause summed over all of its places.
/// @param explanations  at least one
[[nodiscard]] Choice likeliest(const std::vector<Explanation>& explanations,
                               const PlaceGroups& groups);

struct SearchResult {
  std::vector<Finding> findings;  ///< in order of gain
  /// Residual variance of an output after over before all findings, without that of the noise.
  std::vector<double> unexplained_share;
  /// Relative errors of each output's coefficients, fitted jointly with all findings.
  std::vector<Eigen::VectorXd> coefficient_errors{};
  std::vector<double> noise_share;  ///< of an output's residual variance before any finding
  std::vector<bool> fitted;         ///< whether an output's coefficients were fitted to these rows
  /// The residual is large relative to noise and motion, and there is no finding.
  bool unexplained{false};
  std::map<std::string, double> families{};  ///< for the first finding, with `none`
  std::vector<Explanation> weighed;          ///< for the first finding, likeliest first
};

/// @param progress  called at each hypothesis
/// @param motion_share_min  least RMS of the effect of a finding, as a share of the RMS of the
///         measured motion; the noise of a single value is a second lower bound
/// @param accepted  called with the findings before the columns of any hypothesis are requested
///         beside them
[[nodiscard]] SearchResult search(
    const MeasuredData& data, const std::vector<Hypothesis>& hypotheses,
    const std::function<void()>& progress = nullptr, double motion_share_min = 0.005,
    const std::function<void(const std::vector<Explanation>&)>& accepted = nullptr);

}  // namespace thermocomp::diagnosis
