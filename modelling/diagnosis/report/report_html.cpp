#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "modelling/diagnosis/report/diagnosis_report.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double support_told_min = 0.05;
constexpr std::size_t candidates_told = 3;
/// A share of what the model leaves that is worth an advice.
constexpr double share_told_min = 0.25;

constexpr const char* head =
    "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
    "content=\"width=device-width\"><title>Diagnosis</title><style>"
    "body{font:16px/1.5 sans-serif;max-width:960px;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;margin:.6em 0}td,th{border:1px solid #ccc;padding:.2em .6em;"
    "text-align:right}td:first-child,th:first-child{text-align:left}svg{width:100%;height:auto;"
    "background:#fafafa;margin:.2em 0}svg text{font:11px sans-serif}svg .title{font-weight:bold}"
    "svg .share{fill:#fff}.zero{stroke:#888}.grid{stroke:#e2e8f0}.axis{stroke:#888}"
    ".dots{stroke:#2b6cb0;stroke-width:2}.few{display:flex}.few svg{width:33%}"
    ".small{font-size:80%;color:#555}summary{cursor:pointer}.wide{overflow-x:auto}"
    ".zoom4:checked~.wide svg{width:400%}.zoom16:checked~.wide svg{width:1600%}"
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
  return "The error exceeds noise; no known cause explains it, so none is named.";
}

std::string unit_text(const Diagnosis& diagnosis, const std::string& output) {
  if (diagnosis.unit != "um") return diagnosis.unit;
  return output.ends_with("_urad") ? "urad" : "um";
}

/// "5.7 um".
std::string with_unit(double value, const std::string& unit) {
  return figure(value).append(" ").append(unit);
}

/// "z: the model's error on the test rows is 5.7 um (RMS), with the extended model 3.1 um."
std::string summary(const Diagnosis& diagnosis) {
  std::string html = "<ul>";
  for (const auto& [output, of] : diagnosis.outputs) {
    if (!std::isfinite(of.test_rms_um)) continue;
    const std::string unit = unit_text(diagnosis, output);
    std::string text = name_of_column(output);
    text.append(": the model's error on the test rows is ");
    text.append(with_unit(of.test_rms_um, unit)).append(" (RMS)");
    if (of.extended_test_rms_um < of.test_rms_um)
      text.append(", with the extended model ").append(with_unit(of.extended_test_rms_um, unit));
    else
      text.append("; nothing was found that makes it smaller");
    html.append("<li>").append(xml_text(text)).append(".</li>");
  }
  return html + "</ul>\n";
}

std::string gains_table(const Diagnosis& diagnosis) {
  std::string html =
      "<h2>Error before and after, on rows not used to find anything</h2><table>" +
      row({"", "RMS before", "RMS after", "peak before", "peak after", "of it without a name"},
          "th");
  for (const auto& [output, of] : diagnosis.outputs)
    html += row({name_of_column(output) + ", " + unit_text(diagnosis, output),
                 figure(of.test_rms_um), figure(of.extended_test_rms_um), figure(of.test_peak_um),
                 figure(of.extended_test_peak_um), fixed(100 * of.unexplained_fraction, 0) + " %"});
  return html + "</table>\n";
}

/// What can be done, and by how much the largest gain of an output makes the error smaller.
struct Advice {
  double gain_um{0.0};
  std::string text;
};

double largest_gain_um(const std::map<std::string, TestGain>& test) {
  double largest = 0.0;
  for (const auto& [output, gain] : test)
    largest = std::max(largest, gain.before_um - gain.after_um);
  return largest;
}

std::string by(const Diagnosis& diagnosis, double gain_um) {
  if (!(gain_um > 0)) return "";
  return " (up to " + figure(gain_um) + " " + (diagnosis.unit == "um" ? "um" : diagnosis.unit) +
         " RMS less)";
}

/// Outputs of which a share of the error is above the least that is reported, by name.
template <class Share>
std::string outputs_with(const Diagnosis& diagnosis, Share share) {
  std::string names;
  for (const auto& [output, of] : diagnosis.outputs)
    if (of.headroom && share(*of.headroom) >= share_told_min)
      names += (names.empty() ? "" : ", ") + name_of_column(output);
  return names;
}

