#include "modelling/diagnosis/thermal/network_hypotheses.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double normal_95 = 1.96;
constexpr std::size_t columns_kept = 24;
/// A strength is sought between these shares of what the file says. None is 1.
constexpr double factor_min = 0.15;
constexpr double factor_max = 7.0;
constexpr std::size_t factors = 14;
constexpr double source_factor_max = 10.0;
constexpr double offset_K_max = 20.0;
constexpr std::size_t onsets = 48;
constexpr std::size_t lags = 12;
constexpr double lag_s_max = 3600.0;

std::vector<double> geometric(double low, double high, std::size_t count) {
  std::vector<double> grid;
  for (std::size_t i = 0; i < count; ++i)
    grid.push_back(low *
                   std::pow(high / low, static_cast<double>(i) / static_cast<double>(count - 1)));
  return grid;
}

const char* name_of(PartKind kind) {
  switch (kind) {
    case PartKind::room_film:
    case PartKind::coolant_film:
      return "wrong_film_coefficient";
    case PartKind::joint:
      return "wrong_conductance";
    case PartKind::capacity:
      break;
  }
  return "wrong_heat_capacity";
}

void scale(HeatNetwork& network, const NetworkPart& part, double factor) {
  const double more = factor - 1.0;
  switch (part.kind) {
    case PartKind::room_film:
      network.conductance += more * part.matrix;
      network.room_inflow += more * part.inflow;
      break;
    case PartKind::coolant_film:
      network.coolant_conductance += more * part.matrix;
      network.coolant_inflow += more * part.inflow;
      break;
    case PartKind::joint:
      network.conductance += more * part.matrix;
      break;
    case PartKind::capacity:
      network.capacity += more * part.matrix;
      break;
  }
}

/// The shared gain and its spread: what each output knows of it, taken together.
struct Gain {
  double value{0.0};
  double sd{0.0};
};

Gain gain_of(const Finding& finding) {
  Gain gain;
  double weight = 0.0;
  for (std::size_t output = 0; output < finding.explanation.gains.size(); ++output) {
    const Eigen::VectorXd& gains = finding.explanation.gains[output];
    if (gains.size() == 0) continue;
    gain.value = gains[0];
    if (output < finding.gain_sd.size() && finding.gain_sd[output].size() > 0)
      weight += 1.0 / std::pow(finding.gain_sd[output][0], 2);
  }
  gain.sd = weight > 0 ? 1.0 / std::sqrt(weight) : 0.0;
  return gain;
}

Parameter shared(const char* name, double value, double low, double high) {
  return {name, {{"", value}}, {{"", {std::min(low, high), std::max(low, high)}}}};
}

}  // namespace

NetworkHypotheses::NetworkHypotheses(const ThermalPlant& plant, const ThermalRuns& runs,
                                     const StackedRows& rows)
    : plant_(plant), runs_(runs), rows_(rows) {
  for (const NetworkPart& part : plant.parts) add_part(part);
  for (std::size_t i = 0; i < plant.network.sources.size(); ++i) add_source(i);
  for (const NetworkPlace& place : plant.places)
    for (std::size_t signal = 0; signal < runs.signals.size(); ++signal) add_missing(place, signal);
  add_ambient("room", plant.network.room_inflow);
  for (const NetworkPart& part : plant.parts)
    if (part.kind == PartKind::room_film) add_ambient(part.subject, part.inflow);
  for (std::size_t sensor = 0; sensor < plant.network.sensors.size(); ++sensor) {
    add_slow_sensor(sensor);
    for (std::size_t run = 0; run < runs.runs.size(); ++run) add_faults(run, sensor);
  }
  const NetworkSimulation unchanged(plant.network);
  bases_.push_back({unchanged, stacked(unchanged)});
}

void NetworkHypotheses::add_part(const NetworkPart& part) {
  Cause cause;
  cause.hypothesis.cause = name_of(part.kind);
  cause.hypothesis.subject = part.subject;
  cause.hypothesis.form = Form::no_gain;
  cause.hypothesis.shape = {{"factor", geometric(factor_min, factor_max, factors), true, false}};
  cause.apply = [&part](HeatNetwork& network, const Shape& shape, double gain) {
    scale(network, part, 1.0 + gain * (shape[0] - 1.0));
  };
  cause.value = part.value.value_or(0.0);
  cause.key = part.key;
  causes_.push_back(std::move(cause));
}

