#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <nlohmann/json.hpp>

#include "config/text/printable_text.hpp"
#include "modelling/identification/equation/fit.hpp"
#include "modelling/identification/families/families.hpp"
#include "modelling/identification/printed.hpp"
#include "report/html_page.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::identification {

namespace {

using Json = nlohmann::ordered_json;

std::string column_name(const MeasuredTests& tests, const FitColumn& column) {
  const std::string& place = tests.places[column.place];
  if (!(column.tau_s > 0)) return place;
  return std::string("lag of ")
      .append(place)
      .append(", ")
      .append(number_text(column.tau_s))
      .append(" s");
}

std::string losses_text(const MeasuredTests& tests, const Fit& fit) {
  std::string text("if a sensor is lost, left-out RMS (um):\n");
  for (const LostPlace& lost : fit.lost) {
    text += printed("  %-16s", tests.places[lost.place].c_str());
    for (std::size_t o = 0; o < tests.outputs.size(); ++o)
      text += printed(" %s %.3f without it", tests.outputs[o].c_str(), lost.without_rms_um[o]);
    if (lost.replacement != lost.place) {
      text += printed("; with %s instead", tests.places[lost.replacement].c_str());
      for (const double rms_um : lost.replaced_rms_um) text += printed(" %.3f", rms_um);
    }
    text += "\n";
  }
  return text;
}

/// Curves of measured, predicted and residual of an output, fold after fold.
std::string curves(const MeasuredTests& tests, const Fit& fit, Eigen::Index output) {
  std::vector<double> hours;
  std::vector<double> measured;
  std::vector<double> predicted;
  std::vector<double> residual;
  double all_h = 0.0;
  const auto length_h = [&](const Fold& fold) {
    const Eigen::VectorXd& time_s = tests.runs[fold.run].time_s;
    return (time_s[fold.end - 1] - time_s[fold.begin]) / 3600.0;
  };
  for (const Fold& fold : tests.folds) all_h += length_h(fold);
  const double between_h = 0.03 * all_h;  // visible gap between two tests
  double start_h = 0.0;
  for (const Fold& fold : tests.folds) {
    const TestRun& run = tests.runs[fold.run];
    for (Eigen::Index row = fold.begin; row < fold.end; ++row) {
      const double left_out_um = fit.left_out_um(static_cast<Eigen::Index>(hours.size()), output);
      hours.push_back(start_h + (run.time_s[row] - run.time_s[fold.begin]) / 3600.0);
      measured.push_back(run.outputs_um(row, output));
      predicted.push_back(left_out_um);
      residual.push_back(measured.back() - left_out_um);
    }
    start_h += length_h(fold) + between_h;
  }
  const std::string& name = tests.outputs[static_cast<std::size_t>(output)];
  return html_figure(curves_drawing(hours, "h, tests one after another",
                                    {{name + ", each test predicted by a fit to the others",
                                      "",
                                      {{"measured", "#606060", measured},
                                       {"predicted, left out", "#c8502c", predicted},
                                       {"residual", "#1b6ca8", residual}},
                                      250.0}})
                         .svg(),
                     "");
}

std::string groups_map(const MeasuredTests& tests, const Fit& fit) {
  std::vector<std::string> names = tests.places;
  for (const std::size_t place : fit.places) names[place].insert(0, "* ");
  const char* title = fit.places.empty() ? "similarity of places, light: alike"
                                         : "similarity of places, light: alike; chosen: *";
  return html_figure(groups_drawing(title, names, similarity(tests, true), fit.grouping).svg(), "");
}

/// RMS of an output on rows that were left out of the fit.
struct LeftOut {
  double with_um{0.0};       ///< with the model
  double without_um{0.0};    ///< without a model
  double other_day_um{0.0};  ///< expected, if only one day was recorded; 0: not estimated
};

/// Verdict, curves of measured and left-out prediction, warnings, and how the model was chosen.
/// @param left_out  one per output
/// @param summary      text output of the command
std::string page(const MeasuredTests& tests, const Fit& fit, const std::vector<LeftOut>& left_out,
                 const std::vector<std::string>& warnings, const std::string& summary) {
  std::string text = html_begin("Model of the thermal displacement");
  const char* judged_on = tests.runs.size() < 2 ? "stretches of the run" : "runs";
  for (std::size_t o = 0; o < tests.outputs.size(); ++o) {
    std::string verdict = tests.outputs[o] + ": ";
    if (!(left_out[o].with_um < left_out[o].without_um))
      verdict += "no family is better than no model, which leaves " +
                 figure_text(left_out[o].without_um) + " µm RMS.";
    else if (left_out[o].other_day_um > 0.0)
      verdict += "expect about " + figure_text(left_out[o].other_day_um) +
                 " µm RMS on another day (none was measured).";
    else
      verdict += std::string("on ") + judged_on + " that it was not fitted to, the model leaves " +
                 figure_text(left_out[o].with_um) + " µm RMS of " +
                 figure_text(left_out[o].without_um) + " µm.";
    if (is_unfit(left_out[o].with_um, left_out[o].without_um))
      verdict += " The model leaves half or more: not fit for use. Next: thermocomp diagnose.";
    text += html_paragraph(verdict);
  }
  for (std::size_t o = 0; o < tests.outputs.size(); ++o)
    text += curves(tests, fit, static_cast<Eigen::Index>(o));
  if (!warnings.empty()) text += html_heading("Warnings") + html_list(warnings);
  text +=
      "<details><summary>How the model was chosen</summary>\n<pre style=\"white-space:pre-wrap\">";
  text.append(xml_text(summary)).append("</pre>\n").append(groups_map(tests, fit));
  return text.append("</details>\n").append(html_end());
}

}  // namespace