std::string next_steps(const Diagnosis& diagnosis) {
  std::vector<Advice> all;
  for (const NamedFinding& finding : diagnosis.findings) {
    const double gain_um = largest_gain_um(finding.test);
    all.push_back(
        {gain_um, title_of(finding) + by(diagnosis, gain_um) + ". " + what_to_do(finding)});
  }
  if (diagnosis.remainder && diagnosis.remainder->term.bank.gain_um_per_unit.empty())
    all.push_back({0.0,
                   "A part of the error follows from readings and signals of the last hours in "
                   "the training runs, and not in the test runs: the extended model goes "
                   "without it. Record more runs, with other speeds and pauses."});
  else if (diagnosis.remainder) {
    const double gain_um = largest_gain_um(diagnosis.remainder->test);
    all.push_back(
        {gain_um, "What can be predicted and has no name" + by(diagnosis, gain_um) +
                      ". The extended model carries it by readings and signals of the last hours; "
                      "it holds for operation like that of the training runs." +
                      (diagnosis.remainder->changes_coefficients
                           ? " The model had been fitted to those runs; its coefficients change "
                             "with it."
                           : "")});
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Advice& a, const Advice& b) { return a.gain_um > b.gain_um; });
  const std::string predictable =
      outputs_with(diagnosis, [](const Headroom& of) { return of.predictable; });
  if (!predictable.empty() && !diagnosis.remainder)
    all.push_back({0.0, predictable +
                            ": a good part of the error follows from what was recorded, but not "
                            "in a way that held when rows were left out. Record more runs, with "
                            "other speeds and pauses."});
  const std::string unseen =
      outputs_with(diagnosis, [](const Headroom& of) { return of.not_recorded; });
  if (!unseen.empty())
    all.push_back({0.0, unseen + ": a good part of the error goes with nothing that was recorded. "
                                 "A sensor at a place that has none, or the signal of a pump, fan "
                                 "or cooler, is what would help."});
  if (all.empty()) return "";
  std::string html = "<h2>What to do, the largest gain first</h2><ol>";
  for (const Advice& each : all) html += "<li>" + xml_text(each.text) + "</li>";
  return html + "</ol>\n";
}

/// How far the model could get with what was recorded.
std::string headroom_html(const Diagnosis& diagnosis) {
  const std::string picture = headroom_picture(diagnosis);
  return picture.empty() ? picture : "<h2>What the model's error is made of</h2>\n" + picture;
}

std::string probability_text(const NamedFinding& finding) {
  if (!std::isfinite(finding.probability)) return "";
  std::string text = " It is this";
  if (finding.group.size() > 1) {
    text += ", or the same at a place that these data do not tell from it (";
    for (std::size_t i = 1; i < finding.group.size(); ++i)
      text += (i > 1 ? ", " : "") + finding.group[i];
    text += "),";
  }
  return text + " with a probability of " + fixed(100.0 * finding.probability, 0) + " %.";
}

std::string finding_html(const NamedFinding& finding, std::size_t number, const std::string& unit) {
  std::string html = "<h3>" + std::to_string(number) + ". " + xml_text(title_of(finding)) +
                     "</h3><p>" + xml_text(sentence_of(finding)) +
                     xml_text(probability_text(finding)) + "</p>\n";
  if (!finding.test.empty()) {
    html += "<table>" +
            row({"error on the test rows", "before", "after", "less by", "95 % interval"}, "th");
    for (const auto& [output, gain] : finding.test)
      html += row({name_of_column(output) + ", " + unit, figure(gain.before_um),
                   figure(gain.after_um), fixed(100 * gain.reduction, 0) + " %",
                   fixed(100 * gain.ci95.low, 0) + " to " + fixed(100 * gain.ci95.high, 0) + " %"});
    html += "</table>\n";
  }
  for (const Alternative& other : finding.alternatives) {
    if (other.relative_support < support_told_min) continue;
    html += "<p>It could also be this: " + xml_text(title_of(other)) + " (" +
            figure(100.0 * other.relative_support) + " % as likely). To tell them apart: " +
            xml_text(experiment_between({finding.cause, finding.subject, 1.0}, other)) + "</p>\n";
  }
  return html + "<p class=\"small\">" + xml_text(finding.cause) + " of " +
         xml_text(finding.subject) + (finding.family.empty() ? "" : ", family " + finding.family) +
         ": " + xml_text(finding.evidence) + ".</p>\n";
}

