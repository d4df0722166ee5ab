#include "modelling/diagnosis/search/shortlist.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace thermocomp::diagnosis {
namespace {

/// Scales that are in one proportion but for this are: what that changes of a score is not seen.
constexpr double proportion_error_max = 1e-6;
constexpr std::size_t twins_kept = 3;

/// How many times the columns of `of` those of `twin` are, in all outputs alike; none: they are not
/// twins.
std::optional<double> times(const Hypothesis& twin, const Hypothesis& of,
                            const std::vector<std::size_t>& measured) {
  if (of.pattern.empty() || twin.pattern != of.pattern || twin.output != of.output ||
      twin.possible || of.possible)
    return std::nullopt;
  double largest = 0.0;
  double there = 0.0;
  for (const std::size_t output : measured) {
    const double scale = of.scale(output);
    if (std::abs(scale) <= std::abs(largest)) continue;
    largest = scale;
    there = twin.scale(output);
  }
  if (!(std::abs(there) > 0)) return std::nullopt;
  const double ratio = there / largest;
  for (const std::size_t output : measured)
    if (!(std::abs(twin.scale(output) - ratio * of.scale(output)) <=
          proportion_error_max * std::abs(there)))
      return std::nullopt;
  return ratio;
}

}  // namespace

std::vector<Place> shortlist(std::vector<Explanation> weighed,
                             const std::vector<std::size_t>& measured, std::size_t places) {
  std::vector<Place> all;
  std::vector<std::size_t> shared;  // places of hypotheses that have a pattern
  for (Explanation& each : weighed) {
    const bool may_have_twins = !each.hypothesis->pattern.empty();
    // Not the best of twins leads a place: their scores differ by rounding.
    const auto known = std::find_if(shared.begin(), shared.end(), [&](std::size_t place) {
      return may_have_twins &&
             times(*each.hypothesis, *all[place].first.hypothesis, measured).has_value();
    });
    if (known != shared.end()) {
      all[*known].twins.push_back(each.hypothesis);
      continue;
    }
    if (may_have_twins) shared.push_back(all.size());
    all.push_back({std::move(each)});
  }
  std::vector<std::size_t> order(all.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return all[a].first.score > all[b].first.score;
  });
  order.resize(std::min(order.size(), places));
  std::vector<Place> best;
  best.reserve(order.size());
  for (const std::size_t place : order) best.push_back(std::move(all[place]));
  return best;
}

std::vector<Explanation> witnessed(const Place& place, const std::vector<std::size_t>& measured,
                                   SensorWitness& witness) {
  const Hypothesis& leading = *place.first.hypothesis;
  std::vector<Explanation> all = {place.first};
  std::vector<double> ratios = {1.0};
  for (const Hypothesis* twin : place.twins) {
    ratios.push_back(*times(*twin, leading, measured));
    all.push_back(place.first);
    all.back().hypothesis = twin;
    for (Eigen::VectorXd& gains : all.back().gains) gains /= ratios.back();
  }
  if (!leading.sensor) return all;
  std::vector<Accused> accused;
  for (std::size_t i = 0; i < all.size(); ++i)
    accused.push_back({*all[i].hypothesis->sensor, 1.0 / ratios[i]});
  const std::vector<double> support = witness.says(place.first, accused);
  for (std::size_t i = 0; i < all.size(); ++i) add_witness(all[i], support[i]);
  std::stable_sort(all.begin(), all.end(),
                   [](const Explanation& a, const Explanation& b) { return a.score > b.score; });
  if (all.size() > twins_kept)
    all.erase(all.begin() + static_cast<std::ptrdiff_t>(twins_kept), all.end());
  return all;
}

bool of_one_place(const Explanation& a, const Explanation& b,
                  const std::vector<std::size_t>& measured) {
  return a.shape == b.shape && a.settings == b.settings &&
         times(*a.hypothesis, *b.hypothesis, measured).has_value();
}

}  // namespace thermocomp::diagnosis
