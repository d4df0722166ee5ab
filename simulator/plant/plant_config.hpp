/// Configuration of the simulated machine's body, filled by the machine file or a test.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "simulator/plant/reduced_body.hpp"

namespace thermocomp {

struct NodeConfig {
  std::string name;
  std::string block;             ///< the model's block of this lump; empty: none
  double capacity_J_per_K{1.0};  ///< > 0
  double room_W_per_K{0.0};      ///< to the air of the room
  double coolant_W_per_K{0.0};   ///< to flowing coolant
  /// Displacement per kelvin of rise since the start, by output [um/K or urad/K].
  std::map<std::string, double> displacement_um_per_K;
};

struct LinkConfig {
  std::size_t first{0};
  std::size_t second{0};
  double conductance_W_per_K{0.0};
};

/// heat = heat_W (|signal| / at)^exponent: bearing friction, motor losses, feed drives.
struct HeatSourceConfig {
  std::size_t node{0};
  std::size_t signal{0};
  double heat_W{0.0};
  double at{1.0};
  double exponent{1.0};
};

enum class SignalKind {
  steps,       ///< values[i] from times_s[i] on, repeated every repeat_s if > 0
  line,        ///< linear between values[i] at times_s[i], repeated as steps
  random,      ///< random values, each held for dwell_s_min..dwell_s_max
  sine,        ///< centre + amplitude sin(2 pi t / period_s)
  while_above  ///< 1 while the watched signal is above a level, else 0
};

/// Operating signal: spindle speed, feed, coolant, position, cutting.
struct SignalConfig {
  std::string name;  ///< column name with unit: spindle_rpm, coolant_on, x_mm
  SignalKind kind{SignalKind::steps};
  std::vector<double> times_s;
  std::vector<double> values;
  double repeat_s{0.0};
  double dwell_s_min{600.0};
  double dwell_s_max{1800.0};
  double centre{0.0};
  double amplitude{0.0};
  double period_s{60.0};
  std::size_t watched{0};  ///< an earlier signal
  double above{0.0};
};

/// Temporary change of the room's air, such as an open door.
struct DraughtConfig {
  double at_s{0.0};
  double duration_s{0.0};
  double change_K{0.0};
};

/// room = mean + swing cos(2 pi (clock - warmest) / 24 h) + slow wander + draughts
struct RoomConfig {
  double mean_degC{21.0};
  double daily_swing_K{0.0};    ///< half the difference between warmest and coldest
  double warmest_h{15.0};       ///< clock hour of the warmest moment
  double start_h{7.0};          ///< clock hour at plant time 0
  double wander_K{0.0};         ///< standard deviation of the slow wander
  double wander_tau_s{3600.0};  ///< its correlation time
  std::vector<DraughtConfig> draughts;
};

struct CoolantConfig {
  std::optional<std::size_t> signal;  ///< flows while this is not 0; none: never flows
  double temp_degC{20.0};             ///< at the room's mean temperature
  double room_share{0.0};  ///< share of the room's deviation from its mean that it follows
  /// Signal that gives its temperature [degC] instead.
  std::optional<std::size_t> temp_signal{};
};

struct ThermocoupleConfig {
  enum class Place { node, room, coolant };
  std::string name;  ///< column NAME_degC
  Place place{Place::node};
  std::size_t node{0};       ///< if place is node; with a body, the index of its sensor
  double noise_K{0.0};       ///< standard deviation of one conversion
  double lag_s{0.0};         ///< first-order lag behind the node
  double offset_K{0.0};      ///< constant error
  double resolution_K{0.0};  ///< 0: none
  double conversion_s{1.0};  ///< period of new noise, plant time
};

struct OutputConfig {
  std::string name;      ///< x_um, b_urad
  double noise_um{0.0};  ///< of the indicator, in simulated run files only
};

/// displacement += um_per_K_per_m * rise(node) * (position - centre) / 1000 mm
struct PositionEffectConfig {
  std::size_t output{0};
  std::size_t node{0};
  std::size_t signal{0};
  double centre_mm{0.0};
  double um_per_K_per_m{0.0};
};

struct PlantConfig {
  double step_s{1.0};  ///< heat, room and coolant are constant over such a step of plant time
  std::vector<SignalConfig> signals;
  RoomConfig room;
  CoolantConfig coolant;
  /// Reduced finite-element model instead of nodes, links and sources.
  std::optional<ReducedBody> body;
  std::vector<std::size_t> body_signals;  ///< signal of each source of the body
  std::vector<std::size_t> body_outputs;  ///< body's row for each output
  std::vector<std::size_t> body_axes;     ///< signal of each guideway of the body
  std::vector<NodeConfig> nodes;
  std::vector<LinkConfig> links;
  std::vector<HeatSourceConfig> sources;
  std::vector<OutputConfig> outputs;
  std::vector<PositionEffectConfig> position_effects;
  std::vector<ThermocoupleConfig> thermocouples;
};

}  // namespace thermocomp