/// What was weighed where nothing is named.
std::string candidates_html(const Diagnosis& diagnosis) {
  if (!diagnosis.findings.empty() || diagnosis.weighed.empty()) return "";
  std::string html =
      "<h2>What it may be</h2><p>Nothing of this is more likely than all else "
      "together. The gain on test rows is measured, and decides nothing.</p><table>" +
      row({"", "probability", "of the error on left-out rows", "error on the test rows",
           "what would decide"},
          "th");
  for (std::size_t i = 0; i < std::min(candidates_told, diagnosis.weighed.size()); ++i) {
    const Candidate& each = diagnosis.weighed[i];
    std::string gains;
    for (const auto& [output, gain] : each.test)
      gains += (gains.empty() ? "" : ", ") + name_of_column(output) + " " + figure(gain.before_um) +
               " to " + figure(gain.after_um);
    html += row({title_of(Alternative{each.cause, each.subject, 1.0}),
                 fixed(100.0 * each.probability, 0) + " %",
                 fixed(100.0 * each.share_of_remainder, 0) + " %", gains.empty() ? "-" : gains,
                 each.would_decide});
  }
  return html + "</table>\n";
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

/// A picture that can be made wider: no script is needed for that.
std::string zoomed(const std::string& picture, const std::string& group) {
  std::string html = "<div>wider:";
  for (const char* times : {"1", "4", "16"}) {
    const std::string id = std::string(group).append("x").append(times);
    html.append(" <input type=\"radio\" name=\"").append(group).append("\" id=\"").append(id);
    html.append("\" class=\"zoom").append(times).append("\"");
    if (std::string_view(times) == "1") html.append(" checked");
    html.append("><label for=\"").append(id);
    html.append("\">").append(times).append(" x</label>");
  }
  return html.append("<div class=\"wide\">").append(picture).append("</div></div>\n");
}

std::string run_html(const ReportRun& run, const Diagnosis& diagnosis, const ReportData& report,
                     std::size_t number) {
  std::string html = "<h2>" + xml_text(run.name) +
                     (run.test ? " (test: nothing was fitted to these rows)" : " (training)") +
                     "</h2>";
  std::string checks;
  for (std::size_t output = 0; output < report.outputs.size(); ++output) {
    const std::string unit = unit_text(diagnosis, report.outputs[output]);
    std::string group = "r";
    group.append(std::to_string(number)).append("o").append(std::to_string(output));
    html += zoomed(course_picture(run, report, output, unit), group);
    checks += "<p>Error of " + xml_text(name_of_column(report.outputs[output])) + ", " + unit +
              ", over the temperatures that it goes with most:</p>" +
              scatter_pictures(run, report, output);
  }
  return html + "<details><summary>Figures for a closer look</summary>" + checks +
         phases_table(run, report) + whiteness_table(run, report) + "</details>\n";
}

}  // namespace

std::string report_html(const Diagnosis& diagnosis, const ReportData& report) {
  std::string html = head;
  html += "<h1>What the model gets wrong</h1><p>" + verdict_text(diagnosis) + "</p>\n" +
          summary(diagnosis) + next_steps(diagnosis);
  html += headroom_html(diagnosis);
  if (!diagnosis.findings.empty()) html += "<h2>What was found</h2>\n";
  std::size_t number = 0;
  for (const NamedFinding& finding : diagnosis.findings)
    html += finding_html(
        finding, ++number,
        unit_text(diagnosis, finding.outputs.empty() ? std::string() : finding.outputs.front()));
  html += candidates_html(diagnosis);
  html += gains_table(diagnosis);
  std::size_t drawn = 0;
  for (const bool test : {true, false})
    for (const ReportRun& run : report.runs)
      if (run.test == test) html += run_html(run, diagnosis, report, drawn++);
  html +=
      "<p class=\"small\">RMS and peak in " +
      std::string(diagnosis.unit == "um" ? "um (urad for tilts)" : diagnosis.unit) +
      ". Phases: ten minutes after a change of a signal; heating and cooling by the mean of the "
      "inputs; else standstill or steady. White noise would be correlated over 0 min.</p>\n";
  return html + "</body></html>\n";
}

}  // namespace thermocomp::diagnosis
