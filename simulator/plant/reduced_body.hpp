/// Machine body as a finite-element model reduced to a small state space.
///
/// dx/dt = -(K + K_coolant while it flows) x + sum of inflows; temperature of a sensor = row . x;
/// displacement = row . (x - x_start). The states are amplitudes of temperature fields that are
/// orthonormal in the heat capacity, so their capacity is 1. How the file is made:
/// docs/structure.md.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace thermocomp {

struct BodySource {
  std::string name;
  std::optional<std::string> signal;  ///< none: constant
  double heat_W{0.0};
  double at{1.0};
  double exponent{1.0};
  std::vector<double> inflow;  ///< inflow into each state per watt
};

struct BodyRow {
  std::string name;
  std::vector<double> row;
};

/// Contribution to an output that depends on an axis: rows at positions, interpolated linearly.
struct BodyGuideway {
  std::string name;
  std::string axis;    ///< a position, "w_mm"
  std::string output;  ///< an output of the body
  std::vector<double> positions_mm;
  std::vector<std::vector<double>> rows;  ///< by position
};

enum class BodyPartKind { room_film, coolant_film, joint, capacity };

/// Contribution of one film, joint or part of the structure to the matrices. Used by `thermocomp
/// diagnose --thermal` to test its strength, not by the simulator.
struct BodyPart {
  std::string name;
  BodyPartKind kind{BodyPartKind::joint};
  std::vector<double> matrix;  ///< share of conductance, coolant_conductance or capacity
  std::vector<double> inflow;  ///< of a film: share of room_inflow or coolant_inflow; else empty
};

struct ReducedBody {
  std::vector<double> conductance;          ///< row by row, states x states, symmetric
  std::vector<double> coolant_conductance;  ///< added while the coolant flows
  std::vector<double> room_inflow;          ///< per degC of the room's air
  std::vector<double> coolant_inflow;
  std::vector<double> one_degC;  ///< the states with everything at 1 degC
  std::vector<BodySource> sources;
  std::vector<BodyRow> sensors;  ///< degC
  std::vector<BodyRow> outputs;  ///< um or urad
  std::vector<BodyGuideway> guideways;
  std::vector<BodyPart> parts;  ///< may be empty

  [[nodiscard]] std::size_t states() const noexcept { return one_degC.size(); }
};

/// @throws ConfigurationError
[[nodiscard]] ReducedBody load_body(const std::filesystem::path& path);
[[nodiscard]] ReducedBody parse_body(std::string text, std::string name);
/// Text of the file; parsing it gives the same body.
[[nodiscard]] std::string write_body(const ReducedBody& body, const std::string& comment);

}  // namespace thermocomp
