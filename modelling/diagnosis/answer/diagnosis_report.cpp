#include "modelling/diagnosis/answer/diagnosis_report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>

#include "config/runs/run_file.hpp"
#include "config/text/units.hpp"
#include "report/html_page.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double change_lasts_s = 600.0;
constexpr double slope_smoothing_s = 300.0;
/// A slope below this share of the largest counts as steady.
constexpr double slope_share_min = 0.08;

/// Phase of each selected row: `change` in the ten minutes after a change of an operating signal,
/// else by the slope of the inputs' mean rise and by whether any signal is on.
std::vector<Phase> phases_of(const MeasuredRun& run, const MeasuredData& data) {
  Column mean_K = Column::Zero(run.rows());
  for (std::size_t input = 0; input < data.model.inputs.size(); ++input)
    mean_K += run.temps_K[input];
  const Column slope_K_per_s = slope(run.time_s, mean_K, slope_smoothing_s);
  const double steepest = slope_K_per_s.cwiseAbs().maxCoeff();
  std::vector<Phase> phases;
  double changed_at_s = -1e300;
  for (Eigen::Index row = 0; row < run.rows(); ++row) {
    bool on = false;
    for (std::size_t i = 0; i < data.signals.size(); ++i) {
      if (kind_of(data.signals[i]) != QuantityKind::signal) continue;
      const Column& signal = run.signals[i];
      on = on || std::abs(signal[row]) > 0;
      const double range = signal.maxCoeff() - signal.minCoeff();
      if (row > 0 && std::abs(signal[row] - signal[row - 1]) > 0.05 * range)
        changed_at_s = run.time_s[row];
    }
    if (row < run.begin) continue;
    if (run.time_s[row] - changed_at_s < change_lasts_s)
      phases.push_back(Phase::change);
    else if (slope_K_per_s[row] > slope_share_min * steepest)
      phases.push_back(Phase::heating);
    else if (slope_K_per_s[row] < -slope_share_min * steepest)
      phases.push_back(Phase::cooling);
    else
      phases.push_back(on ? Phase::steady : Phase::standstill);
  }
  return phases;
}

/// Indices of the model's inputs and of other temperatures in findings.
std::vector<std::size_t> places_shown(const Diagnosis& diagnosis, const MeasuredData& data) {
  std::vector<std::size_t> shown;
  for (std::size_t place = 0; place < data.temperatures.size(); ++place) {
    const std::string& name = data.temperatures[place];
    if (place < data.model.inputs.size() ||
        std::any_of(diagnosis.findings.begin(), diagnosis.findings.end(),
                    [&](const NamedFinding& finding) {
                      const SubjectColumns columns = subject_columns(finding.subject);
                      return columns.first == name || columns.second == name;
                    }))
      shown.push_back(place);
  }
  return shown;
}

}  // namespace

void add_runs(ReportData& report, const Diagnosis& diagnosis, const MeasuredData& data,
              const std::vector<Residuals>& before, const std::vector<Residuals>& after,
              bool test) {
  report.outputs = data.model.outputs;
  report.signals = data.signals;
  report.inputs.clear();
  const std::vector<std::size_t> shown = places_shown(diagnosis, data);
  for (const std::size_t place : shown) report.inputs.push_back(data.temperatures[place]);
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    const MeasuredRun& run = data.runs[i];
    const Eigen::Index rows = run.rows() - run.begin;
    ReportRun added{run.name, test, run.time_s.tail(rows), phases_of(run, data)};
    added.of_the_model = data.model.made_from && is_made_from(data.model.made_from->runs, run.name);
    for (const Column& measured : run.measured_um)
      added.measured_um.emplace_back(measured.tail(rows));
    for (const Column& signal : run.signals) added.signals.emplace_back(signal.tail(rows));
    for (const std::size_t place : shown)
      added.inputs_K.emplace_back(run.temps_K[place].tail(rows));
    for (const Residuals& each : before) added.before_um.push_back(each[i]);
    for (const Residuals& each : after) added.after_um.push_back(each[i]);
    report.runs.push_back(std::move(added));
  }
}

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

