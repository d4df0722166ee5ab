#include "modelling/placement/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include <nlohmann/json.hpp>

#include "estimator/checks.hpp"
#include "modelling/placement/tendency_method.hpp"

namespace thermocomp::placement {

namespace {

/// Method that reconstructs the field from modes.
constexpr const char* rebuilt_field = "qr_reconstruction";

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

/// Median of each figure over many random placements.
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

const MethodResult& Comparison::best(const PlacementProblem& problem) const {
  const auto rms_um = [&](const MethodResult& result) {
    if (result.sensors.empty()) return std::numeric_limits<double>::infinity();
    return problem.left_out.empty() ? result.used.rms_um : result.left_out.rms_um;
  };
  return *std::min_element(methods.begin(), methods.end(),
                           [&](const auto& a, const auto& b) { return rms_um(a) < rms_um(b); });
}

Comparison compare_placements(const PlacementProblem& problem, const TendencyOptions& options,
                              const structure::Progress& progress) {
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
    progress(std::string("sensors by tendency patterns, chosen by ").append(name_of(way)));
    comparison.ways.push_back(place_by_tendencies(problem, way, options));
    by_way.push_back(judge_sensors(problem, std::string("tendency_").append(name_of(way)),
                                   comparison.ways.back().sensors));
    if (by_way.back().used.rms_um < by_way[comparison.best_way].used.rms_um) {
      comparison.best_way = by_way.size() - 1;
    }
  }
  comparison.methods.insert(comparison.methods.end(), by_way.begin(), by_way.end());
  progress("sensors one by one (greedy)");
  comparison.greedy = place_greedily(problem);
  comparison.methods.push_back(judge_sensors(problem, "greedy", comparison.greedy.sensors));
  progress("sensors by QR pivoting");
  comparison.methods.push_back(judge_sensors(problem, "qr_pivoting", place_by_qr(problem)));
  const Reconstruction rebuilt = reconstruct_by_qr(problem);
  comparison.methods.push_back(judge(
      problem, rebuilt_field, {},
      [&](const std::vector<Field>& fields) { return estimates_um(problem, fields, rebuilt); }));
  progress("sensors at random");
  comparison.methods.push_back(random_median(problem));
  return comparison;
}

namespace {

using Json = nlohmann::ordered_json;

template <class... Values>
std::string line(const char* format, Values... values) {
  char text[512];
  // The formats are literals of this file.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
  std::snprintf(text, sizeof text, format, values...);
#pragma GCC diagnostic pop
  return text;
}

/// Rounded to a micrometre, since smaller digits are rounding of the mesh.
double mm_of(double value_m) {
  return std::round(value_m * 1e6) / 1e3;
}

std::string table_row(const MethodResult& result, bool left_out) {
  std::string text =
      line("%-24s %10.3f %10.3f", result.name.c_str(), result.used.rms_um, result.used.peak_um);
  if (left_out) text += line(" %12.3f %12.3f", result.left_out.rms_um, result.left_out.peak_um);
  return text + "\n";
}

std::string run_text(const PlacementProblem& problem, const Field& field, const TendencyRun& run) {
  std::string text =
      line("  %s at %g s: %.3f um at the start", problem.load_cases[field.load_case].name.c_str(),
           field.time_s, run.error_um_at_start);
  for (std::size_t i = 0; i < run.rounds.size(); ++i) {
    const TendencyRound& round = run.rounds[i];
    text += line("\n    %2zu: %s (nearest %d), rho %.3g: %.3f um", i + 1, round.pattern.c_str(),
                 round.rank, round.rho, round.error_um);
  }
  return text + "\n    ended: " + run.ended + "\n";
}

std::string sensors_text(const PlacementProblem& problem, const MethodResult& result) {
  std::string text = line("sensors by %s:\n", result.name.c_str());
  for (std::size_t b = 0; b < result.sensors.size(); ++b) {
    const Vec3& at = problem.nodes_m[result.sensors[b]];
    text += line("  %-24s node %u at [%g, %g, %g] mm\n", problem.blocks[b].name.c_str(),
                 result.sensors[b], mm_of(at[0]), mm_of(at[1]), mm_of(at[2]));
  }
  return text;
}

/// Errors in the load cases left out, else in those used.
ErrorFigures figures(const PlacementProblem& problem, const MethodResult& result) {
  return problem.left_out.empty() ? result.used : result.left_out;
}

Json figures_json(const ErrorFigures& figures) {
  return {{"rms_um", figures.rms_um}, {"peak_um", figures.peak_um}};
}

Json method_json(const PlacementProblem& problem, const MethodResult& result) {
  Json json{{"used", figures_json(result.used)}};
  json["left_out"] = problem.left_out.empty() ? Json(nullptr) : figures_json(result.left_out);
  for (std::size_t i = 0; i < result.by_case.size(); ++i) {
    json["load_cases"][problem.load_cases[i].name] = figures_json(result.by_case[i]);
  }
  json["sensors"] = Json::array();
  for (std::size_t b = 0; b < result.sensors.size(); ++b) {
    const Vec3& at = problem.nodes_m[result.sensors[b]];
    json["sensors"].push_back({{"block", problem.blocks[b].name},
                               {"node", result.sensors[b]},
                               {"at_mm", {mm_of(at[0]), mm_of(at[1]), mm_of(at[2])}}});
  }
  return json;
}

Json run_json(const PlacementProblem& problem, const Field& field, const TendencyRun& run,
              const std::vector<Index>& sensors) {
  Json json{{"load_case", problem.load_cases[field.load_case].name},
            {"time_s", field.time_s},
            {"error_um_at_start", run.error_um_at_start},
            {"rounds", Json::array()},
            {"ended", run.ended}};
  for (const TendencyRound& round : run.rounds) {
    json["rounds"].push_back({{"pattern", round.pattern},
                              {"rank", round.rank},
                              {"rho", round.rho},
                              {"error_um", round.error_um}});
  }
  const Numbers means_K = block_means_K(problem, field.rise_K);
  for (std::size_t b = 0; b < problem.blocks.size(); ++b) {
    json["blocks"][problem.blocks[b].name] = {{"mean_K", means_K[b]},
                                              {"wanted_K", run.blocks_K[b]},
                                              {"sensor_K", field.rise_K[sensors[b]]}};
  }
  return json;
}

}  // namespace

std::string remaining_text(const PlacementProblem& problem, const Comparison& comparison) {
  const ErrorFigures left = figures(problem, comparison.best(problem));
  return line("They leave %.2f um RMS (%.2f um at most) of %.2f um, over the load cases that",
              left.rms_um, left.peak_um, figures(problem, comparison.uncompensated).rms_um) +
         (problem.left_out.empty() ? " they were chosen for." : " were not used for the choice.");
}

std::string recommendation_text(const PlacementProblem& problem, const Comparison& comparison) {
  const MethodResult& best = comparison.best(problem);
  std::string text = sensors_text(problem, best) + remaining_text(problem, comparison);
  text += "\nOthers:";
  for (const MethodResult& result : comparison.methods) {
    if (&result == &best) continue;
    text += line(" %s %.2f um", result.name.c_str(), figures(problem, result).rms_um);
    text += result.name == rebuilt_field ? " (not the daemon's model);" : ";";
  }
  text.back() = '.';
  return text + "\n`thermocomp place --all` shows every method's steps.\n";
}

std::string comparison_text(const PlacementProblem& problem, const Comparison& comparison) {
  const bool left_out = !problem.left_out.empty();
  std::string text;
  for (const TendencyPlacement& placement : comparison.ways) {
    text += line("tendency patterns chosen by %s:\n", name_of(placement.way).data());
    for (std::size_t f = 0; f < problem.used.size(); ++f) {
      text += run_text(problem, problem.used[f], placement.runs[f]);
    }
  }
  const TendencyPlacement& best = comparison.ways[comparison.best_way];
  text +=
      sensors_text(problem, comparison.method(std::string("tendency_").append(name_of(best.way))));
  text += sensors_text(problem, comparison.method("greedy"));
  text += "greedy, sensor by sensor:";
  for (const GreedyStep& step : comparison.greedy.steps) {
    text += line(" %s %.3f um;", step.block.c_str(), step.error_um);
  }
  text += "\n\nerror of the estimated displacement [um], RMS and maximum, over the load cases";
  text += line("\n%-24s %10s %10s", "", "used", "");
  if (left_out) text += line(" %12s", "left out");
  text.append("\n").append(table_row(comparison.uncompensated, left_out));
  for (const MethodResult& result : comparison.methods) text += table_row(result, left_out);
  return text;
}

std::string comparison_json(const PlacementProblem& problem, const Comparison& comparison) {
  Json json;
  for (const LoadCase& load : problem.load_cases) {
    json["load_cases"].push_back({{"name", load.name}, {"left_out", load.left_out}});
  }
  json["uncompensated"] = method_json(problem, comparison.uncompensated);
  json["uncompensated"].erase("sensors");
  for (const MethodResult& result : comparison.methods) {
    json["methods"][result.name] = method_json(problem, result);
  }
  const std::string best(name_of(comparison.ways[comparison.best_way].way));
  json["tendency"]["best_way"] = best;
  for (const TendencyPlacement& placement : comparison.ways) {
    Json& runs = json["tendency"]["history"][std::string(name_of(placement.way))];
    for (std::size_t f = 0; f < problem.used.size(); ++f) {
      runs.push_back(run_json(problem, problem.used[f], placement.runs[f], placement.sensors));
    }
  }
  for (const GreedyStep& step : comparison.greedy.steps) {
    json["greedy"].push_back(
        {{"block", step.block}, {"node", step.node}, {"error_um", step.error_um}});
  }
  return json.dump(2).append("\n");
}

}  // namespace thermocomp::placement
