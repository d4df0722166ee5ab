#include <cmath>
#include <limits>

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
  const FamilyResult& chosen = fit.chosen_result();
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

}  // namespace thermocomp::identification