/// Measured, predicted and residual displacement of a run's outputs, operating signals and
/// temperatures over one axis of time.
/// @param units  one per output
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

/// Residual against the temperatures with the largest correlation.
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

/// One bar per output with the parts of the model's error; empty if they are unknown.
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

constexpr double support_reported_min = 0.05;
/// Least share of the model's error that leads to an advice.
constexpr double share_reported_min = 0.25;

/// Styles in addition to those of every page.
constexpr const char* own_style =
    "<style>svg .share{fill:#fff}.dots{stroke:#2b6cb0;stroke-width:2}.few{display:flex;"
    "flex-wrap:wrap}.few svg{width:32%;min-width:240px}summary{cursor:pointer;margin:.4em "
    "0;overflow-wrap:anywhere}summary h3{display:inline}"
    ".zoom4:checked~.wide svg{width:400%}.zoom16:checked~.wide svg{width:1600%}</style>\n";

std::string fixed(double value, int digits = 2) {
  if (!std::isfinite(value)) return "-";
  char text[40];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

using Table = std::vector<std::vector<std::string>>;

std::string folded(const std::string& title, const std::string& html) {
  if (html.empty()) return "";
  return "<details><summary>" + xml_text(title) + "</summary>\n" + html + "</details>\n";
}

std::string unit_text(const Diagnosis& diagnosis, const std::string& output) {
  if (diagnosis.unit != "um") return diagnosis.unit;
  return output.ends_with("_urad") ? "µrad" : "µm";
}

/// RMS of an output over the test runs, relative to each run's first value.
double motion_rms(const ReportData& report, const std::string& output) {
  const auto at = static_cast<std::size_t>(
      std::find(report.outputs.begin(), report.outputs.end(), output) - report.outputs.begin());
  Residuals motion;
  for (const ReportRun& run : report.runs) {
    if (!run.test || at >= run.measured_um.size()) continue;
    const Column& values = run.measured_um[at];
    const auto first = std::find_if(values.begin(), values.end(),
                                    [](double value) { return std::isfinite(value); });
    if (first != values.end()) motion.emplace_back(values.array() - double(*first));
  }
  return root_mean_square(motion);
}

/// "z: 1.0 of 44 µm is left on the test rows (2 %), with the extended model 0.80 µm."
std::string summary(const Diagnosis& diagnosis, const ReportData& report) {
  std::vector<std::string> all;
  for (const auto& [output, of] : diagnosis.outputs) {
    if (!std::isfinite(of.test_rms_um)) continue;
    const std::string unit = unit_text(diagnosis, output);
    const double motion = motion_rms(report, output);
    std::string text = name_of_column(output);
    text.append(": ").append(figure(of.test_rms_um));
    if (motion > 0) text.append(" of ").append(figure(motion));
    text.append(" ").append(unit).append(" (RMS) is left on the test rows");
    if (motion > 0) text.append(" (").append(fixed(100.0 * of.test_rms_um / motion, 0)) += " %)";
    if (of.extended_test_rms_um < of.test_rms_um)
      text.append(", with the extended model ")
          .append(figure(of.extended_test_rms_um))
          .append(" ")
          .append(unit);
    else
      text += "; nothing was found that makes it smaller";
    all.push_back(text + ".");
  }
  return html_list(all);
}

std::string gains_table(const Diagnosis& diagnosis) {
  Table rows{
      {"output", "RMS before", "RMS after", "peak before", "peak after", "of it without a name"}};
  for (const auto& [output, of] : diagnosis.outputs)
    rows.push_back({name_of_column(output) + ", " + unit_text(diagnosis, output),
                    figure(of.test_rms_um), figure(of.extended_test_rms_um),
                    figure(of.test_peak_um), figure(of.extended_test_peak_um),
                    fixed(100 * of.unexplained_fraction, 0) + " %"});
  return html_table(rows);
}

/// An advice, with the largest error reduction that it gives an output.
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
  return " (up to " + figure(gain_um) + " " + unit_text(diagnosis, "") + " RMS less)";
}

