#include "modelling/diagnosis/rank/posterior.hpp"

#include <algorithm>
#include <cmath>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// What tells one hypothesis from another; research/calibrate_posterior.py prints
/// these.
struct Weights {
  double score;
  double witness;
  double left_out;
  double share;
  double parameters;
  double one_run;
};
constexpr Weights weights{2.11, 2.66, 3.27, 12.04, -0.54, -0.27};
/// What tells that there is something at all: of the likeliest hypothesis.
struct Presence {
  double constant;
  double score;
  double witness;
  double share;
};
constexpr Presence of_first{-2.69, 0.54, 0.49, 9.10};
/// Beside what is named already, and more so beside coefficients fitted to the rows, what a model
/// leaves anyway is taken for an effect more easily. Set so that of untouched machines as few are
/// named as in the first round. What a fit leaves is made of what it was fitted with, never a line,
/// a jump or a shift of the datum.
constexpr Presence of_later{-5.70, 0.54, 0.49, 9.10};
constexpr Presence of_fitted{-7.70, 0.54, 0.49, 9.10};
constexpr double left_out_min = -0.5;
constexpr double left_out_max = 3.0;
/// Neighbouring rows say the same: a likelihood that is larger by this again says as much as
/// before.
constexpr double score_scale = 20.0;
constexpr double score_min = -50.0;

double compressed(double score) {
  return std::copysign(std::log1p(std::abs(score) / score_scale), score);
}

/// Of the likeliest subject's probability: below, another one is not worth saying.
constexpr double as_likely_min = 0.1;
constexpr double likelier_than_not = 0.5;

/// The figures that both go by.
struct Figures {
  double score;
  double witness;
  double left_out;  ///< ln of the RMS before over after, over the root of all outputs
  double share;     ///< of the RMS, of the output that gains most
};

Figures figures_of(const Explanation& explanation) {
  // Outputs of one machine say much the same.
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
         (explanation.hypothesis->run ? weights.one_run : 0.0);
}

namespace {

/// Whether a simpler one explains as much: then this one is no rival of it.
bool adds_nothing(const Explanation& explanation, const std::vector<Explanation>& all) {
  const Hypothesis& of = *explanation.hypothesis;
  if (of.simpler_cause.empty()) return false;
  return std::any_of(all.begin(), all.end(), [&](const Explanation& each) {
    return each.hypothesis->cause == of.simpler_cause &&
           each.hypothesis->subject == of.simpler_subject && each.score >= explanation.score;
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

Choice likeliest(const std::vector<Explanation>& explanations, const PlaceGroups& groups) {
  const auto of_group = [&](const Explanation& centre) {
    Choice choice;
    double best = -1.0;
    for (std::size_t i = 0; i < explanations.size(); ++i) {
      const Explanation& each = explanations[i];
      if (each.hypothesis->cause != centre.hypothesis->cause ||
          !same_places(groups, centre.hypothesis->subject, each.hypothesis->subject))
        continue;
      choice.probability += each.probability;
      if (each.probability <= best) continue;
      best = each.probability;
      choice.index = i;
    }
    return choice;
  };
  Choice choice;
  std::map<std::string, double> causes;
  for (const Explanation& each : explanations) {
    causes[each.hypothesis->cause] += each.probability;
    if (each.probability < 1e-6) continue;
    if (Choice other = of_group(each); other.probability > choice.probability) choice = other;
  }
  if (choice.probability >= likelier_than_not) return choice;
  const auto cause =
      std::max_element(causes.begin(), causes.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  if (cause == causes.end() || cause->second < likelier_than_not) return choice;
  choice = {0, cause->second, {}};
  double best = -1.0;
  for (std::size_t i = 0; i < explanations.size(); ++i)
    if (explanations[i].hypothesis->cause == cause->first && explanations[i].probability > best) {
      best = explanations[i].probability;
      choice.index = i;
    }
  for (const Explanation& each : explanations)
    if (each.hypothesis->cause == cause->first && each.probability > as_likely_min * best &&
        each.hypothesis->subject != explanations[choice.index].hypothesis->subject)
      choice.other_subjects.push_back(each.hypothesis->subject);
  return choice;
}

}  // namespace thermocomp::diagnosis
