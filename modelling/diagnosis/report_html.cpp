#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "modelling/diagnosis/report_data.hpp"
#include "modelling/diagnosis/report_texts.hpp"
#include "modelling/diagnosis/svg_plot.hpp"
#include "modelling/markup/xml_text.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double support_told_min = 0.05;
constexpr std::size_t scatters_max = 4;

constexpr const char* head =
    "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Diagnosis</title><style>"
    "body{font:15px/1.45 sans-serif;max-width:900px;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;margin:.6em 0}td,th{border:1px solid #ccc;padding:.2em .6em;"
    "text-align:right}td:first-child,th:first-child{text-align:left}svg{width:100%;height:auto;"
    "background:#fafafa;margin:.2em 0}svg text{font:11px sans-serif}svg .title{font-weight:bold}"
    ".zero{stroke:#bbb}.dots{stroke:#2b6cb0;stroke-width:2}.few{display:flex}.few svg{width:25%}"
    "</style></head><body>\n";

std::string fixed(double value, int digits = 2) {
  if (!std::isfinite(value)) return "-";
  char text[40];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string row(const std::vector<std::string>& cells, const char* tag = "td") {
  std::string html = "<tr>";
  for (const std::string& cell : cells) {
    html.append("<").append(tag).append(">").append(xml_text(cell));
    html.append("</").append(tag).append(">");
  }
  return html + "</tr>\n";
}

struct Figures {
  double rms{not_a_number};
  double peak{not_a_number};
};

/// RMS over the rows that `takes` accepts; and the largest value.
template <class Takes>
Figures figures_of(const Column& values, Takes takes) {
  double squares = 0.0;
  double count = 0.0;
  Figures figures;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i]) || !takes(i)) continue;
    squares += values[i] * values[i];
    count += 1.0;
    if (!(std::abs(values[i]) <= figures.peak)) figures.peak = std::abs(values[i]);
  }
  if (count > 0) figures.rms = std::sqrt(squares / count);
  return figures;
}

std::string verdict_text(const Diagnosis& diagnosis) {
  if (diagnosis.verdict == "effect") return "The model lacks what is named below.";
  if (diagnosis.verdict == "none")
    return "Nothing worth saying: what is left is noise, or too little to act on.";
  return "The model and the machine part by more than noise, but no known cause carries it; none "
         "is named.";
}

std::string gains_table(const Diagnosis& diagnosis) {
  std::string html =
      "<h2>Error before and after, on rows not used to find anything</h2><table>" +
      row({"output", "RMS before", "RMS after", "peak before", "peak after", "left unexplained"},
          "th");
  for (const auto& [output, of] : diagnosis.outputs)
    html +=
        row({output, fixed(of.test_rms_um), fixed(of.extended_test_rms_um), fixed(of.test_peak_um),
             fixed(of.extended_test_peak_um), fixed(100 * of.unexplained_fraction, 0) + " %"});
  return html + "</table>\n";
}

std::string percent(double share) {
  return fixed(100.0 * share, 0) + " %";
}

/// How far the model could get with what was recorded.
std::string headroom_table(const Diagnosis& diagnosis) {
  std::string rows;
  for (const auto& [output, of] : diagnosis.outputs)
    if (of.headroom)
      rows += row({output, percent(of.headroom->noise), percent(of.headroom->named),
                   percent(of.headroom->predictable), percent(of.headroom->not_recorded)});
  if (rows.empty()) return "";
  return "<h2>What the model leaves is made of</h2><table>" +
         row({"output", "noise of a single value", "named below", "predictable, without a name",
              "in nothing that was recorded"},
             "th") +
         rows + "</table>\n";
}

std::string probability_text(const NamedFinding& finding) {
  if (!std::isfinite(finding.probability)) return "";
  std::string text = " Probability " + fixed(finding.probability);
  if (finding.group.size() > 1) {
    text += " that it is this or a place that moves alike (";
    for (std::size_t i = 1; i < finding.group.size(); ++i)
      text += (i > 1 ? ", " : "") + finding.group[i];
    text += ")";
  }
  return text + ", " + fixed(finding.family_probability) + " that it is of this kind (" +
         finding.family + ").";
}

std::string finding_html(const NamedFinding& finding, std::size_t number) {
  std::string html = "<h3>" + std::to_string(number) + ". " + xml_text(finding.cause) + " of " +
                     xml_text(finding.subject) + "</h3><p>" + xml_text(sentence_of(finding)) +
                     xml_text(probability_text(finding)) +
                     "</p><p>Evidence: " + xml_text(finding.evidence) +
                     ".</p><p><b>What to do.</b> " + xml_text(what_to_do(finding)) + "</p>\n";
  if (!finding.test.empty()) {
    html += "<table>" + row({"output", "test RMS before", "after", "taken", "95 %"}, "th");
    for (const auto& [output, gain] : finding.test)
      html += row({output, fixed(gain.before_um), fixed(gain.after_um),
                   fixed(100 * gain.reduction, 0) + " %",
                   fixed(100 * gain.ci95.low, 0) + " to " + fixed(100 * gain.ci95.high, 0) + " %"});
    html += "</table>\n";
  }
  for (const Alternative& other : finding.alternatives) {
    if (other.relative_support < support_told_min) continue;
    html +=
        "<p>These data do not rule out " + xml_text(other.cause) + " of " +
        xml_text(other.subject) + " (support " + fixed(other.relative_support) +
        " of that of the finding). What would tell: " + xml_text(experiment_for(finding, other)) +
        "</p>\n";
  }
  return html;
}