/// Names of the outputs with at least the reported share of the error.
template <class Share>
std::string outputs_with(const Diagnosis& diagnosis, Share share) {
  std::string names;
  for (const auto& [output, of] : diagnosis.outputs)
    if (of.headroom && share(*of.headroom) >= share_reported_min)
      names += (names.empty() ? "" : ", ") + name_of_column(output);
  return names;
}

std::vector<Advice> next_steps(const Diagnosis& diagnosis) {
  std::vector<Advice> all;
  for (const NamedFinding& finding : diagnosis.findings) {
    const double gain_um = largest_gain_um(finding.test);
    all.push_back({gain_um, title_of(finding.cause, finding.subject) + by(diagnosis, gain_um) +
                                ". " + what_to_do(finding)});
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
  if (diagnosis.verdict == "none") return all;  // the error is too small for more recordings
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
  return all;
}

std::string verdict_text(const Diagnosis& diagnosis, const std::vector<Advice>& steps) {
  if (diagnosis.verdict == "effect")
    return std::all_of(diagnosis.findings.begin(), diagnosis.findings.end(), fails_on_test_runs)
               ? "What is named below holds for the training runs; the test runs speak against it."
               : "The model lacks what is named below.";
  if (diagnosis.verdict == "unexplained")
    return "The error exceeds noise; no known cause explains it, so none is named.";
  return steps.empty() ? "Nothing worth saying: what is left is noise, or too little to act on."
                       : "No cause is named; a part of what is left can be predicted.";
}

std::string steps_html(const std::vector<Advice>& steps) {
  if (steps.empty()) return "";
  std::string html = html_heading("What to do, the largest gain first") + "<ol>";
  for (const Advice& each : steps) html += "<li>" + xml_text(each.text) + "</li>";
  return html + "</ol>\n";
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
  std::string html = number == 1 ? "<details open>" : "<details>";
  html += "<summary><h3>" + std::to_string(number) + ". " +
          xml_text(title_of(finding.cause, finding.subject)) + "</h3></summary>" +
          html_paragraph(sentence_of(finding) + probability_text(finding));
  Table gains{{"error on the test rows", "before", "after", "less by", "95 % interval"}};
  for (const auto& [output, gain] : finding.test)
    gains.push_back(
        {name_of_column(output) + ", " + unit, figure(gain.before_um), figure(gain.after_um),
         fixed(100 * gain.reduction, 0) + " %",
         fixed(100 * gain.ci95.low, 0) + " to " + fixed(100 * gain.ci95.high, 0) + " %"});
  std::string more = html_table(gains);
  for (const Alternative& other : finding.alternatives) {
    if (other.relative_support < support_reported_min) continue;
    more += html_paragraph("It could also be this: " + title_of(other.cause, other.subject) + " (" +
                           figure(100.0 * other.relative_support) +
                           " % as likely). To tell them apart: " +
                           experiment_between({finding.cause, finding.subject, 1.0}, other));
  }
  more += html_paragraph(finding.cause + " of " + finding.subject +
                             (finding.family.empty() ? "" : ", family " + finding.family) + ": " +
                             finding.evidence + ".",
                         "small");
  return html + folded("Gain, and what else it could be", more) + "</details>\n";
}

/// The likeliest candidates if there is no finding.
std::string candidates_html(const Diagnosis& diagnosis) {
  if (!diagnosis.findings.empty()) return "";
  Table rows{{"cause", "probability", "of the error on left-out rows", "error on the test rows",
              "what would decide"}};
  for (std::size_t i = 0; i < std::min(candidates_reported, diagnosis.weighed.size()); ++i) {
    const Candidate& each = diagnosis.weighed[i];
    if (each.probability < support_reported_min) continue;
    std::string gains;
    for (const auto& [output, gain] : each.test)
      gains += (gains.empty() ? "" : ", ") + name_of_column(output) + " " + figure(gain.before_um) +
               " to " + figure(gain.after_um);
    rows.push_back({title_of(each.cause, each.subject), fixed(100.0 * each.probability, 0) + " %",
                    fixed(100.0 * each.share_of_remainder, 0) + " %", gains.empty() ? "-" : gains,
                    each.would_decide});
  }
  if (rows.size() < 2) return "";
  return html_heading("What it may be") +
         html_paragraph(
             "Nothing of this is more likely than all else together. The gain on test "
             "rows is measured, and decides nothing.") +
         html_table(rows);
}

std::string phases_table(const ReportRun& run, const ReportData& report) {
  Table table{{"phase", "share of rows", "output", "RMS before", "peak before", "share of squares",
               "RMS after"}};
  const auto rows = static_cast<double>(run.phases.size());
  for (std::size_t output = 0; output < report.outputs.size(); ++output) {
    const double all = root_mean_square({run.before_um[output]});
    for (std::size_t p = 0; p < phase_names.size(); ++p) {
      const auto phase = static_cast<Phase>(p);
      const auto in_phase = [&](Column values) -> Residuals {
        for (Eigen::Index i = 0; i < values.size(); ++i)
          if (run.phases[static_cast<std::size_t>(i)] != phase) values[i] = not_a_number;
        return {std::move(values)};
      };
      const Residuals before = in_phase(run.before_um[output]);
      const double rms = root_mean_square(before);
      if (!std::isfinite(rms)) continue;
      const double share =
          static_cast<double>(std::count(run.phases.begin(), run.phases.end(), phase)) / rows;
      const double squares = all > 0 ? share * rms * rms / (all * all) : 0.0;
      table.push_back({phase_names[p], fixed(100 * share, 0) + " %", report.outputs[output],
                       fixed(rms), fixed(peak(before)), fixed(100 * squares, 0) + " %",
                       fixed(root_mean_square(in_phase(run.after_um[output])))});
    }
  }
  return html_table(table);
}

/// Time after which the autocorrelation of a residual is below 1/e; 0 if it is white.
double correlation_time_s(const Column& time_s, const Column& residual) {
  std::vector<Eigen::Index> present;
  for (Eigen::Index row = 0; row < residual.size(); ++row)
    if (std::isfinite(residual[row])) present.push_back(row);
  const Eigen::Index n = std::ssize(present);
  if (n < 8) return 0.0;
  Column values = residual(present);
  values.array() -= values.mean();
  const double limit = values.squaredNorm() / static_cast<double>(n) / std::exp(1.0);
  for (Eigen::Index lag = 1; lag < n / 2; ++lag)
    if (values.head(n - lag).dot(values.tail(n - lag)) <= limit * static_cast<double>(n - lag))
      return lag > 1 ? time_s[present[static_cast<std::size_t>(lag)]] - time_s[present.front()]
                     : 0.0;
  return 0.0;
}

std::string whiteness_table(const ReportRun& run, const ReportData& report) {
  Table rows{{"output", "error correlated over", "after: correlated over"}};
  const auto minutes = [&](const Column& residual) {
    return fixed(correlation_time_s(run.time_s, residual) / 60.0, 0) + " min";
  };
  for (std::size_t output = 0; output < report.outputs.size(); ++output)
    rows.push_back(
        {report.outputs[output], minutes(run.before_um[output]), minutes(run.after_um[output])});
  return html_table(rows);
}

/// A picture with buttons for its width, without a script.
std::string zoomed(const std::string& picture, const std::string& group) {
  std::string html = "<div>wider:";
  for (const std::string times : {"1", "4", "16"}) {
    const std::string id = group + "x" + times;
    html += " <input type=\"radio\" name=\"" + group + "\" id=\"" + id + "\" class=\"zoom" + times +
            (times == "1" ? "\" checked>" : "\">") + "<label for=\"" + id + "\">" + times +
            " x</label>";
  }
  return html + "<div class=\"wide\" tabindex=\"0\">" + picture + "</div></div>\n";
}

std::string role_text(const ReportRun& run) {
  if (!run.test) return " (training)";
  return run.of_the_model ? " (test; the model itself was fitted to this run)"
                          : " (test: nothing was fitted to these rows)";
}

std::string closer_look(const ReportRun& run, const Diagnosis& diagnosis,
                        const ReportData& report) {
  std::string html;
  for (std::size_t output = 0; output < report.outputs.size(); ++output)
    html += html_paragraph("Error of " + name_of_column(report.outputs[output]) + ", " +
                           unit_text(diagnosis, report.outputs[output]) +
                           ", over the temperatures that it goes with most:") +
            scatter_pictures(run, report, output);
  return html + phases_table(run, report) + whiteness_table(run, report);
}

/// The first test run visible, all others folded.
std::string runs_html(const Diagnosis& diagnosis, const ReportData& report) {
  std::vector<std::string> units;
  for (const std::string& output : report.outputs) units.push_back(unit_text(diagnosis, output));
  std::string html;
  std::string others;
  std::size_t number = 0;
  for (const bool test : {true, false})
    for (const ReportRun& run : report.runs) {
      if (run.test != test) continue;
      const bool first = number == 0;
      const std::string title = run.name + role_text(run);
      const std::string course =
          zoomed(course_picture(run, report, units), "run" + std::to_string(number++));
      const std::string closer = closer_look(run, diagnosis, report);
      if (first)
        html = html_heading(title) + course + folded("Figures for a closer look", closer);
      else
        others += folded(title, course + closer);
    }
  return html + others;
}

/// Warning about test runs to which the model was fitted.
std::string fitted_text(const ReportData& report) {
  std::string names;
  for (const ReportRun& run : report.runs)
    if (run.test && run.of_the_model) names += (names.empty() ? "" : ", ") + run.name;
  if (names.empty()) return "";
  return html_paragraph("The model was fitted to rows of " + names +
                        "; the error there says little of other days. Take a test run that "
                        "[made_from].runs of the model does not name.");
}

}  // namespace

