#include "modelling/diagnosis/evidence/posterior.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
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
constexpr double crowd = 0.1;

// calibrate_posterior.py prints what follows.
constexpr double weight_of_left_out = 1.99;
constexpr double weight_of_likelihood = 0.21;
constexpr double weight_of_first_place = 1.05;
constexpr double weight_of_behind = 0.48;
constexpr double weight_of_share = 5.78;
constexpr double weight_of_crowd = 0.54;
constexpr double utility_of_none = 3.84;

/// What the weighed explanations are told from each other by.
class Field {
 public:
  explicit Field(std::span<const Explanation> weighed) : weighed_(weighed) {
    for (const Explanation& each : weighed) best_score_ = std::max(best_score_, each.score);
  }

  [[nodiscard]] double utility(std::size_t place) const {
    const Explanation& of = weighed_[place];
    const double likelihood = std::copysign(std::log1p(std::abs(of.score) / score_scale), of.score);
    return weight_of_left_out * std::clamp(-of.log_left, left_min, left_max) +
           weight_of_share * std::clamp(of.left_out_gain, share_min, share_max) -
           weight_of_crowd * std::log(as_good_as(of)) + weight_of_likelihood * likelihood -
           weight_of_behind * std::log1p((best_score_ - of.score) / score_scale) +
           (place == 0 ? weight_of_first_place : 0.0);
  }

 private:
  /// Explanations that leave about as little or less, itself among them.
  [[nodiscard]] double as_good_as(const Explanation& of) const {
    return static_cast<double>(std::count_if(
        weighed_.begin(), weighed_.end(),
        [&](const Explanation& other) { return other.log_left < of.log_left + crowd; }));
  }

  std::span<const Explanation> weighed_;
  double best_score_{-std::numeric_limits<double>::infinity()};
};

}  // namespace

const std::string& family_of(const std::string& cause) {
  return cause_named(cause).family;
}

Posterior posterior(const std::vector<Explanation>& explanations) {
  const std::size_t weighed = std::min(weighed_max, explanations.size());
  std::vector<double> utilities;
  const Field field(std::span<const Explanation>{explanations}.first(weighed));
  for (std::size_t i = 0; i < weighed; ++i) utilities.push_back(field.utility(i));
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
