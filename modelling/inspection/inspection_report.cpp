#include <algorithm>
#include <cmath>
#include <span>

#include "config/text/units.hpp"
#include "modelling/inspection/inspection.hpp"
#include "report/html_page.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::inspection {
namespace {

/// Plots one column over the run's hours, with the finding's stretch and moments marked.
std::string picture(const RunFile& run, const std::string& column, double from_s, double to_s,
                    const Finding& finding) {
  const auto& time_s = run.time_s();
  const auto row_at = [&](double at_s) {
    const auto row = std::lower_bound(time_s.begin(), time_s.end(), at_s);
    return static_cast<std::size_t>(row - time_s.begin());
  };
  const std::size_t begin = row_at(from_s);
  const std::size_t count = std::max(begin + 1, row_at(to_s)) - begin;
  const std::span values = std::span(run.column(column)).subspan(begin, count);
  const std::span times = std::span(time_s).subspan(begin, count);
  std::vector<double> since_start_s(times.begin(), times.end());
  for (double& at_s : since_start_s) at_s -= time_s.front();
  std::vector<double> marks(count, std::nan(""));
  for (const double at_s : finding.times_s) {
    const std::size_t row = row_at(at_s) - begin;  // wraps to a large number before `begin`
    if (row < count) marks[row] = values[row];
  }
  std::vector<PlotSpan> spans;
  if (finding.times_s.empty()) {
    const double seen_s = 0.002 * (since_start_s.back() - since_start_s.front());
    const double at_s = finding.at_s - time_s.front();
    spans.push_back({"", at_s, std::max(finding.until_s - time_s.front(), at_s + seen_s)});
  }
  return html_figure(panels_plot(since_start_s,
                                 {{column,
                                   std::string(unit_of(column).symbol),
                                   {{"", "#2b6cb0", values}, {"", "#c53030", marks, true}}}},
                                 spans),
                     "");
}

/// The place most similar to the finding's, for comparison.
std::string neighbour_of(const Inspection& inspection, const Finding& finding, const RunFile& run) {
  if (finding.kind == "gap") return "";
  if (!finding.other.empty()) return finding.other;
  if (!is_temperature(finding.column)) return "";
  for (const auto& group : inspection.groups) {
    if (std::find(group.begin(), group.end(), finding.column) == group.end()) continue;
    for (const std::string& name : group)
      if (name != finding.column && run.find(name)) return name;
  }
  return "";
}

std::string finding_html(const std::vector<RunFile>& runs, const Inspection& inspection,
                         const Finding& finding) {
  const RunFile& run = runs[finding.run];
  std::string html = html_heading((finding.column.empty() ? finding.kind : finding.column) + ", " +
                                  std::to_string(std::lround(100 * finding.probability)) + " %") +
                     html_paragraph(finding.text + " (" + run.name + ")");
  if (!run.find(finding.column)) return html;
  const double first_s = run.time_s().front();
  const double last_s = run.time_s().back() + 1e-6;
  html += picture(run, finding.column, first_s, last_s, finding);
  const bool sudden = finding.kind == "sensor_step" || finding.kind == "displacement_step" ||
                      finding.kind == "sensor_loose";
  const double near_s = 0.03 * (last_s - first_s);
  if (sudden)
    html += html_paragraph("Enlarged:", "small") +
            picture(run, finding.column, finding.at_s - near_s, finding.at_s + near_s, finding);
  const std::string neighbour = neighbour_of(inspection, finding, run);
  if (!neighbour.empty())
    html += html_paragraph("For comparison, a place that moves alike:", "small") +
            picture(run, neighbour, first_s, last_s, finding);
  return html;
}

std::string runs_table(const Inspection& inspection) {
  std::vector<std::vector<std::string>> rows{{"file", "rows", "one every", "gaps"}};
  for (const RunSampling& run : inspection.runs)
    rows.push_back({run.file, std::to_string(run.rows), step_text(run.step_s),
                    std::to_string(run.gaps.size())});
  return html_heading("The recordings") + html_table(rows);
}

}  // namespace

std::string inspection_html(const std::vector<RunFile>& runs, const Inspection& inspection) {
  std::string html = html_begin("Faults of the recordings");
  html += html_paragraph(inspection.findings.empty() ? "No faults were found in these recordings."
                                                     : std::to_string(inspection.findings.size()) +
                                                           " found, in order of probability.");
  for (const Finding& finding : inspection.findings)
    html += finding_html(runs, inspection, finding);
  html += runs_table(inspection);
  const std::vector<std::string> groups = alike(inspection);
  html += groups.empty() ? html_paragraph(none_alike)
                         : html_heading("Places that correlate above 0.98") + html_list(groups);
  if (!inspection.experiments.empty())
    html += html_heading("Experiments that would show more") + html_list(inspection.experiments);
  return html + html_end();
}

}  // namespace thermocomp::inspection
