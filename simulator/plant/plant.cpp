#include "simulator/plant/plant.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "estimator/checks.hpp"
#include "simulator/plant/influences.hpp"
#include "simulator/plant/seeded_noise.hpp"
#include "simulator/plant/thermal_network.hpp"

namespace thermocomp {
namespace {

constexpr std::uint64_t thermocouple_stream = 0x10000;
constexpr std::uint64_t signal_stream = 0x20000;

ThermalNetwork make_network(const ReducedBody& body, bool coolant_flows) {
  std::vector<double> conductance = body.conductance;
  for (std::size_t i = 0; coolant_flows && i < conductance.size(); ++i) {
    conductance[i] += body.coolant_conductance[i];
  }
  return ThermalNetwork(std::vector<double>(body.states(), 1.0), conductance);
}

ThermalNetwork make_network(const PlantConfig& config, bool coolant_flows) {
  if (config.body) return make_network(*config.body, coolant_flows);
  const std::size_t n = config.nodes.size();
  std::vector<double> capacity(n);
  std::vector<double> conductance(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    const NodeConfig& node = config.nodes[i];
    capacity[i] = node.capacity_J_per_K;
    conductance[i * n + i] = node.room_W_per_K + (coolant_flows ? node.coolant_W_per_K : 0.0);
  }
  for (const LinkConfig& link : config.links) {
    THERMOCOMP_ENSURE(link.first < n && link.second < n && link.first != link.second);
    conductance[link.first * n + link.first] += link.conductance_W_per_K;
    conductance[link.second * n + link.second] += link.conductance_W_per_K;
    conductance[link.first * n + link.second] -= link.conductance_W_per_K;
    conductance[link.second * n + link.first] -= link.conductance_W_per_K;
  }
  return ThermalNetwork(capacity, conductance);
}

std::vector<double> start_state(const PlantConfig& config, double room_degC) {
  if (!config.body) return std::vector<double>(config.nodes.size(), room_degC);
  std::vector<double> state = config.body->one_degC;
  for (double& value : state) value *= room_degC;
  return state;
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

void add_scaled(double factor, const std::vector<double>& values, std::vector<double>& sum) {
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += factor * values[i];
}

}  // namespace

/// The state advances on a grid of steps. Values between grid points are computed from the last
/// grid point, so that reading them changes nothing.
struct Plant::Parts {
  PlantConfig config;
  std::uint64_t seed;
  RoomAir room;
  std::vector<OperatingSignal> generators;
  ThermalNetwork dry;
  ThermalNetwork flooded;
  std::vector<double> start_degC;  ///< by lump, or the body's states
  std::uint64_t grid_index{0};
  std::vector<double> grid_degC;         ///< lumps at the grid point
  std::vector<double> grid_lagged_degC;  ///< thermocouples before noise at the grid point
  std::vector<double> inflow_W;          ///< heat, room and coolant over the present step
  std::vector<double> sources_W;         ///< share of the sources
  bool coolant_flows{false};
  double room_degC{0.0};
  double coolant_degC{0.0};
  double time_s{0.0};  ///< time of the values below
  std::vector<double> signals;
  std::vector<double> now_degC;
  std::vector<double> now_lagged_degC;

  Parts(const PlantConfig& plant, std::uint64_t with_seed)
      : config(plant),
        seed(with_seed),
        room(plant.room, with_seed),
        dry(make_network(plant, false)),
        flooded(make_network(plant, true)),
        start_degC(start_state(plant, room.temp_degC(0.0))),
        grid_degC(start_degC),
        inflow_W(start_degC.size(), 0.0),
        sources_W(plant.nodes.size(), 0.0),
        signals(plant.signals.size(), 0.0),
        now_degC(start_degC) {
    for (std::size_t i = 0; i < plant.signals.size(); ++i) {
      generators.emplace_back(plant.signals[i], seed, signal_stream + i);
    }
    take_inputs();
    for (std::size_t i = 0; i < plant.thermocouples.size(); ++i) {
      grid_lagged_degC.push_back(place_degC(i, grid_degC));
    }
    now_lagged_degC = grid_lagged_degC;
  }

  [[nodiscard]] double grid_time_s() const {
    return static_cast<double>(grid_index) * config.step_s;
  }

  void evaluate_signals(double at_s) {
    for (std::size_t i = 0; i < generators.size(); ++i) {
      const bool watches = config.signals[i].kind == SignalKind::while_above;
      THERMOCOMP_ENSURE(!watches || config.signals[i].watched < i);
      signals[i] = generators[i].value(at_s, watches ? signals[config.signals[i].watched] : 0.0);
    }
  }

