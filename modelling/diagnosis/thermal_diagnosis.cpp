#include "modelling/diagnosis/thermal_diagnosis.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>

#include "estimator/checks.hpp"
#include "modelling/diagnosis/answer/diagnosis_report.hpp"
#include "modelling/diagnosis/answer/findings.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/rank/search.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Hypotheses for a thermal network, and the readings that each would explain.
///
/// The column of a cause is the difference of the readings of the changed and of the unchanged
/// network, both with the causes accepted before it.
class NetworkHypotheses {
 public:
  /// @param rows  of the training runs. All three outlive this.
  NetworkHypotheses(const ThermalPlant& plant, const ThermalRuns& runs, const StackedRows& rows);

  /// The hypotheses keep `self` alive.
  [[nodiscard]] static std::vector<Hypothesis> all(const std::shared_ptr<NetworkHypotheses>& self);
  void accept(const std::vector<Explanation>& found);
  /// Applies a finding to the network.
  void apply(const Finding& finding, HeatNetwork& network) const;
  [[nodiscard]] std::vector<Parameter> parameters_of(const Finding& finding) const;

 private:
  struct Base {
    NetworkSimulation simulation;
    std::vector<Column> stacked;  ///< readings, one column per sensor
  };
  struct Known {
    std::size_t cause{0};
    std::size_t base{0};
    Shape shape;
    std::vector<Column> columns;
  };

  void add(const NetworkSubject& subject);
  [[nodiscard]] Column columns(std::size_t cause, const Shape& shape, std::size_t output);
  [[nodiscard]] std::vector<Column> stacked(const NetworkSimulation& simulation) const;
  [[nodiscard]] std::size_t cause_of(const Hypothesis& hypothesis) const;

  const NetworkMaterial material_;
  std::vector<NetworkHypothesis> causes_;
  std::vector<std::size_t> accepted_;  ///< causes, in their order
  std::vector<Base> bases_;            ///< before each accepted cause; the last: with all
  std::deque<Known> known_;            ///< cache of the newest columns, for several outputs
};

constexpr std::size_t columns_kept = 24;

/// The shared gain with its interval.
struct Gain {
  double value{1.0};
  Interval ci95{1.0, 1.0};
};

Gain gain_of(const Finding& finding) {
  for (std::size_t output = 0; output < finding.explanation.gains.size(); ++output)
    if (finding.explanation.gains[output].size() > 0 && !finding.gains_ci[output].empty())
      return {finding.explanation.gains[output][0], finding.gains_ci[output].front()};
  return {};
}

double gain_of(const Explanation& explanation) {
  for (const Eigen::VectorXd& gains : explanation.gains)
    if (gains.size() > 0) return gains[0];
  return 1.0;
}

Parameter shared(const char* name, double value, double low, double high) {
  return {name, {{"", value}}, {{"", {std::min(low, high), std::max(low, high)}}}};
}

NetworkHypotheses::NetworkHypotheses(const ThermalPlant& plant, const ThermalRuns& runs,
                                     const StackedRows& rows)
    : material_{plant, runs, rows} {
  using Kind = NetworkSubjectKind;
  for (std::size_t i = 0; i < plant.parts.size(); ++i) add({Kind::part, i});
  for (std::size_t i = 0; i < plant.network.sources.size(); ++i) add({Kind::source, i});
  for (std::size_t place = 0; place < plant.places.size(); ++place)
    for (std::size_t signal = 0; signal < runs.signals.size(); ++signal)
      add({Kind::signal_at_place, place, signal});
  add({Kind::room});
  for (std::size_t i = 0; i < plant.parts.size(); ++i)
    if (plant.parts[i].kind == PartKind::room_film) add({Kind::air_of_part, i});
  for (std::size_t sensor = 0; sensor < plant.network.sensors.size(); ++sensor) {
    add({Kind::sensor, sensor});
    for (std::size_t run = 0; run < runs.runs.size(); ++run)
      add({Kind::sensor_in_run, sensor, run});
  }
  const NetworkSimulation unchanged(plant.network);
  bases_.push_back({unchanged, stacked(unchanged)});
}

void NetworkHypotheses::add(const NetworkSubject& subject) {
  for (const Cause& cause : all_causes()) {
    if (cause.in_network == nullptr) continue;
    for (NetworkHypothesis& each : cause.in_network(material_, subject)) {
      each.hypothesis.cause = cause.name;
      causes_.push_back(std::move(each));
    }
  }
}

std::vector<Hypothesis> NetworkHypotheses::all(const std::shared_ptr<NetworkHypotheses>& self) {
  std::vector<Hypothesis> all;
  for (std::size_t i = 0; i < self->causes_.size(); ++i) {
    all.push_back(self->causes_[i].hypothesis);
    all.back().columns = [self, i](const Shapes& shapes, std::size_t output) {
      Panel columns(self->material_.rows.time_s.size(), std::ssize(shapes));
      for (std::size_t shape = 0; shape < shapes.size(); ++shape)
        columns.col(static_cast<Eigen::Index>(shape)) = self->columns(i, shapes[shape], output);
      return columns;
    };
  }
  return all;
}