std::string phases_table(const ReportRun& run, const ReportData& report) {
  std::string html = "<table>" + row({"phase", "share of rows", "output", "RMS before",
                                      "peak before", "share of squares", "RMS after"},
                                     "th");
  const auto rows = static_cast<double>(run.phases.size());
  for (std::size_t output = 0; output < report.outputs.size(); ++output) {
    const double all = figures_of(run.before_um[output], [](Eigen::Index) { return true; }).rms;
    for (std::size_t p = 0; p < phase_count; ++p) {
      const auto phase = static_cast<Phase>(p);
      const auto in_phase = [&](Eigen::Index i) {
        return run.phases[static_cast<std::size_t>(i)] == phase;
      };
      const Figures before = figures_of(run.before_um[output], in_phase);
      if (!std::isfinite(before.rms)) continue;
      const double share =
          static_cast<double>(std::count(run.phases.begin(), run.phases.end(), phase)) / rows;
      const double squares = all > 0 ? share * before.rms * before.rms / (all * all) : 0.0;
      html += row({phase_name(phase), fixed(100 * share, 0) + " %", report.outputs[output],
                   fixed(before.rms), fixed(before.peak), fixed(100 * squares, 0) + " %",
                   fixed(figures_of(run.after_um[output], in_phase).rms)});
    }
  }
  return html + "</table>\n";
}

std::string whiteness_table(const ReportRun& run, const ReportData& report) {
  std::string html = "<table>" + row({"output", "noise of a value", "noise's share of the variance",
                                      "residual correlated over", "after: correlated over"},
                                     "th");
  for (std::size_t output = 0; output < report.outputs.size(); ++output) {
    const Whiteness before = whiteness_of(run.time_s, run.before_um[output]);
    const Whiteness after = whiteness_of(run.time_s, run.after_um[output]);
    html += row({report.outputs[output], fixed(before.noise_um, 3),
                 fixed(100 * before.noise_share, 1) + " %",
                 fixed(before.correlation_time_s / 60.0, 0) + " min",
                 fixed(after.correlation_time_s / 60.0, 0) + " min"});
  }
  return html + "</table>\n";
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

/// The residual over the inputs that it goes with most.
std::string scatters(const ReportRun& run, const ReportData& report, std::size_t output) {
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t input = 0; input < report.inputs.size(); ++input)
    order.emplace_back(-std::abs(correlation(run.inputs_K[input], run.before_um[output])), input);
  std::sort(order.begin(), order.end());
  std::string html = "<div class=\"few\">";
  for (std::size_t i = 0; i < std::min(scatters_max, order.size()); ++i) {
    const std::size_t input = order[i].second;
    html += scatter_plot(report.inputs[input] + ", r " + fixed(-order[i].first),
                         run.inputs_K[input], run.before_um[output]);
  }
  return html + "</div>\n";
}

std::string run_html(const ReportRun& run, const ReportData& report) {
  std::string html = "<h2>" + xml_text(run.name) + (run.test ? " (test)" : " (training)") + "</h2>";
  for (std::size_t output = 0; output < report.outputs.size(); ++output) {
    html += line_plot(report.outputs[output] + ": measured - model", run.time_s,
                      {{"model", "#c53030", &run.before_um[output]},
                       {"extended model", "#2b6cb0", &run.after_um[output]}});
    html +=
        "<p>Residual over the inputs that it goes with most:</p>" + scatters(run, report, output);
  }
  for (std::size_t i = 0; i < report.signals.size(); ++i)
    html += line_plot(report.signals[i], run.time_s, {{"", "#444", &run.signals[i]}});
  return html + phases_table(run, report) + whiteness_table(run, report);
}

}  // namespace

std::string report_html(const Diagnosis& diagnosis, const ReportData& report) {
  std::string html = head;
  html += "<h1>What the model gets wrong</h1><p>" + verdict_text(diagnosis) + "</p>\n";
  std::size_t number = 0;
  for (const NamedFinding& finding : diagnosis.findings) html += finding_html(finding, ++number);
  html += gains_table(diagnosis) + headroom_table(diagnosis);
  html +=
      "<p>RMS and peak in " +
      std::string(diagnosis.unit == "um" ? "um (urad for tilts)" : diagnosis.unit) +
      ". Phases: ten minutes after a change of a signal; "
      "heating and cooling by the mean of the inputs; else standstill or steady. White noise would "
      "be correlated over 0 min.</p>\n";
  for (const ReportRun& run : report.runs) html += run_html(run, report);
  return html + "</body></html>\n";
}

}  // namespace thermocomp::diagnosis