  void take_inputs() {
    evaluate_signals(grid_time_s());
    room_degC = room.temp_degC(grid_time_s());
    coolant_degC =
        config.coolant.temp_degC + config.coolant.room_share * (room_degC - config.room.mean_degC);
    if (config.coolant.temp_signal) coolant_degC = signals[*config.coolant.temp_signal];
    coolant_flows = config.coolant.signal && signals[*config.coolant.signal] != 0.0;
    if (config.body) {
      take_body_inputs(*config.body);
      return;
    }
    std::fill(sources_W.begin(), sources_W.end(), 0.0);
    for (const HeatSourceConfig& source : config.sources) {
      THERMOCOMP_ENSURE(source.node < sources_W.size() && source.signal < signals.size());
      sources_W[source.node] +=
          source.heat_W * std::pow(std::abs(signals[source.signal]) / source.at, source.exponent);
    }
    for (std::size_t i = 0; i < config.nodes.size(); ++i) {
      const NodeConfig& node = config.nodes[i];
      inflow_W[i] = sources_W[i] + node.room_W_per_K * room_degC +
                    (coolant_flows ? node.coolant_W_per_K * coolant_degC : 0.0);
    }
  }

  void take_body_inputs(const ReducedBody& body) {
    std::fill(inflow_W.begin(), inflow_W.end(), 0.0);
    add_scaled(room_degC, body.room_inflow, inflow_W);
    if (coolant_flows) add_scaled(coolant_degC, body.coolant_inflow, inflow_W);
    for (std::size_t i = 0; i < body.sources.size(); ++i) {
      const BodySource& source = body.sources[i];
      double share = 1.0;
      if (source.signal) {
        THERMOCOMP_ENSURE(config.body_signals.at(i) < signals.size());
        share = std::pow(std::abs(signals[config.body_signals[i]]) / source.at, source.exponent);
      }
      add_scaled(share * source.heat_W, source.inflow, inflow_W);
    }
  }

  [[nodiscard]] double place_degC(std::size_t index, const std::vector<double>& nodes) const {
    const ThermocoupleConfig& thermocouple = config.thermocouples[index];
    switch (thermocouple.place) {
      case ThermocoupleConfig::Place::room:
        return room_degC;
      case ThermocoupleConfig::Place::coolant:
        return coolant_degC;
      case ThermocoupleConfig::Place::node:
        break;
    }
    if (config.body) return dot(config.body->sensors.at(thermocouple.node).row, nodes);
    THERMOCOMP_ENSURE(thermocouple.node < nodes.size());
    return nodes[thermocouple.node];
  }

  /// Computes `nodes` and `lagged` at `dt_s` after the grid point.
  void look_ahead(double dt_s, std::vector<double>& nodes, std::vector<double>& lagged) const {
    nodes = grid_degC;
    if (dt_s == 0.0) {
      lagged = grid_lagged_degC;
      return;
    }
    (coolant_flows ? flooded : dry).advance(dt_s, inflow_W, nodes);
    for (std::size_t i = 0; i < lagged.size(); ++i) {
      const double lag_s = config.thermocouples[i].lag_s;
      const double end = place_degC(i, nodes);
      // Lag behind the mean of both ends: second-order accurate for a step << lag.
      const double mean = 0.5 * (place_degC(i, grid_degC) + end);
      lagged[i] = lag_s > 0.0 ? grid_lagged_degC[i] -
                                    std::expm1(-dt_s / lag_s) * (mean - grid_lagged_degC[i])
                              : end;
    }
  }

  [[nodiscard]] double rise(const std::vector<double>& row) const {
    return dot(row, now_degC) - dot(row, start_degC);
  }

  /// @return contribution of the guideway at this position, constant beyond its ends [um]
  [[nodiscard]] double along(const BodyGuideway& guideway, double position_mm) const {
    const std::vector<double>& at = guideway.positions_mm;
    const auto above = std::upper_bound(at.begin(), at.end(), position_mm);
    if (above == at.begin()) return rise(guideway.rows.front());
    if (above == at.end()) return rise(guideway.rows.back());
    const auto next = static_cast<std::size_t>(above - at.begin());
    const double share = (position_mm - at[next - 1]) / (at[next] - at[next - 1]);
    return (1.0 - share) * rise(guideway.rows[next - 1]) + share * rise(guideway.rows[next]);
  }