void NetworkHypotheses::add_source(std::size_t source) {
  const NetworkSource& of = plant_.network.sources[source];
  if (of.heat_W == 0.0) return;
  Cause cause;
  cause.hypothesis.cause = "wrong_heat_source";
  cause.hypothesis.subject = plant_.source_names[source];
  cause.hypothesis.form = Form::shared_gain;
  cause.hypothesis.gains = {"factor"};
  cause.hypothesis.possible = [](double gain, std::size_t) {
    return gain >= -1.0 && gain <= source_factor_max - 1.0;
  };
  cause.apply = [source](HeatNetwork& network, const Shape&, double gain) {
    network.sources[source].heat_W *= 1.0 + gain;
  };
  cause.value = of.heat_W;
  cause.key = "heat_W";
  causes_.push_back(std::move(cause));
}

double NetworkHypotheses::largest(std::size_t signal) const {
  double most = 0.0;
  for (const ThermalRun& run : runs_.runs)
    most = std::max(most, run.signals[signal].cwiseAbs().maxCoeff());
  return most;
}

void NetworkHypotheses::add_missing(const NetworkPlace& place, std::size_t signal) {
  const std::string subject = runs_.signals[signal] + "|" + place.name;
  const double at = largest(signal);
  const auto& known = plant_.source_names;
  const bool moves = std::any_of(runs_.runs.begin(), runs_.runs.end(), [&](const ThermalRun& run) {
    return run.signals[signal].maxCoeff() > run.signals[signal].minCoeff();
  });
  if (!moves || std::find(known.begin(), known.end(), subject) != known.end()) return;
  Cause cause;
  cause.hypothesis.cause = "missing_heat_source";
  cause.hypothesis.subject = subject;
  cause.hypothesis.form = Form::shared_gain;
  cause.hypothesis.gains = {"heat_W"};
  cause.hypothesis.shape = {{"power", {1.0, 2.0}, false, true}};
  cause.hypothesis.possible = [](double gain, std::size_t) { return gain > 0.0; };
  cause.apply = [&place, at, name = runs_.signals[signal]](HeatNetwork& network, const Shape& shape,
                                                           double gain) {
    network.sources.push_back({name, gain, at, shape[0], place.inflow});
  };
  cause.at = at;
  causes_.push_back(std::move(cause));
}

void NetworkHypotheses::add_ambient(const std::string& subject, const Eigen::VectorXd& inflow) {
  Cause cause;
  cause.hypothesis.cause = "wrong_ambient";
  cause.hypothesis.subject = subject;
  cause.hypothesis.form = Form::shared_gain;
  cause.hypothesis.gains = {"offset_K"};
  cause.hypothesis.possible = [](double gain, std::size_t) {
    return std::abs(gain) <= offset_K_max;
  };
  // Air that is warmer by so much brings in a constant heat.
  cause.apply = [inflow](HeatNetwork& network, const Shape&, double gain) {
    network.sources.push_back({"", gain, 1.0, 1.0, inflow});
  };
  causes_.push_back(std::move(cause));
}

void NetworkHypotheses::add_slow_sensor(std::size_t sensor) {
  Cause cause;
  cause.hypothesis.cause = "slow_sensor";
  cause.hypothesis.subject = plant_.network.sensors[sensor].column;
  cause.hypothesis.form = Form::no_gain;
  cause.hypothesis.shape = {{"tau_s", geometric(30.0, lag_s_max, lags), true, false}};
  cause.hypothesis.output = sensor;
  cause.apply = [sensor](HeatNetwork& network, const Shape& shape, double gain) {
    network.sensors[sensor].lag_s += gain * shape[0];
  };
  causes_.push_back(std::move(cause));
}

