/// Probabilities of what was weighed for a finding.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "modelling/diagnosis/data/place_groups.hpp"
#include "modelling/diagnosis/evidence/evidence.hpp"

namespace thermocomp::diagnosis {

/// What belongs together for a person: `structure`, `heat`, `datum` or `sensor`.
[[nodiscard]] const std::string& family_of(const std::string& cause);

struct Posterior {
  std::vector<double> of;  ///< one an explanation, in their order
  double none{1.0};        ///< nothing that has a name
  std::map<std::string, double> families{};
};

/// Beside what is named already, what a model leaves anyway is taken for an effect more easily:
/// evidence counts less.
enum class Round { first, later };

/// P(h) = exp(u_h) / (exp(u_none) + sum of exp(u)), u a weighted sum of
///
///   - what the explanation takes of rows that it was not fitted to, -log_left,
///   - the share that it takes of the RMS of the outputs on which it acts, in those rows, and of
///     the one of them that it explains best: many a fault hardly moves the others,
///   - what the other sensors say of a fault of a reading, sign(w) ln(1 + |w| / 20), since
///     neighbouring rows say the same,
///   - how many parameters it was free to choose, ln(1 + free),
///   - ln of its rivals of the same cause that take about as much, itself among them, and ln of
///     1 + those of other causes that take more: one whose 2 ln L is behind by d counts
///     1 / (1 + d / 20),
///   - how far its likelihood is behind the likeliest's, ln(1 + behind / 20),
///   - whether it is the first in the order of Search::choose().
///
/// No cause is likelier than another by itself: how often each was right in the cases that settled
/// the weights did not carry over to machines that were left out of them.
///
/// The weights are those under which effects planted in measured and in simulated machines are
/// likeliest (tests/diagnosis/calibrate_posterior.py), for the first finding and for later ones.
/// @param explanations  in the order of Search::choose()
[[nodiscard]] Posterior posterior(const std::vector<Explanation>& explanations, Round round);

/// Of a cause with any place of the group of its subject: which of them it is cannot be told.
[[nodiscard]] double probability_of_group(const std::vector<Explanation>& explanations,
                                          const Posterior& posterior, const PlaceGroups& groups,
                                          std::size_t index);

/// Of the likeliest cause with any subject that is no output.
struct CauseAnywhere {
  std::size_t likeliest{0};         ///< place of its explanation that is likeliest by itself
  double probability{0.0};          ///< of the cause with any of its subjects; 0: there is none
  std::vector<std::string> others;  ///< its other subjects that are at least a tenth as likely
};
[[nodiscard]] CauseAnywhere cause_anywhere(const std::vector<Explanation>& explanations,
                                           const Posterior& posterior);

/// Place of what is to be named: of the likeliest group of places the explanation that is
/// likeliest by itself. A group is that of one place: a place between two others has both in its
/// group, they do not have each other.
/// @param explanations  at least one
[[nodiscard]] std::size_t likeliest(const std::vector<Explanation>& explanations,
                                    const Posterior& posterior, const PlaceGroups& groups);

}  // namespace thermocomp::diagnosis
