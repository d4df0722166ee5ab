#include "modelling/diagnosis/network/heat_network.hpp"

#include <algorithm>

#include "config/text/problems.hpp"
#include "simulator/files/machine_file.hpp"

namespace thermocomp::diagnosis {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

Vector unit(Eigen::Index states, std::size_t at) {
  return Vector::Unit(states, static_cast<Eigen::Index>(at));
}

std::string pair_name(const std::string& a, const std::string& b) {
  return std::min(a, b) + "|" + std::max(a, b);
}

Vector vector_of(const std::vector<double>& values) {
  return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// @param values  row by row; symmetric, so that the order does not matter
Matrix square_of(const std::vector<double>& values, std::size_t states) {
  const auto n = static_cast<Eigen::Index>(states);
  return Eigen::Map<const Matrix>(values.data(), n, n);
}

void add_films(const NodeConfig& node, const Vector& at, ThermalPlant& plant) {
  const Matrix own = at * at.transpose();
  plant.parts.push_back({PartKind::capacity, node.name, node.capacity_J_per_K * own, Vector(),
                         "capacity_J_per_K", node.capacity_J_per_K});
  if (node.room_W_per_K > 0.0)
    plant.parts.push_back({PartKind::room_film, node.name + "|room", node.room_W_per_K * own,
                           node.room_W_per_K * at, "room_W_per_K", node.room_W_per_K});
  if (node.coolant_W_per_K > 0.0 && plant.coolant_signal)
    plant.parts.push_back({PartKind::coolant_film, node.name + "|coolant",
                           node.coolant_W_per_K * own, node.coolant_W_per_K * at, "coolant_W_per_K",
                           node.coolant_W_per_K});
}

void add_lumps(const PlantConfig& config, ThermalPlant& plant) {
  const auto states = static_cast<Eigen::Index>(config.nodes.size());
  for (std::size_t i = 0; i < config.nodes.size(); ++i) {
    add_films(config.nodes[i], unit(states, i), plant);
    plant.places.push_back({config.nodes[i].name, unit(states, i)});
  }
  for (const LinkConfig& link : config.links) {
    const Vector between = unit(states, link.first) - unit(states, link.second);
    plant.parts.push_back({PartKind::joint,
                           pair_name(config.nodes[link.first].name, config.nodes[link.second].name),
                           link.conductance_W_per_K * between * between.transpose(), Vector(),
                           "conductance_W_per_K", link.conductance_W_per_K});
  }
  HeatNetwork& network = plant.network;
  network.capacity = network.conductance = network.coolant_conductance =
      Matrix::Zero(states, states);
  network.room_inflow = network.coolant_inflow = Vector::Zero(states);
  for (const NetworkPart& part : plant.parts) {
    (part.kind == PartKind::capacity       ? network.capacity
     : part.kind == PartKind::coolant_film ? network.coolant_conductance
                                           : network.conductance) += part.matrix;
    if (part.kind == PartKind::room_film) network.room_inflow += part.inflow;
    if (part.kind == PartKind::coolant_film) network.coolant_inflow += part.inflow;
  }
  for (const HeatSourceConfig& source : config.sources) {
    const std::string& signal = config.signals[source.signal].name;
    network.sources.push_back(
        {signal, source.heat_W, source.at, source.exponent, unit(states, source.node)});
    plant.source_names.push_back(signal + "|" + config.nodes[source.node].name);
  }
}

PartKind kind_of(BodyPartKind kind) {
  switch (kind) {
    case BodyPartKind::room_film:
      return PartKind::room_film;
    case BodyPartKind::coolant_film:
      return PartKind::coolant_film;
    case BodyPartKind::joint:
      return PartKind::joint;
    case BodyPartKind::capacity:
      break;
  }
  return PartKind::capacity;
}

/// Adds the films, joints and capacities that the body's file distinguishes; the coolant's whole
/// film if it distinguishes none.
void add_body_parts(const ReducedBody& body, ThermalPlant& plant) {
  for (const BodyPart& part : body.parts) {
    if (part.kind == BodyPartKind::coolant_film && !plant.coolant_signal) continue;
    plant.parts.push_back({kind_of(part.kind),
                           part.name,
                           square_of(part.matrix, body.states()),
                           vector_of(part.inflow),
                           "",
                           {}});
  }
  if (body.parts.empty() && plant.coolant_signal &&
      plant.network.coolant_inflow.squaredNorm() > 0.0)
    plant.parts.push_back({PartKind::coolant_film,
                           "coolant",
                           plant.network.coolant_conductance,
                           plant.network.coolant_inflow,
                           "",
                           {}});
}

void add_body(const PlantConfig& config, ThermalPlant& plant) {
  const ReducedBody& body = *config.body;
  const auto states = static_cast<Eigen::Index>(body.states());
  HeatNetwork& network = plant.network;
  network.capacity = Matrix::Identity(states, states);
  network.conductance = square_of(body.conductance, body.states());
  network.coolant_conductance = square_of(body.coolant_conductance, body.states());
  network.room_inflow = vector_of(body.room_inflow);
  network.coolant_inflow = vector_of(body.coolant_inflow);
  for (const BodySource& source : body.sources) {
    network.sources.push_back({source.signal.value_or(""), source.heat_W, source.at,
                               source.exponent, vector_of(source.inflow)});
    plant.source_names.push_back(source.name);
  }
  add_body_parts(body, plant);
  // Heat at a sensor's point enters the states by that sensor's row, since the fields are
  // orthonormal in the heat capacity.
  for (const BodyRow& sensor : body.sensors)
    plant.places.push_back({sensor.name, vector_of(sensor.row)});
}

void add_thermocouples(const PlantConfig& config, ThermalPlant& plant) {
  const auto states = plant.network.capacity.rows();
  for (const ThermocoupleConfig& thermocouple : config.thermocouples) {
    const std::string column = thermocouple.name + "_degC";
    switch (thermocouple.place) {
      case ThermocoupleConfig::Place::room:
        if (plant.room_column.empty()) plant.room_column = column;
        break;
      case ThermocoupleConfig::Place::coolant:
        plant.coolant_column = column;
        break;
      case ThermocoupleConfig::Place::node:
        plant.network.sensors.push_back(
            {column,
             config.body ? vector_of(config.body->sensors.at(thermocouple.node).row).transpose()
                         : unit(states, thermocouple.node).transpose(),
             thermocouple.lag_s});
        break;
    }
  }
}

/// True for equal sources and sensors, and equal rates (sorted) within the digits of a file.
bool same_structure(const ReducedBody& a, const ReducedBody& b) {
  constexpr double digits = 1e-4;
  const auto same_names = [](const auto& rows, const auto& others) {
    return std::equal(rows.begin(), rows.end(), others.begin(), others.end(),
                      [](const auto& row, const auto& other) { return row.name == other.name; });
  };
  if (a.states() != b.states() || !same_names(a.sources, b.sources) ||
      !same_names(a.sensors, b.sensors))
    return false;
  const Vector rates = square_of(a.conductance, a.states()).diagonal();
  return rates.isApprox(square_of(b.conductance, b.states()).diagonal(), digits);
}

}  // namespace

ThermalPlant load_thermal_plant(const std::filesystem::path& path, const ReducedBody* body) {
  MachineConfig machine = load_machine(path);
  const auto refuse = [&](const char* key, const char* rule) {
    throw ConfigurationError({{path.string(), 0, key, "(missing)", rule}});
  };
  if (!machine.plant) refuse("plant", "the thermal network of a machine stands in its [plant]");
  PlantConfig& config = *machine.plant;
  if (body != nullptr) {
    if (!config.body || !same_structure(*config.body, *body))
      refuse("body", "must be what `thermocomp structure --plant` makes of the --structure given");
    config.body = *body;
  }
  ThermalPlant plant;
  plant.coolant_degC = config.coolant.temp_degC;
  plant.coolant_room_share = config.coolant.room_share;
  plant.room_mean_degC = config.room.mean_degC;
  if (config.coolant.signal) plant.coolant_signal = config.signals[*config.coolant.signal].name;
  if (config.body)
    add_body(config, plant);
  else
    add_lumps(config, plant);
  add_thermocouples(config, plant);
  if (plant.room_column.empty())
    refuse("thermocouple",
           "one must have node = \"room\": heat flows to the air that was measured");
  if (plant.network.sensors.empty()) refuse("thermocouple", "one must be on the machine");
  if (!(plant.network.room_inflow.cwiseAbs().maxCoeff() > 0.0))
    refuse("room_W_per_K", "some heat must be able to leave to the room");
  return plant;
}

}  // namespace thermocomp::diagnosis
