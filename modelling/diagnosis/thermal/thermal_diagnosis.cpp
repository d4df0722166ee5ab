#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "modelling/diagnosis/answer/findings.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/diagnosis.hpp"
#include "modelling/diagnosis/network/network_simulation.hpp"
#include "modelling/diagnosis/report/diagnosis_report.hpp"
#include "modelling/diagnosis/thermal/network_hypotheses.hpp"

namespace thermocomp::diagnosis {

namespace {

constexpr double least_step_K = 1e-9;
/// Least share of a sensor's motion: a lumped network has errors of some per cent.
constexpr double motion_share_min = 0.05;

/// Readings relative to the first; a missing one is replaced by the last.
Column rise_of(const Column& measured_degC) {
  Column rise = measured_degC;
  double first = not_a_number;
  double last = 0.0;
  for (double& value : rise) {
    if (std::isfinite(value)) {
      if (!std::isfinite(first)) first = value;
      last = value - first;
    }
    value = last;
  }
  return rise;
}

/// Quantisation noise, from the smallest step between two readings.
double step_noise_K(const ThermalRuns& runs, std::size_t sensor) {
  double least = std::numeric_limits<double>::infinity();
  for (const ThermalRun& run : runs.runs) {
    const Column& values = run.measured_degC[sensor];
    for (Eigen::Index row = 1; row < values.size(); ++row) {
      const double step = std::abs(values[row] - values[row - 1]);
      if (step > least_step_K) least = std::min(least, step);
    }
  }
  return std::isfinite(least) ? least / std::sqrt(12.0) : 0.0;
}

/// The runs as input of the search: sensors are the outputs.
MeasuredData data_of(const ThermalPlant& plant, const ThermalRuns& runs) {
  MeasuredData data;
  data.signals = runs.signals;
  for (const NetworkSensor& sensor : plant.network.sensors) {
    data.model.outputs.push_back(sensor.column);
    data.model.inputs.push_back(sensor.column);
  }
  data.temperatures = data.model.inputs;
  const NetworkSimulation simulation(plant.network);
  for (std::size_t i = 0; i < runs.runs.size(); ++i) {
    const ThermalRun& of = runs.runs[i];
    MeasuredRun run;
    run.name = of.name;
    run.time_s = of.time_s;
    run.begin = of.begin;
    run.signals = of.signals;
    run.model_um = simulation.readings_degC(runs, i);
    run.measured_um = of.measured_degC;
    for (const Column& measured : of.measured_degC) run.temps_K.push_back(rise_of(measured));
    data.add(std::move(run));
  }
  for (std::size_t sensor = 0; sensor < plant.network.sensors.size(); ++sensor)
    data.least_noise_um.push_back(step_noise_K(runs, sensor));
  return data;
}

/// measured - simulated over the selected rows, of every sensor.
std::vector<Residuals> residuals_of(const HeatNetwork& network, const ThermalRuns& runs) {
  std::vector<Residuals> all(network.sensors.size());
  const NetworkSimulation simulation(network);
  for (std::size_t i = 0; i < runs.runs.size(); ++i) {
    const ThermalRun& run = runs.runs[i];
    const std::vector<Column> simulated = simulation.readings_degC(runs, i);
    for (std::size_t sensor = 0; sensor < all.size(); ++sensor)
      all[sensor].emplace_back(
          (run.measured_degC[sensor] - simulated[sensor]).tail(run.rows() - run.begin));
  }
  return all;
}

}  // namespace

Diagnosis diagnose_thermal(const ThermalPlant& plant, const std::vector<RunFile>& train,
                           const std::vector<std::string>& train_names,
                           const std::vector<RunFile>& test,
                           const std::vector<std::string>& test_names, ReportData* report,
                           const std::function<void()>& progress, const NetworkView& view) {
  std::vector<RunFile> all = train;
  all.insert(all.end(), test.begin(), test.end());
  const std::vector<std::string> signals = shared_signals(all);
  const ThermalRuns train_runs = thermal_runs(plant, train, train_names, signals);
  const ThermalRuns test_runs = thermal_runs(plant, test, test_names, signals);
  const MeasuredData train_data = data_of(plant, train_runs);
  const auto catalogue = std::make_shared<NetworkHypotheses>(plant, train_runs, train_data.rows);
  const std::vector<Hypothesis> hypotheses = NetworkHypotheses::all(catalogue);
  const SearchResult result =
      search(train_data, hypotheses, progress, motion_share_min,
             [&](const std::vector<Explanation>& found) { catalogue->accept(found); });

  Diagnosis diagnosis;
  diagnosis.unit = "K";
  diagnosis.verdict = verdict_of(result);
  const std::vector<Residuals> base = residuals_of(plant.network, test_runs);
  std::vector<Residuals> before = base;
  HeatNetwork network = plant.network;
  for (const Finding& finding : result.findings) {
    NamedFinding name = named_finding(finding, train_data, catalogue->parameters_of(finding));
    name.probability = name.family_probability = not_a_number;  // not calibrated here
    catalogue->apply(finding, network);
    const std::vector<Residuals> after = residuals_of(network, test_runs);
    for (std::size_t sensor = 0; sensor < base.size() && !name.run; ++sensor) {
      const std::string& column = plant.network.sensors[sensor].column;
      const bool acts =
          std::find(name.outputs.begin(), name.outputs.end(), column) != name.outputs.end();
      if (acts && std::isfinite(root_mean_square(before[sensor])))
        name.test[column] = test_gain(before[sensor], after[sensor]);
    }
    before = after;
    diagnosis.findings.push_back(std::move(name));
  }
  const std::vector<Residuals> train_base = residuals_of(plant.network, train_runs);
  for (std::size_t sensor = 0; sensor < base.size(); ++sensor) {
    if (!std::isfinite(root_mean_square(train_base[sensor]))) continue;
    diagnosis.outputs[plant.network.sensors[sensor].column] = output_figures(
        train_base[sensor], base[sensor], before[sensor], result.unexplained_share[sensor]);
  }
  if (report != nullptr) {
    add_runs(*report, diagnosis, train_data, train_base, residuals_of(network, train_runs), false);
    add_runs(*report, diagnosis, data_of(plant, test_runs), base, residuals_of(network, test_runs),
             true);
  }
  if (view) view(test_runs, plant.network, network);
  return diagnosis;
}

std::optional<std::string> corrected_machine(const std::filesystem::path& path,
                                             const std::vector<NamedFinding>& findings) {
  MachineFile machine(path);
  if (machine.is_body()) return std::nullopt;
  std::string text = "# Written by thermocomp diagnose: values as the training runs have them.\n";
  for (const NamedFinding& finding : findings) {
    const Cause& cause = cause_named(finding.cause);
    if (cause.into_machine == nullptr ||
        !cause.into_machine(machine, finding.subject, finding.parameters))
      text.append("# No key carries " + finding.cause + " of " + finding.subject + ".\n");
  }
  return text + machine.text() + "\n";
}

}  // namespace thermocomp::diagnosis
