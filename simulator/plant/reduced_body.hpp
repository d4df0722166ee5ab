/// The machine's body as a finite-element model reduced to a small state space.
///
/// dx/dt = -(K + K_coolant while it flows) x + sum of inflows; temperature of a sensor = row . x;
/// displacement = row . (x - x_start). The states are amplitudes of temperature fields that are
/// orthonormal in the heat capacity, so their capacity is 1. docs/structure.md says how
/// `thermocomp structure --plant` makes the file.
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
  std::vector<double> inflow;  ///< a W of it into each state
};

struct BodyRow {
  std::string name;
  std::vector<double> row;
};

/// What an output moves further with an axis elsewhere: rows at positions, straight between them.
struct BodyGuideway {
  std::string name;
  std::string axis;    ///< a position, "w_mm"
  std::string output;  ///< one of the body's
  std::vector<double> positions_mm;
  std::vector<std::vector<double>> rows;  ///< one a position
};

enum class BodyPartKind { room_film, coolant_film, joint, capacity };

/// What one film, joint or part of the structure has in the matrices: `thermocomp diagnose
/// --thermal` asks whether its strength is right. The simulator does not need it.
struct BodyPart {
  std::string name;
  BodyPartKind kind{BodyPartKind::joint};
  std::vector<double> matrix;  ///< in conductance, coolant_conductance or the capacity
  std::vector<double> inflow;  ///< of a film, in room_inflow or coolant_inflow; else empty
};

struct ReducedBody {
  std::vector<double> conductance;          ///< row by row, states x states, symmetric
  std::vector<double> coolant_conductance;  ///< besides, while the coolant flows
  std::vector<double> room_inflow;          ///< a degC of the room's air
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
/// The file's text; reading it gives the same body.
[[nodiscard]] std::string write_body(const ReducedBody& body, const std::string& comment);

}  // namespace thermocomp
