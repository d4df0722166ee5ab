#include "modelling/diagnosis/rank/posterior.hpp"

#include <algorithm>
#include <cmath>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Weights of the utility, as research/calibrate_posterior.py prints them.
struct Weights {
  double score;
  double witness;
  double left_out;
  double share;
  double parameters;
  double one_run;
};
constexpr Weights weights{2.11, 2.66, 3.27, 12.04, -0.54, -0.27};
/// Weights of the log odds of any effect, for the figures of the likeliest hypothesis.
struct Presence {
  double constant;
  double score;
  double witness;
  double share;
};
constexpr Presence of_first{-2.69, 0.54, 0.49, 9.10};
/// In later rounds, and with coefficients fitted to the rows, the model's misfit resembles an
/// effect more often. Set for the same rate of false findings on untouched machines as in the first
/// round. Not for datum causes: a fit does not leave a line, a jump or a shift.
constexpr Presence of_later{-5.70, 0.54, 0.49, 9.10};
constexpr Presence of_fitted{-7.70, 0.54, 0.49, 9.10};
constexpr double left_out_min = -0.5;
constexpr double left_out_max = 3.0;
/// Since neighbouring rows are correlated, ln L counts linearly up to about this value and
/// logarithmically above.
constexpr double score_scale = 20.0;
constexpr double score_min = -50.0;

double compressed(double score) {
  return std::copysign(std::log1p(std::abs(score) / score_scale), score);
}

/// Least probability of other subjects in the group, as a share of the likeliest one's.
constexpr double as_likely_min = 0.1;
constexpr double likelier_than_not = 0.5;

/// Inputs of the utility and of the odds.
struct Figures {
  double score;
  double witness;
  double left_out;  ///< ln of the RMS before over after, over the root of all outputs
  double share;     ///< reduction of the RMS, of the output with the largest
};

Figures figures_of(const Explanation& explanation) {
  // The outputs of one machine are correlated.
  const double root = std::sqrt(static_cast<double>(explanation.gains.size()));
  const double own = std::max(score_min, explanation.score) - explanation.witness;
  return {compressed(own / root), compressed(explanation.witness),
          std::clamp(explanation.left_out / root, left_out_min, left_out_max),
          -std::expm1(-std::clamp(explanation.left_out_of_best, left_out_min, left_out_max))};
}

}  // namespace

const std::string& family_of(const std::string& cause) {
  return cause_named(cause).family;
}

double utility(const Explanation& explanation) {
  const Figures of = figures_of(explanation);
  return weights.score * of.score + weights.witness * of.witness + weights.left_out * of.left_out +
         weights.share * of.share +
         weights.parameters * static_cast<double>(free_parameters(*explanation.hypothesis)) +
         (explanation.hypothesis->run ? weights.one_run : 0.0) + explanation.hypothesis->log_prior;
}

namespace {

/// Whether a special case of this hypothesis is about as likely, or explains as much.
bool adds_nothing(const Explanation& explanation, const std::vector<Explanation>& all) {
  const Hypothesis& of = *explanation.hypothesis;
  if (of.simpler_cause.empty()) return false;
  return std::any_of(all.begin(), all.end(), [&](const Explanation& each) {
    return each.hypothesis->cause == of.simpler_cause &&
           each.hypothesis->subject == of.simpler_subject &&
           (each.score >= explanation.score || utility(each) + as_much >= utility(explanation));
  });
}

}  // namespace

Posterior weigh_against_each_other(std::vector<Explanation>& explanations, Round round,
                                   bool beside_fit) {
  Posterior posterior;
  for (const char* family : {"structure", "heat", "datum", "sensor"})
    posterior.families[family] = 0.0;
  posterior.families["none"] = 1.0;
  if (explanations.empty()) return posterior;
  const auto best = std::max_element(
      explanations.begin(), explanations.end(),
      [](const Explanation& a, const Explanation& b) { return utility(a) < utility(b); });
  const Figures of_best = figures_of(*best);
  const bool as_fits_leave = beside_fit && family_of(best->hypothesis->cause) != "datum";
  const Presence& presence = as_fits_leave           ? of_fitted
                             : round == Round::first ? of_first
                                                     : of_later;
  const double odds = std::exp(presence.constant + presence.score * of_best.score +
                               presence.witness * of_best.witness + presence.share * of_best.share);
  posterior.none = posterior.families["none"] = 1.0 / (1.0 + odds);
  const double most = utility(*best);
  double sum = 0.0;
  for (Explanation& each : explanations) {
    each.probability = adds_nothing(each, explanations) ? 0.0 : std::exp(utility(each) - most);
    sum += each.probability;
  }
  for (Explanation& each : explanations) {
    each.probability *= (1.0 - posterior.none) / sum;
    posterior.families[family_of(each.hypothesis->cause)] += each.probability;
  }
  return posterior;
}

namespace {

/// The likeliest of the accepted explanations, and the sum of their probabilities.
template <class Accept>
Choice sum_of(const std::vector<Explanation>& explanations, Accept accept) {
  Choice choice;
  double best = -1.0;
  for (std::size_t i = 0; i < explanations.size(); ++i) {
    const Explanation& each = explanations[i];
    if (!accept(*each.hypothesis)) continue;
    choice.probability += each.probability;
    if (each.probability <= best) continue;
    best = each.probability;
    choice.index = i;
  }
  return choice;
}

}  // namespace

Choice likeliest(const std::vector<Explanation>& explanations, const PlaceGroups& groups) {
  Choice of_place;
  Choice of_cause;
  for (const Explanation& each : explanations) {
    if (each.probability < 1e-6) continue;
    const Hypothesis& centre = *each.hypothesis;
    const auto same_cause = [&](const Hypothesis& of) { return of.cause == centre.cause; };
    const Choice place = sum_of(explanations, [&](const Hypothesis& of) {
      return same_cause(of) && same_places(groups, centre.subject, of.subject);
    });
    if (place.probability > of_place.probability) of_place = place;
    const Choice cause = sum_of(explanations, same_cause);
    if (cause.probability > of_cause.probability) of_cause = cause;
  }
  if (of_place.probability >= likelier_than_not || of_cause.probability < likelier_than_not)
    return of_place;
  const Explanation& best = explanations[of_cause.index];
  for (const Explanation& each : explanations)
    if (each.hypothesis->cause == best.hypothesis->cause &&
        each.hypothesis->subject != best.hypothesis->subject &&
        each.probability > as_likely_min * best.probability)
      of_cause.other_subjects.push_back(each.hypothesis->subject);
  return of_cause;
}

}  // namespace thermocomp::diagnosis