std::string report_html(const Diagnosis& diagnosis, const ReportData& report) {
  const std::vector<Advice> steps = next_steps(diagnosis);
  std::string html = html_begin("What the model gets wrong") + own_style;
  if (!diagnosis.warnings.empty()) html += html_list(diagnosis.warnings);
  html += html_paragraph(verdict_text(diagnosis, steps)) + summary(diagnosis, report) +
          fitted_text(report) + steps_html(steps);
  if (!diagnosis.findings.empty()) html += html_heading("What was found");
  std::size_t number = 0;
  for (const NamedFinding& finding : diagnosis.findings)
    html += finding_html(
        finding, ++number,
        unit_text(diagnosis, finding.outputs.empty() ? std::string() : finding.outputs.front()));
  html += candidates_html(diagnosis);
  html += folded("What the model's error is made of", headroom_picture(diagnosis));
  html +=
      folded("Error before and after, on rows not used to find anything", gains_table(diagnosis));
  html += runs_html(diagnosis, report);
  html += html_paragraph(
      "RMS and peak in " +
          std::string(diagnosis.unit == "um" ? "µm (µrad for tilts)" : diagnosis.unit) +
          ". Phases: ten minutes after a change of a signal; heating and cooling by the mean of "
          "the inputs; else standstill or steady. White noise would be correlated over 0 min.",
      "small");
  return html + html_end();
}

}  // namespace thermocomp::diagnosis