std::vector<Column> NetworkHypotheses::stacked(const NetworkSimulation& simulation) const {
  std::vector<Column> all(simulation.network().sensors.size(),
                          Column(material_.rows.time_s.size()));
  for (std::size_t run = 0; run < material_.runs.runs.size(); ++run) {
    const std::vector<Column> readings = simulation.readings_degC(material_.runs, run);
    const Block& block = material_.rows.runs[run];
    for (std::size_t sensor = 0; sensor < all.size(); ++sensor)
      all[sensor].segment(block.begin, block.end - block.begin) =
          readings[sensor].tail(block.end - block.begin);
  }
  return all;
}

Column NetworkHypotheses::columns(std::size_t cause, const Shape& shape, std::size_t output) {
  const NetworkHypothesis& of = causes_[cause];
  if (of.fault) return of.fault(shape);
  const auto place = std::find(accepted_.begin(), accepted_.end(), cause);
  const auto base = static_cast<std::size_t>(place - accepted_.begin());
  const auto same = [&](const Known& each) {
    return each.cause == cause && each.base == base && each.shape == shape;
  };
  auto known = std::find_if(known_.begin(), known_.end(), same);
  if (known == known_.end()) {
    HeatNetwork changed = bases_[base].simulation.network();
    of.apply(changed, shape, 1.0);
    std::vector<Column> readings = stacked(NetworkSimulation(changed, &bases_[base].simulation));
    for (std::size_t i = 0; i < readings.size(); ++i) readings[i] -= bases_[base].stacked[i];
    if (known_.size() >= columns_kept) known_.pop_back();
    known_.push_front({cause, base, shape, std::move(readings)});
    known = known_.begin();
  }
  return known->columns[output];
}

std::size_t NetworkHypotheses::cause_of(const Hypothesis& hypothesis) const {
  const auto at = std::find_if(causes_.begin(), causes_.end(), [&](const NetworkHypothesis& each) {
    return each.hypothesis.cause == hypothesis.cause &&
           each.hypothesis.subject == hypothesis.subject && each.hypothesis.run == hypothesis.run;
  });
  THERMOCOMP_ENSURE(at != causes_.end());
  return static_cast<std::size_t>(at - causes_.begin());
}

void NetworkHypotheses::accept(const std::vector<Explanation>& found) {
  known_.clear();
  accepted_.clear();
  bases_.erase(bases_.begin() + 1, bases_.end());
  for (const Explanation& each : found) {
    const std::size_t cause = cause_of(*each.hypothesis);
    if (!causes_[cause].apply) continue;
    HeatNetwork changed = bases_.back().simulation.network();
    causes_[cause].apply(changed, each.shape, gain_of(each));
    accepted_.push_back(cause);
    NetworkSimulation simulation(changed, &bases_.back().simulation);
    std::vector<Column> readings = stacked(simulation);
    bases_.push_back({std::move(simulation), std::move(readings)});
  }
}

void NetworkHypotheses::apply(const Finding& finding, HeatNetwork& network) const {
  const NetworkHypothesis& cause = causes_[cause_of(*finding.explanation.hypothesis)];
  if (cause.apply) cause.apply(network, finding.explanation.shape, gain_of(finding.explanation));
}

std::vector<Parameter> NetworkHypotheses::parameters_of(const Finding& finding) const {
  const NetworkHypothesis& cause = causes_[cause_of(*finding.explanation.hypothesis)];
  const Explanation& each = finding.explanation;
  std::vector<Parameter> parameters;
  const auto with_file_value = [&](double factor, double low, double high) {
    parameters.push_back(shared("factor", factor, low, high));
    if (cause.value != 0.0)
      parameters.push_back(
          shared(cause.key.c_str(), factor * cause.value, low * cause.value, high * cause.value));
  };
  for (std::size_t i = 0; i < each.shape.size(); ++i) {
    const ShapeParameter& of = each.hypothesis->shape[i];
    const double value = each.shape[i];
    const auto [low, high] = finding.shape_ci[i];
    if (of.discrete)
      parameters.push_back({of.name, {{"", value}}, {}});
    else if (of.name == "factor")
      with_file_value(value, low, high);
    else
      parameters.push_back(shared(of.name.c_str(), value, low, high));
  }
  if (each.hypothesis->gains.empty()) return parameters;
  const Gain gain = gain_of(finding);
  if (each.hypothesis->gains.front() == "factor")
    with_file_value(1.0 + gain.value, 1.0 + gain.ci95.low, 1.0 + gain.ci95.high);
  else
    parameters.push_back(
        shared(each.hypothesis->gains.front().c_str(), gain.value, gain.ci95.low, gain.ci95.high));
  if (cause.at > 0.0) parameters.push_back({"at", {{"", cause.at}}, {}});
  return parameters;
}

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
                           const std::vector<RunFile>& test, ReportData* report,
                           const std::function<void()>& progress, const NetworkView& view) {
  std::vector<RunFile> all = train;
  all.insert(all.end(), test.begin(), test.end());
  const std::vector<std::string> signals = shared_signals(all);
  const ThermalRuns train_runs = thermal_runs(plant, train, signals);
  const ThermalRuns test_runs = thermal_runs(plant, test, signals);
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
