#include "modelling/diagnosis/evidence/posterior.hpp"

#include <algorithm>
#include <cmath>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// What was right among further explanations was right by chance.
constexpr std::size_t weighed_max = 12;
/// A likelihood that is larger by this factor again says as much as before: rows are correlated.
constexpr double score_scale = 20.0;
constexpr double left_min = -0.5;
constexpr double left_max = 3.0;

// calibrate_posterior.py prints what follows, and the priors of causes/.
constexpr double weight_of_left_out = 4.32;
constexpr double weight_of_likelihood = 0.74;
constexpr double weight_of_first_place = 1.53;
constexpr double weight_of_place = 0.18;
constexpr double utility_of_none = 5.29;

double utility(const Explanation& explanation, std::size_t place) {
  const double likelihood =
      std::copysign(std::log1p(std::abs(explanation.score) / score_scale), explanation.score);
  return weight_of_left_out * std::clamp(-explanation.log_left, left_min, left_max) +
         weight_of_likelihood * likelihood + (place == 0 ? weight_of_first_place : 0.0) -
         weight_of_place * std::log1p(static_cast<double>(place)) +
         cause_named(explanation.hypothesis->cause).prior;
}

}  // namespace

const std::string& family_of(const std::string& cause) {
  return cause_named(cause).family;
}

Posterior posterior(const std::vector<Explanation>& explanations) {
  const std::size_t weighed = std::min(weighed_max, explanations.size());
  std::vector<double> utilities;
  for (std::size_t i = 0; i < weighed; ++i) utilities.push_back(utility(explanations[i], i));
  double most = utility_of_none;
  for (const double each : utilities) most = std::max(most, each);
  double sum = std::exp(utility_of_none - most);
  for (const double each : utilities) sum += std::exp(each - most);
  Posterior all;
  all.none = std::exp(utility_of_none - most) / sum;
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
  const Hypothesis& of = *explanations[index].hypothesis;
  double sum = 0.0;
  for (std::size_t i = 0; i < explanations.size(); ++i) {
    const Hypothesis& other = *explanations[i].hypothesis;
    if (other.cause == of.cause && same_places(groups, of.subject, other.subject))
      sum += posterior.of[i];
  }
  return sum;
}

}  // namespace thermocomp::diagnosis