void NetworkHypotheses::add_faults(std::size_t run, std::size_t sensor) {
  const Block& block = rows_.runs[run];
  const double first_s = rows_.time_s[block.begin];
  const double length_s = rows_.time_s[block.end - 1] - first_s;
  const auto in_run = [this, block](const auto& value) {
    Column column = Column::Zero(rows_.time_s.size());
    for (Eigen::Index row = block.begin; row < block.end; ++row)
      column[row] = value(rows_.time_s[row]);
    return column;
  };
  Cause step;
  step.hypothesis.cause = "sensor_step";
  step.hypothesis.subject = plant_.network.sensors[sensor].column;
  step.hypothesis.gains = {"step_K"};
  step.hypothesis.output = sensor;
  step.hypothesis.run = run;
  Cause drift = step;
  ShapeParameter at{"at_s", {}, false, false};
  for (std::size_t i = 1; i <= onsets; ++i)
    at.grid.push_back(first_s +
                      length_s * static_cast<double>(i) / static_cast<double>(onsets + 1));
  step.hypothesis.shape = {at};
  step.fault = [in_run](const Shape& shape) {
    return in_run([&](double time_s) { return time_s >= shape[0] ? 1.0 : 0.0; });
  };
  drift.hypothesis.cause = "sensor_drift";
  drift.hypothesis.gains = {"rate_K_per_h"};
  drift.fault = [in_run, first_s](const Shape&) {
    return in_run([&](double time_s) { return (time_s - first_s) / 3600.0; });
  };
  causes_.push_back(std::move(step));
  causes_.push_back(std::move(drift));
}

std::vector<Hypothesis> NetworkHypotheses::all(const std::shared_ptr<NetworkHypotheses>& self) {
  std::vector<Hypothesis> all;
  for (std::size_t i = 0; i < self->causes_.size(); ++i) {
    all.push_back(self->causes_[i].hypothesis);
    all.back().rows = self->rows_.time_s.size();
    all.back().write_columns = one_by_one([self, i](const Shape& shape, std::size_t output) {
      return self->columns(i, shape, output);
    });
  }
  return all;
}

std::vector<Column> NetworkHypotheses::stacked(const NetworkSimulation& simulation) const {
  std::vector<Column> all(simulation.network().sensors.size(), Column(rows_.time_s.size()));
  for (std::size_t run = 0; run < runs_.runs.size(); ++run) {
    const std::vector<Column> readings = simulation.readings_degC(runs_, run);
    const Block& block = rows_.runs[run];
    for (std::size_t sensor = 0; sensor < all.size(); ++sensor)
      all[sensor].segment(block.begin, block.end - block.begin) =
          readings[sensor].tail(block.end - block.begin);
  }
  return all;
}

Eigen::MatrixXd NetworkHypotheses::columns(std::size_t cause, const Shape& shape,
                                           std::size_t output) {
  const Cause& of = causes_[cause];
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
  const auto at = std::find_if(causes_.begin(), causes_.end(), [&](const Cause& each) {
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
    causes_[cause].apply(changed, each.shape, gain_of({each, {}, {}, {}}).value);
    accepted_.push_back(cause);
    NetworkSimulation simulation(changed, &bases_.back().simulation);
    std::vector<Column> readings = stacked(simulation);
    bases_.push_back({std::move(simulation), std::move(readings)});
  }
}

void NetworkHypotheses::apply(const Finding& finding, HeatNetwork& network) const {
  const Cause& cause = causes_[cause_of(*finding.explanation.hypothesis)];
  if (cause.apply) cause.apply(network, finding.explanation.shape, gain_of(finding).value);
}

std::vector<Parameter> NetworkHypotheses::parameters_of(const Finding& finding) const {
  const Cause& cause = causes_[cause_of(*finding.explanation.hypothesis)];
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
    const double sd = i < finding.shape_sd.size() ? finding.shape_sd[i] : 0.0;
    const double value = each.shape[i];
    const double low = of.logarithmic ? value * std::exp(-normal_95 * sd) : value - normal_95 * sd;
    const double high = of.logarithmic ? value * std::exp(normal_95 * sd) : value + normal_95 * sd;
    if (of.discrete)
      parameters.push_back({of.name, {{"", value}}, {}});
    else if (of.name == "factor")
      with_file_value(value, low, high);
    else
      parameters.push_back(shared(of.name.c_str(), value, low, high));
  }
  if (each.hypothesis->gains.empty()) return parameters;
  const Gain gain = gain_of(finding);
  const double reach = normal_95 * gain.sd;
  if (each.hypothesis->gains.front() == "factor")
    with_file_value(1.0 + gain.value, 1.0 + gain.value - reach, 1.0 + gain.value + reach);
  else
    parameters.push_back(shared(each.hypothesis->gains.front().c_str(), gain.value,
                                gain.value - reach, gain.value + reach));
  if (cause.at > 0.0) parameters.push_back({"at", {{"", cause.at}}, {}});
  return parameters;
}

}  // namespace thermocomp::diagnosis