  void grid_step() {
    std::vector<double>& nodes = now_degC;
    look_ahead(config.step_s, nodes, now_lagged_degC);
    grid_degC = nodes;
    grid_lagged_degC = now_lagged_degC;
    ++grid_index;
    room.step(config.step_s);
    take_inputs();
  }
};

Plant::Plant(const PlantConfig& config, std::uint64_t seed)
    : parts_(std::make_unique<Parts>(config, seed)) {}
Plant::~Plant() = default;
Plant::Plant(Plant&&) noexcept = default;
Plant& Plant::operator=(Plant&&) noexcept = default;

void Plant::advance_to(double time_s) {
  THERMOCOMP_ENSURE(time_s >= parts_->time_s);
  const auto target = static_cast<std::uint64_t>(time_s / parts_->config.step_s);
  while (parts_->grid_index < target) parts_->grid_step();
  parts_->time_s = time_s;
  parts_->look_ahead(std::max(0.0, time_s - parts_->grid_time_s()), parts_->now_degC,
                     parts_->now_lagged_degC);
  parts_->evaluate_signals(time_s);
}

double Plant::time_s() const noexcept {
  return parts_->time_s;
}
double Plant::node_degC(std::size_t node) const {
  THERMOCOMP_ENSURE(!parts_->config.body);
  return parts_->now_degC.at(node);
}
double Plant::room_degC() const noexcept {
  return parts_->room_degC;
}
double Plant::signal(std::size_t signal) const {
  return parts_->signals.at(signal);
}
double Plant::heat_W(std::size_t node) const {
  return parts_->sources_W.at(node);
}

double Plant::thermocouple_degC(std::size_t thermocouple) const {
  const ThermocoupleConfig& config = parts_->config.thermocouples.at(thermocouple);
  const auto conversion = static_cast<std::uint64_t>(parts_->time_s / config.conversion_s);
  const double value =
      parts_->now_lagged_degC[thermocouple] + config.offset_K +
      config.noise_K * seeded_normal(parts_->seed, thermocouple_stream + thermocouple, conversion);
  return config.resolution_K > 0.0 ? std::round(value / config.resolution_K) * config.resolution_K
                                   : value;
}

double Plant::displacement_um(std::size_t output) const {
  const PlantConfig& config = parts_->config;
  if (config.body) {
    const BodyRow& own = config.body->outputs.at(config.body_outputs.at(output));
    double sum = parts_->rise(own.row);
    for (std::size_t i = 0; i < config.body->guideways.size(); ++i) {
      const BodyGuideway& guideway = config.body->guideways[i];
      if (guideway.output != own.name) continue;
      sum += parts_->along(guideway, parts_->signals.at(config.body_axes.at(i)));
    }
    return sum;
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < config.nodes.size(); ++i) {
    const auto& coefficients = config.nodes[i].displacement_um_per_K;
    const auto found = coefficients.find(config.outputs.at(output).name);
    if (found == coefficients.end()) continue;
    sum += found->second * (parts_->now_degC[i] - parts_->start_degC[i]);
  }
  for (const PositionEffectConfig& effect : config.position_effects) {
    if (effect.output != output) continue;
    const double rise = parts_->now_degC.at(effect.node) - parts_->start_degC.at(effect.node);
    sum += effect.um_per_K_per_m * rise * (parts_->signals.at(effect.signal) - effect.centre_mm) /
           1000.0;
  }
  return sum;
}

std::vector<std::string> Plant::columns() const {
  std::vector<std::string> names;
  for (const SignalConfig& signal : parts_->config.signals) names.push_back(signal.name);
  for (const ThermocoupleConfig& thermocouple : parts_->config.thermocouples) {
    names.push_back(thermocouple.name + "_degC");
  }
  for (const OutputConfig& output : parts_->config.outputs) names.push_back(output.name);
  return names;
}

void Plant::row(std::span<double> values) const {
  const PlantConfig& config = parts_->config;
  THERMOCOMP_ENSURE(values.size() ==
                    config.signals.size() + config.thermocouples.size() + config.outputs.size());
  std::size_t next = 0;
  for (const double signal : parts_->signals) values[next++] = signal;
  for (std::size_t i = 0; i < config.thermocouples.size(); ++i) {
    values[next++] = thermocouple_degC(i);
  }
  for (std::size_t i = 0; i < config.outputs.size(); ++i) values[next++] = displacement_um(i);
}

std::vector<std::vector<double>> block_matrix(const PlantConfig& config,
                                              const std::vector<std::string>& blocks) {
  std::vector<std::vector<double>> matrix(config.outputs.size(),
                                          std::vector<double>(blocks.size(), 0.0));
  for (const NodeConfig& node : config.nodes) {
    const auto block = std::find(blocks.begin(), blocks.end(), node.block);
    if (block == blocks.end()) continue;
    const auto column = static_cast<std::size_t>(block - blocks.begin());
    for (std::size_t row = 0; row < config.outputs.size(); ++row) {
      const auto found = node.displacement_um_per_K.find(config.outputs[row].name);
      if (found != node.displacement_um_per_K.end()) matrix[row][column] += found->second;
    }
  }
  return matrix;
}

}  // namespace thermocomp
