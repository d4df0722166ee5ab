/// Heat flow through a machine as a state space with parts that can be changed one by one.
///
///   C dx/dt = -(K + K_coolant while it flows) x + q_room T_room + q_coolant T_coolant
///             + sum over the sources of heat_W (|signal| / at)^exponent b
///
/// x are the temperatures of lumps, or the amplitudes of a reduced finite-element model.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace thermocomp {
struct ReducedBody;
}

namespace thermocomp::diagnosis {

struct NetworkSource {
  std::string signal;  ///< column of a run file; empty: constant
  double heat_W{0.0};
  double at{1.0};
  double exponent{1.0};
  Eigen::VectorXd inflow;  ///< b: flow into each state per W
};

struct NetworkSensor {
  std::string column;
  Eigen::RowVectorXd row;  ///< reading = row . x, then a first-order lag
  double lag_s{0.0};
};

struct HeatNetwork {
  Eigen::MatrixXd capacity;             ///< C [J/K], symmetric, positive definite
  Eigen::MatrixXd conductance;          ///< K [W/K], symmetric
  Eigen::MatrixXd coolant_conductance;  ///< added while the coolant flows
  Eigen::VectorXd room_inflow;          ///< W per degC of the room's air
  Eigen::VectorXd coolant_inflow;
  std::vector<NetworkSource> sources;
  std::vector<NetworkSensor> sensors;
};

enum class PartKind { room_film, coolant_film, joint, capacity };

/// A part of the network whose strength may be wrong: its share of the matrices.
struct NetworkPart {
  PartKind kind{PartKind::joint};
  std::string subject;          ///< name in an answer
  Eigen::MatrixXd matrix;       ///< in K, K_coolant or C
  Eigen::VectorXd inflow;       ///< of a film: in q_room or q_coolant; else empty
  std::string key;              ///< key in the machine file
  std::optional<double> value;  ///< value of that key, if it is one number
};

/// A place for a heat source that the model lacks.
struct NetworkPlace {
  std::string name;
  Eigen::VectorXd inflow;
};

/// The thermal part of a machine file.
struct ThermalPlant {
  HeatNetwork network;
  std::vector<NetworkPart> parts;
  std::vector<NetworkPlace> places;
  std::vector<std::string> source_names;  ///< one SIGNAL|NODE, or source of the body, per source
  std::string room_column;
  std::optional<std::string> coolant_column;  ///< none: computed from the room by the next three
  double coolant_degC{20.0};
  double coolant_room_share{0.0};
  double room_mean_degC{21.0};
  std::optional<std::string> coolant_signal;
};

/// @param path  a machine file of the simulator: its [plant] with lumps or a body, thermocouples
/// @param body  replaces the file's body, whose structure it must have
/// @throws ConfigurationError: as in the simulator; no thermocouple in the room or on the machine;
/// a part without heat loss
[[nodiscard]] ThermalPlant load_thermal_plant(const std::filesystem::path& path,
                                              const ReducedBody* body = nullptr);

}  // namespace thermocomp::diagnosis
