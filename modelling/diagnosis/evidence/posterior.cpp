#include "modelling/diagnosis/evidence/posterior.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// What was right among further explanations was right by chance.
constexpr std::size_t weighed_max = 12;
/// A likelihood that is larger by this factor again says as much as before: rows are correlated.
constexpr double score_scale = 20.0;
constexpr double left_min = -0.5;
constexpr double left_max = 3.0;
constexpr double share_min = -0.5;
constexpr double share_max = 1.0;
/// Leaves of rows left out as little, in ln.
constexpr double as_little = 0.1;
/// Of the likeliest subject's probability: below, another one is not worth telling.
constexpr double as_likely_min = 0.1;

struct Weights {
  double left_out;
  double first_place;
  double behind;
  double witness;
  double share;
  double share_of_best;
  double parameters;
  double same_cause;
  double other_causes;
  double none;  ///< utility of nothing
};
// calibrate_posterior.py prints what follows.
constexpr Weights for_first{1.39, 0.47, 0.25, 0.74, 3.87, 4.84, 1.41, 1.99, 0.83, 2.99};
constexpr Weights for_later{0.03, 0.74, 0.24, 0.07, 4.03, 4.06, 0.39, 1.19, 0.32, 4.20};

/// What the weighed explanations are told from each other by.
class Field {
 public:
  Field(std::span<const Explanation> weighed, const Weights& weights)
      : weighed_(weighed), weights_(weights) {
    for (const Explanation& each : weighed) best_score_ = std::max(best_score_, each.score);
  }

  [[nodiscard]] double utility(std::size_t place) const {
    const Explanation& of = weighed_[place];
    const double witness =
        std::copysign(std::log1p(std::abs(of.witness) / score_scale), of.witness);
    return weights_.left_out * std::clamp(-of.log_left, left_min, left_max) +
           weights_.share * std::clamp(of.left_out_gain, share_min, share_max) +
           weights_.share_of_best * std::clamp(of.left_out_gain_of_best, share_min, share_max) +
           weights_.witness * witness -
           weights_.parameters * std::log1p(static_cast<double>(free_parameters(of))) -
           weights_.same_cause * std::log(rivals_of_cause(of)) -
           weights_.other_causes * std::log1p(rivals_of_others(of)) -
           weights_.behind * std::log1p((best_score_ - of.score) / score_scale) +
           (place == 0 ? weights_.first_place : 0.0);
  }

 private:
  /// How much of a rival another one is: 1 if its likelihood is as large.
  [[nodiscard]] static double rival(const Explanation& other, const Explanation& of) {
    return 1.0 / (1.0 + std::max(0.0, of.score - other.score) / score_scale);
  }
  /// Of its cause, leaving about as little or less; itself among them.
  [[nodiscard]] double rivals_of_cause(const Explanation& of) const {
    double sum = 0.0;
    for (const Explanation& other : weighed_)
      if (other.hypothesis->cause == of.hypothesis->cause &&
          other.log_left < of.log_left + as_little)
        sum += rival(other, of);
    return sum;
  }
  /// Of other causes, leaving less.
  [[nodiscard]] double rivals_of_others(const Explanation& of) const {
    double sum = 0.0;
    for (const Explanation& other : weighed_)
      if (other.hypothesis->cause != of.hypothesis->cause && other.log_left < of.log_left)
        sum += rival(other, of);
    return sum;
  }

  std::span<const Explanation> weighed_;
  const Weights& weights_;
  double best_score_{-std::numeric_limits<double>::infinity()};
};

/// The same cause with places that cannot be told apart.
bool of_one_group(const Explanation& one, const Explanation& other, const PlaceGroups& groups) {
  return other.hypothesis->cause == one.hypothesis->cause &&
         same_places(groups, one.hypothesis->subject, other.hypothesis->subject);
}

}  // namespace

const std::string& family_of(const std::string& cause) {
  return cause_named(cause).family;
}

Posterior posterior(const std::vector<Explanation>& explanations, Round round) {
  const std::size_t weighed = std::min(weighed_max, explanations.size());
  const Weights& weights = round == Round::first ? for_first : for_later;
  std::vector<double> utilities;
  const Field field(std::span<const Explanation>{explanations}.first(weighed), weights);
  for (std::size_t i = 0; i < weighed; ++i) utilities.push_back(field.utility(i));
  double most = weights.none;
  for (const double each : utilities) most = std::max(most, each);
  double sum = std::exp(weights.none - most);
  for (const double each : utilities) sum += std::exp(each - most);
  Posterior all;
  all.none = std::exp(weights.none - most) / sum;
  all.of.assign(explanations.size(), 0.0);
  for (const char* family : {"structure", "heat", "datum", "sensor"}) all.families[family] = 0.0;
  for (std::size_t i = 0; i < weighed; ++i) {
    all.of[i] = std::exp(utilities[i] - most) / sum;
    all.families[family_of(explanations[i].hypothesis->cause)] += all.of[i];
  }
  return all;
}

double probability_of_group(const std::vector<Explanation>& explanations,
                            const Posterior& posterior, const PlaceGroups& groups,
                            std::size_t index) {
  double sum = 0.0;
  for (std::size_t i = 0; i < explanations.size(); ++i)
    if (of_one_group(explanations[index], explanations[i], groups)) sum += posterior.of[i];
  return sum;
}

std::size_t likeliest(const std::vector<Explanation>& explanations, const Posterior& posterior,
                      const PlaceGroups& groups) {
  std::size_t centre = 0;
  double most = 0.0;
  for (std::size_t i = 0; i < explanations.size(); ++i) {
    const double of_group = probability_of_group(explanations, posterior, groups, i);
    if (of_group <= most) continue;
    most = of_group;
    centre = i;
  }
  std::size_t best = centre;
  for (std::size_t i = 0; i < explanations.size(); ++i)
    if (of_one_group(explanations[centre], explanations[i], groups) &&
        posterior.of[i] > posterior.of[best])
      best = i;
  return best;
}

CauseAnywhere cause_anywhere(const std::vector<Explanation>& explanations,
                             const Posterior& posterior) {
  std::map<std::string, CauseAnywhere> causes;
  for (std::size_t i = 0; i < explanations.size(); ++i) {
    const Hypothesis& of = *explanations[i].hypothesis;
    if (of.output) continue;
    const auto [known, is_new] = causes.try_emplace(of.cause);
    CauseAnywhere& cause = known->second;
    if (is_new || posterior.of[i] > posterior.of[cause.likeliest]) cause.likeliest = i;
    cause.probability += posterior.of[i];
  }
  CauseAnywhere most;
  for (auto& [name, cause] : causes)
    if (cause.probability > most.probability) most = std::move(cause);
  if (!(most.probability > 0)) return most;
  const Hypothesis& of = *explanations[most.likeliest].hypothesis;
  for (std::size_t i = 0; i < explanations.size(); ++i) {
    const Hypothesis& other = *explanations[i].hypothesis;
    if (other.cause == of.cause && other.subject != of.subject &&
        posterior.of[i] > as_likely_min * posterior.of[most.likeliest])
      most.others.push_back(other.subject);
  }
  return most;
}

}  // namespace thermocomp::diagnosis
