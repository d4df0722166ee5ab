#include <algorithm>
#include <cmath>
#include <numeric>

#include <nlohmann/json.hpp>

#include "modelling/identification/families/families.hpp"
#include "modelling/identification/printed.hpp"

namespace thermocomp::identification {
namespace {

using Json = nlohmann::ordered_json;

double score_of(const FamilyResult& result) {
  return std::accumulate(result.scores.begin(), result.scores.end(), 0.0);
}

std::string line_of(const FamilyResult& result, bool chosen) {
  std::string text =
      printed("  %c %-11s", chosen ? '*' : ' ', std::string(to_string(result.family)).c_str());
  if (!result.answers) return text.append(" no answer: ").append(result.why_not).append("\n");
  for (const double rms_um : result.left_out_rms_um) text += printed(" %10.3f", rms_um);
  return text + printed("   %5.1f %%\n", 100.0 * std::sqrt(score_of(result)));
}

/// Coefficients with their intervals, without the error on rows that took part in the choice: it is
/// too optimistic.
std::string equation_text(const MeasuredTests& tests, const Fit& fit) {
  std::string text;
  for (std::size_t o = 0; o < tests.outputs.size(); ++o) {
    text += printed("%s:\n", tests.outputs[o].c_str());
    for (std::size_t i = 0; i < fit.columns.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      const FitColumn& column = fit.columns[i];
      const std::string& place = tests.places[column.place];
      text += printed("  %+10.4f +- %.4f um/K  ", fit.outputs[o].coefficients[at],
                      fit.outputs[o].ci95[at]);
      text += column.tau_s > 0 ? printed("lag of %s, %.0f s\n", place.c_str(), column.tau_s)
                               : place + "\n";
    }
  }
  for (const std::string& warning : fit.warnings)
    text.append("warning: ").append(warning).append("\n");
  return text + printed("condition of the chosen columns: %.1f\n", fit.condition);
}

/// Two significant digits, or the integer part.
std::string about(double value) {
  return printed(std::abs(value) < 99.5 ? "%.2g" : "%.0f", value);
}

/// Expected error on another day. A single run contains no other day; two runs are each judged by a
/// model of the other alone, which may be far worse than a model of both.
std::string claim_text(std::size_t runs, const std::string& name, const MadeFrom::Output& output) {
  const char* how = runs == 1   ? "on another day (each half of this run by a model of the other)"
                    : runs == 2 ? "on a third run (each run by a model of the other alone)"
                                : "on another run (runs left out)";
  return printed("%s: expect about %s um RMS %s\n", name.c_str(),
                 about(output.left_out_rms_um).c_str(), how);
}

double worst_um(const FamilyResult& result, std::size_t output) {
  return *std::max_element(result.fold_um[output].begin(), result.fold_um[output].end());
}

}  // namespace

std::string families_text(const MeasuredTests& tests, const FamiliesFit& fit) {
  const bool one_run = tests.runs.size() < 2;
  std::string text = printed(
      "temperatures: %zu, operating signals: %zu, %s: %zu. Each left out "
      "in turn, everything chosen again on the rest; RMS in um:\n",
      tests.places.size(), tests.signals.size(), one_run ? "blocks of one run" : "runs",
      tests.folds.size());
  text += printed("    %-11s", "family");
  for (const std::string& output : tests.outputs) text += printed(" %10s", output.c_str());
  text += "   of no model's RMS\n";
  for (const FamilyResult& result : fit.results)
    text += line_of(result, result.family == fit.chosen);
  text += printed("chosen: %s, %s\n", std::string(to_string(fit.chosen)).c_str(),
                  fit.chosen_because.c_str());
  if (one_run) text += "judged within one run: the error on other days is unknown\n";
  if (fit.chosen != Family::none) {
    const MadeFrom& made_from = *fit.model.made_from;
    for (const auto& [name, output] : made_from.outputs)
      text += claim_text(tests.runs.size(), name, output);
  }
  if (fit.few) text += equation_text(tests, *fit.few);
  const auto is_printed = [&](const std::string& warning) {
    return fit.few && std::find(fit.few->warnings.begin(), fit.few->warnings.end(), warning) !=
                          fit.few->warnings.end();
  };
  for (const std::string& warning : fit.warnings)
    if (!is_printed(warning)) text.append("warning: ").append(warning).append("\n");
  return text;
}

std::string families_json(const MeasuredTests& tests, const FamiliesFit& fit) {
  Json json;
  if (fit.few) json = Json::parse(fit_json(tests, *fit.few));
  json["inputs"] = fit.chosen == Family::none ? std::vector<std::string>{} : fit.model.inputs;
  json["family"] = to_string(fit.chosen);
  json["chosen_because"] = fit.chosen_because;
  json["together"] = fit.together;
  json["unmoved"] = fit.unmoved;
  json["judged_within_one_run"] = tests.runs.size() < 2;
  const FamilyResult& chosen = fit.chosen_result();
  for (std::size_t o = 0; o < tests.outputs.size(); ++o) {
    json["left_out_rms_um"][tests.outputs[o]] = chosen.left_out_rms_um[o];
    json["no_model_rms_um"][tests.outputs[o]] = fit.results.front().left_out_rms_um[o];
  }
  json["families"] = Json::array();
  for (const FamilyResult& result : fit.results) {
    Json each = {{"family", to_string(result.family)}, {"chosen", result.family == fit.chosen}};
    if (!result.answers) {
      each["left_out_rms_um"] = nullptr;
      each["why_not"] = result.why_not;
    }
    for (std::size_t o = 0; o < tests.outputs.size() && result.answers; ++o) {
      const std::string& name = tests.outputs[o];
      each["left_out_rms_um"][name] = result.left_out_rms_um[o];
      each["worst_block_rms_um"][name] = worst_um(result, o);
      each["over_none"][name] =
          result.left_out_rms_um[o] / std::max(fit.results.front().left_out_rms_um[o], 1e-30);
    }
    json["families"].push_back(each);
  }
  if (!json.contains("warnings")) json["warnings"] = Json::array();
  for (const std::string& warning : fit.warnings) json["warnings"].push_back(warning);
  json["notes"] = tests.notes;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace thermocomp::identification
