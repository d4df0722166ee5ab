#include <algorithm>
#include <cmath>

#include "config/runs/run_file.hpp"
#include "config/text/units.hpp"
#include "modelling/diagnosis/data/series.hpp"
#include "modelling/diagnosis/report/diagnosis_report.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double change_lasts_s = 600.0;
constexpr double slope_smoothing_s = 300.0;
/// A slope below this share of the largest counts as steady.
constexpr double slope_share_min = 0.08;

}  // namespace

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

namespace {

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

/// Whether the model was made from rows of the run; folders are ignored.
bool is_of_the_model(const ThermalModel& model, const std::string& run) {
  if (!model.made_from) return false;
  const RunSelection of = parse_selection(run);
  return std::any_of(model.made_from->runs.begin(), model.made_from->runs.end(),
                     [&](const std::string& each) {
                       const RunSelection known = parse_selection(each);
                       return known.file.filename() == of.file.filename() &&
                              known.from_s < of.to_s && of.from_s < known.to_s;
                     });
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
    added.of_the_model = is_of_the_model(data.model, run.name);
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

}  // namespace thermocomp::diagnosis
