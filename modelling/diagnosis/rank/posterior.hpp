/// A hypothesis with its shape and gains settled, what speaks for it, and its probability among all
/// others and nothing that has a name.
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
  std::vector<Eigen::VectorXd> gains{};    ///< one an output; empty: it does not act on it
  std::vector<Eigen::VectorXd> gain_sd{};  ///< their standard deviations
  double score{0.0};  ///< ln L over that of nothing, its grid and gains paid for, with the witness
  double witness{0.0};  ///< the part of it that the reading itself adds, for a fault of a reading
  /// ln of the RMS before over after, of rows that it was not fitted to: the sum over the outputs,
  /// and the output that gains most.
  double left_out{0.0};
  double left_out_of_best{0.0};
  double probability{0.0};  ///< of the hypothesis alone
};

struct Finding {
  Explanation explanation;
  std::vector<Interval> shape_ci{};               ///< 95 %, one a shape parameter
  std::vector<std::vector<Interval>> gains_ci{};  ///< 95 %, of each output's gains
  double probability{0.0};                        ///< with all places that cannot be told apart
  double family_probability{0.0};
  std::vector<std::string> group{};         ///< these places, the subject's first
  std::vector<Explanation> alternatives{};  ///< likeliest first
};

/// What belongs together for a person: `structure`, `heat`, `datum` or `sensor`.
[[nodiscard]] const std::string& family_of(const std::string& cause);

struct Posterior {
  double none{1.0};                          ///< nothing that has a name
  std::map<std::string, double> families{};  ///< `none` among them
};

enum class Round { first, later };

/// ln of an explanation's weight among the others, a weighted sum of
///
///   - A(score) and A(witness), A(x) = sign(x) ln(1 + |x| / 20): neighbouring rows say the same,
///   - what it takes of rows that it was not fitted to: ln of their RMS before over after, over
///     the root of the count of outputs, and the share of the RMS, of the output that gains most,
///   - how many parameters were free, and whether it acts in one run alone.
///
/// The weights are those under which effects planted in simulated machines, made by physics, and
/// planted in measured ones are likeliest, one answer in a hundred being allowed to be beyond them
/// (research/calibrate_posterior.py). No cause is likelier than another by itself.
[[nodiscard]] double utility(const Explanation& explanation);

/// Sets the probability of each (0 where a simpler one that it contains is as likely): that there
/// is something, by what the likeliest one takes, times exp(utility) over the sum of all.
/// @param beside_fit  beside coefficients that were fitted to the rows
[[nodiscard]] Posterior weigh_against_each_other(std::vector<Explanation>& explanations,
                                                 Round round, bool beside_fit = false);

/// What is to be named, and how probable it is.
struct Choice {
  std::size_t index{0};
  double probability{0.0};
  std::vector<std::string> other_subjects{};  ///< between which and its own nothing decides
};

/// The likeliest cause with a place and all that cannot be told apart from it. Where that is less
/// likely than not, the likeliest cause with any of its places.
/// @param explanations  at least one
[[nodiscard]] Choice likeliest(const std::vector<Explanation>& explanations,
                               const PlaceGroups& groups);

}  // namespace thermocomp::diagnosis
