#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>

#include "modelling/diagnosis/report/diagnosis_report.hpp"
#include "report/html_page.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr std::size_t scatters_max = 3;
constexpr std::size_t signals_max = 4;
constexpr double output_height = 130.0;
constexpr double error_height = 90.0;
constexpr double signal_height = 40.0;
constexpr const char* measured_colour = "#222";
constexpr const char* model_colour = "#c53030";
constexpr const char* extended_colour = "#2b6cb0";

std::span<const double> all_of(const Column& column) {
  return {column.data(), static_cast<std::size_t>(column.size())};
}

/// Correlation of two columns over the rows in which both have values.
double correlation(const Column& a, const Column& b) {
  const auto both = a.array().isFinite() && b.array().isFinite();
  const double n = static_cast<double>(both.count());
  if (!(n > 2)) return 0.0;
  const Eigen::ArrayXd x = both.select(a.array(), 0.0);
  const Eigen::ArrayXd y = both.select(b.array(), 0.0);
  const double cross = (x * y).sum() / n - x.sum() * y.sum() / (n * n);
  const double xx = x.square().sum() / n - std::pow(x.sum() / n, 2);
  const double yy = y.square().sum() / n - std::pow(y.sum() / n, 2);
  return xx > 0 && yy > 0 ? cross / std::sqrt(xx * yy) : 0.0;
}

PlotPanel temperatures_panel(const ReportRun& run, const ReportData& report) {
  PlotPanel panel{"temperatures, rise", "K", {}, error_height};
  for (std::size_t i = 0; i < run.inputs_K.size(); ++i)
    panel.lines.push_back(
        numbered_line(name_of_column(report.inputs[i]), i, all_of(run.inputs_K[i])));
  return panel;
}

}  // namespace

std::string course_picture(const ReportRun& run, const ReportData& report,
                           const std::vector<std::string>& units) {
  std::vector<Column> models;
  models.reserve(2 * report.outputs.size());  // panels refer to its elements
  std::vector<PlotPanel> panels;
  for (std::size_t output = 0; output < report.outputs.size(); ++output) {
    const std::string name = name_of_column(report.outputs[output]);
    const Column& measured = run.measured_um[output];
    const Column& model = models.emplace_back(measured - run.before_um[output]);
    const Column& extended = models.emplace_back(measured - run.after_um[output]);
    panels.push_back({name,
                      units[output] == "K" ? "°C" : units[output],  // errors alone are differences
                      {{"measured", measured_colour, all_of(measured)},
                       {"model", model_colour, all_of(model)},
                       {"extended model", extended_colour, all_of(extended)}},
                      output_height});
    panels.push_back({"error of " + name,
                      units[output],
                      {{"model", model_colour, all_of(run.before_um[output])},
                       {"extended model", extended_colour, all_of(run.after_um[output])}},
                      error_height});
  }
  for (std::size_t i = 0; i < std::min(signals_max, run.signals.size()); ++i) {
    const std::string name = name_of_column(report.signals[i]);
    const std::string unit =
        report.signals[i].substr(std::min(report.signals[i].size(), name.size() + 1));
    panels.push_back({name, unit, {{"", "#444", all_of(run.signals[i])}}, signal_height});
  }
  if (!run.inputs_K.empty()) panels.push_back(temperatures_panel(run, report));
  return panels_plot(all_of(run.time_s), panels);
}

std::string scatter_pictures(const ReportRun& run, const ReportData& report, std::size_t output) {
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t input = 0; input < report.inputs.size(); ++input)
    order.emplace_back(-std::abs(correlation(run.inputs_K[input], run.before_um[output])), input);
  std::sort(order.begin(), order.end());
  std::string html = "<div class=\"few\">";
  for (std::size_t i = 0; i < std::min(scatters_max, order.size()); ++i) {
    const std::size_t input = order[i].second;
    char title[80];
    std::snprintf(title, sizeof title, "%.40s, correlation %.2f",
                  name_of_column(report.inputs[input]).c_str(), -order[i].first);
    html += scatter_plot(
        {title, all_of(run.inputs_K[input]), "rise, K", all_of(run.before_um[output])});
  }
  return html + "</div>\n";
}

std::string headroom_picture(const Diagnosis& diagnosis) {
  std::vector<NamedBar> bars;
  for (const auto& [output, of] : diagnosis.outputs)
    if (of.headroom)
      bars.push_back({name_of_column(output),
                      {{"named here", "#2b6cb0", of.headroom->named},
                       {"predictable, without a name", "#b7791f", of.headroom->predictable},
                       {"in nothing that was recorded", "#c53030", of.headroom->not_recorded},
                       {"noise of a single value", "#a0aec0", of.headroom->noise}}});
  return bars.empty() ? std::string() : html_figure(bars_plot(bars), "");
}

}  // namespace thermocomp::diagnosis
