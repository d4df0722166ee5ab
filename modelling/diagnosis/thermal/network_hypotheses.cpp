#include "modelling/diagnosis/thermal/network_hypotheses.hpp"

#include <algorithm>

#include "estimator/checks.hpp"
#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

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

}  // namespace

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

}  // namespace thermocomp::diagnosis
