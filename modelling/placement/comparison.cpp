#include "modelling/placement/comparison.hpp"

#include <algorithm>

#include "estimator/checks.hpp"
#include "modelling/placement/tendency_patterns.hpp"

namespace thermocomp::placement {
namespace {

using Estimator = std::function<std::vector<Numbers>(const std::vector<Field>&)>;

MethodResult judge(const PlacementProblem& problem, std::string name, std::vector<Index> sensors,
                   const Estimator& estimate) {
  MethodResult result{std::move(name), std::move(sensors), {}, {}, {}};
  result.used = errors_of(problem, problem.used, estimate(problem.used));
  result.left_out = errors_of(problem, problem.left_out, estimate(problem.left_out));
  for (std::size_t i = 0; i < problem.load_cases.size(); ++i) {
    std::vector<Field> own;
    for (const Field& field : problem.load_cases[i].left_out ? problem.left_out : problem.used) {
      if (field.load_case == i) own.push_back(field);
    }
    result.by_case.push_back(errors_of(problem, own, estimate(own)));
  }
  return result;
}

MethodResult judge_sensors(const PlacementProblem& problem, std::string name,
                           const std::vector<Index>& sensors) {
  return judge(problem, std::move(name), sensors, [&](const std::vector<Field>& fields) {
    return estimates_um(problem, fields, sensors);
  });
}

/// The median, figure by figure, of many random placements.
MethodResult random_median(const PlacementProblem& problem) {
  std::vector<MethodResult> draws;
  for (int i = 0; i < random_draws; ++i) {
    const auto seed = static_cast<std::uint64_t>(i) + 1;
    draws.push_back(judge_sensors(problem, "random", place_at_random(problem, seed)));
  }
  const auto over_draws = [&](const auto& figure_of) {
    std::vector<double> rms_um;
    std::vector<double> peak_um;
    for (const MethodResult& draw : draws) {
      rms_um.push_back(figure_of(draw).rms_um);
      peak_um.push_back(figure_of(draw).peak_um);
    }
    return ErrorFigures{median_of(std::move(rms_um)), median_of(std::move(peak_um))};
  };
  MethodResult result{"random", {}, {}, {}, {}};
  result.used = over_draws([](const MethodResult& draw) { return draw.used; });
  result.left_out = over_draws([](const MethodResult& draw) { return draw.left_out; });
  for (std::size_t i = 0; i < problem.load_cases.size(); ++i) {
    result.by_case.push_back(over_draws([i](const MethodResult& draw) { return draw.by_case[i]; }));
  }
  return result;
}

std::vector<Numbers> nothing(const PlacementProblem& problem, const std::vector<Field>& fields) {
  return std::vector<Numbers>(fields.size(), Numbers(problem.rows(), 0.0));
}

std::vector<Numbers> from_means(const PlacementProblem& problem, const std::vector<Field>& fields) {
  std::vector<Numbers> estimates;
  estimates.reserve(fields.size());
  for (const Field& field : fields) {
    estimates.push_back(block_displacement_um(problem, block_means_K(problem, field.rise_K)));
  }
  return estimates;
}

}  // namespace

const MethodResult& Comparison::method(std::string_view name) const {
  const auto found = std::find_if(methods.begin(), methods.end(),
                                  [&](const MethodResult& result) { return result.name == name; });
  THERMOCOMP_ENSURE(found != methods.end());
  return *found;
}

Comparison compare_placements(const PlacementProblem& problem, const TendencyOptions& options) {
  Comparison comparison;
  comparison.uncompensated =
      judge(problem, "uncompensated", {},
            [&](const std::vector<Field>& fields) { return nothing(problem, fields); });
  comparison.methods.push_back(judge_sensors(problem, "centroid", place_at_centroids(problem)));
  comparison.methods.push_back(
      judge(problem, "mean_of_block", {},
            [&](const std::vector<Field>& fields) { return from_means(problem, fields); }));
  std::vector<MethodResult> by_way;
  for (const Way way : all_ways) {
    comparison.ways.push_back(place_by_tendencies(problem, way, options));
    by_way.push_back(judge_sensors(problem, std::string("tendency_").append(name_of(way)),
                                   comparison.ways.back().sensors));
    if (by_way.back().used.rms_um < by_way[comparison.best_way].used.rms_um) {
      comparison.best_way = by_way.size() - 1;
    }
  }
  comparison.methods.insert(comparison.methods.end(), by_way.begin(), by_way.end());
  comparison.greedy = place_greedily(problem);
  comparison.methods.push_back(judge_sensors(problem, "greedy", comparison.greedy.sensors));
  comparison.methods.push_back(judge_sensors(problem, "qr_pivoting", place_by_qr(problem)));
  const Reconstruction rebuilt = reconstruct_by_qr(problem);
  comparison.methods.push_back(judge(
      problem, "qr_reconstruction", {},
      [&](const std::vector<Field>& fields) { return estimates_um(problem, fields, rebuilt); }));
  comparison.methods.push_back(random_median(problem));
  return comparison;
}

}  // namespace thermocomp::placement