std::string fit_text(const MeasuredTests& tests, const Fit& fit) {
  std::string text = printed("%llu combinations of %zu places in %zu groups, %zu tests left out\n",
                             static_cast<unsigned long long>(fit.judged), tests.places.size(),
                             fit.grouping.groups.size(), tests.folds.size());
  for (std::size_t terms = 0; terms < fit.ranking.size(); ++terms) {
    if (fit.ranking[terms].empty()) continue;
    const Subset& best = fit.ranking[terms].front();
    text += printed("  %zu terms, linear: left-out RMS %.3g %% of no model's:", terms,
                    100.0 * std::sqrt(best.score));
    for (const std::size_t place : best.places) text.append(" ").append(tests.places[place]);
    text += "\n";
  }
  for (std::size_t o = 0; o < tests.outputs.size(); ++o) {
    const OutputFit& output = fit.outputs[o];
    text += printed("%s: RMS %s %.3f um (peak %.3f), fitted %.3f, without a model %.3f\n",
                    tests.outputs[o].c_str(),
                    tests.runs.size() < 2 ? "of blocks of this run left out" : "left out",
                    output.left_out_rms_um, output.left_out_peak_um, output.train_rms_um,
                    output.no_model_rms_um);
    if (is_unfit(output.left_out_rms_um, output.no_model_rms_um))
      text += "  the model leaves half or more: not fit for use. Next: thermocomp diagnose\n";
    for (std::size_t i = 0; i < fit.columns.size(); ++i)
      text += printed(
          "  %+10.4f +- %.4f um/K  %s\n", output.coefficients[static_cast<Eigen::Index>(i)],
          output.ci95[static_cast<Eigen::Index>(i)], column_name(tests, fit.columns[i]).c_str());
    for (std::size_t f = 0; f < tests.folds.size(); ++f)
      text +=
          printed("  %s left out: RMS %.3f um (uncompensated %.3f)\n", tests.fold_name(f).c_str(),
                  output.fold_rms_um[f], output.fold_no_model_rms_um[f]);
  }
  for (std::size_t o = 0; o < tests.outputs.size() && !tests.hot.rows.empty(); ++o)
    text += printed("%s: the hotter half from the cooler one: %.3f um\n", tests.outputs[o].c_str(),
                    fit.outputs[o].hot_rms_um);
  text += printed("condition of the chosen columns: %.1f\n", fit.condition);
  text += losses_text(tests, fit);
  if (tests.runs.size() < 2) text += "judged within one run: the error on other days is unknown\n";
  for (const std::string& warning : fit.warnings)
    text.append("warning: ").append(warning).append("\n");
  return text;
}

