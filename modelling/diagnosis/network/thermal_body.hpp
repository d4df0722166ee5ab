/// Three-dimensional body of a machine in a thermal diagnosis. Needs the finite elements (CHOLMOD
/// and Gmsh); a build without them has no `diagnose --structure`.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "modelling/diagnosis/network/network_simulation.hpp"
#include "modelling/structure/structure_model.hpp"
#include "simulator/plant/reduced_body.hpp"

namespace thermocomp::diagnosis {

/// The states of a reduced body are amplitudes of temperature fields, which only the structure
/// defines: it is reduced again, and its fields and stiffness give a picture of every state.
class ThermalBody {
 public:
  /// @throws ConfigurationError as `thermocomp structure`
  ThermalBody(const std::filesystem::path& structure, const structure::Progress& progress);
  ~ThermalBody();
  ThermalBody(const ThermalBody&) = delete;
  ThermalBody& operator=(const ThermalBody&) = delete;

  /// With its parts.
  [[nodiscard]] const ReducedBody& body() const;
  /// Adds moments of each run: the rise since the run's start by the machine file and, with
  /// findings, the rise with them and the difference.
  /// @param before, after  of this body
  void show(const ThermalRuns& runs, const HeatNetwork& before, const HeatNetwork& after);
  /// A page for a browser.
  [[nodiscard]] std::string page(const std::string& title, const std::string& note);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::diagnosis