std::string fit_json(const MeasuredTests& tests, const Fit& fit) {
  Json json;
  json["inputs"] = Json::array();
  for (const std::size_t place : fit.places) json["inputs"].push_back(tests.places[place]);
  for (std::size_t o = 0; o < tests.outputs.size(); ++o) {
    const OutputFit& output = fit.outputs[o];
    json["left_out_rms_um"][tests.outputs[o]] = output.left_out_rms_um;
    json["left_out_peak_um"][tests.outputs[o]] = output.left_out_peak_um;
    json["train_rms_um"][tests.outputs[o]] = output.train_rms_um;
    json["no_model_rms_um"][tests.outputs[o]] = output.no_model_rms_um;
    if (!tests.hot.rows.empty()) json["hot_half_rms_um"][tests.outputs[o]] = output.hot_rms_um;
    Json terms = Json::array();
    for (std::size_t i = 0; i < fit.columns.size(); ++i)
      terms.push_back({{"place", tests.places[fit.columns[i].place]},
                       {"lag_tau_s", fit.columns[i].tau_s},
                       {"um_per_K", output.coefficients[static_cast<Eigen::Index>(i)]},
                       {"ci95", output.ci95[static_cast<Eigen::Index>(i)]}});
    json["terms"][tests.outputs[o]] = terms;
    for (std::size_t f = 0; f < tests.folds.size(); ++f)
      json["tests"][tests.outputs[o]].push_back(
          {{"left_out", tests.fold_name(f)},
           {"rms_um", output.fold_rms_um[f]},
           {"no_model_rms_um", output.fold_no_model_rms_um[f]}});
  }
  json["judged_within_one_run"] = tests.runs.size() < 2;
  json["combinations"] = fit.judged;
  json["condition"] = fit.condition;
  for (const auto& group : fit.grouping.groups) {
    Json names = Json::array();
    for (const std::size_t place : group) names.push_back(tests.places[place]);
    json["groups"].push_back(names);
  }
  for (const LostPlace& lost : fit.lost)
    json["lost"].push_back(
        {{"place", tests.places[lost.place]},
         {"without_rms_um", lost.without_rms_um},
         {"replacement",
          lost.replacement == lost.place ? Json(nullptr) : Json(tests.places[lost.replacement])},
         {"replaced_rms_um", lost.replaced_rms_um}});
  json["warnings"] = fit.warnings;
  json["notes"] = tests.notes;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string fit_html(const MeasuredTests& tests, const Fit& fit) {
  std::vector<LeftOut> left_out;
  for (const OutputFit& output : fit.outputs)
    left_out.push_back({output.left_out_rms_um, output.no_model_rms_um});
  return page(tests, fit, left_out, fit.warnings, fit_text(tests, fit));
}

std::string families_html(const MeasuredTests& tests, const FamiliesFit& fit) {
  Fit shown = fit.few.value_or(Fit{});
  const FamilyResult& chosen = fit.of_model;
  shown.left_out_um = chosen.left_out_um;
  if (shown.grouping.groups.empty())
    shown.grouping = group_places(similarity(tests, true), noise_floor(tests));
  std::vector<LeftOut> left_out;
  for (std::size_t o = 0; o < tests.outputs.size(); ++o)
    left_out.push_back({chosen.left_out_rms_um[o], fit.results.front().left_out_rms_um[o]});
  const bool has_claim = tests.runs.size() == 1 && fit.chosen != Family::none;
  for (std::size_t o = 0; o < tests.outputs.size() && has_claim; ++o)
    left_out[o].other_day_um = fit.model.made_from->outputs.at(tests.outputs[o]).left_out_rms_um;
  return page(tests, shown, left_out, fit.warnings, families_text(tests, fit));
}

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

/// Expected error on another day. A single run contains no other day; each of two runs is judged by
/// a model of the other alone, which may be far worse than a model of both.
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
  const FamilyResult& chosen = fit.of_model;
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
