/// Contents of the structure file. Checks that need the mesh are in structure_model.hpp.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "config/text/problems.hpp"
#include "modelling/structure/elements/matrices.hpp"
#include "modelling/structure/mesh/mesh.hpp"

namespace thermocomp::structure {

/// Place in the file, for problems found only with the mesh.
struct Origin {
  int line{0};
  std::string key;    ///< "support[1].on"
  std::string value;  ///< as shown in the message
};

/// Nodes or faces that meet all given conditions.
struct Region {
  std::optional<std::string> part;
  std::optional<std::string> group;  ///< name in the mesh file
  Box within_m;                      ///< infinite if not given
  Origin origin;
};

struct PartSpec {
  std::string name;
  Index material{0};
  /// Mesh file; empty: boxes.
  std::filesystem::path mesh;
  std::optional<std::string> group;  ///< group of the mesh file with the part's elements; none: all
  double length_unit_m{1e-3};
  Vec3 size_m{};  ///< of elements, for boxes and geometry
  Shape shape{Shape::tet10};
  std::vector<BoxShape> boxes;
  Origin origin;
};

struct SupportSpec {
  Region on;
  std::array<bool, 3> directions{};
};

struct SpringSpec {
  Region on;
  Vec3 stiffness_N_per_m{};  ///< of the whole region
};

struct JointSpec {
  std::string name;
  Region from;
  Region to;
  bool bonded{true};
  Vec3 stiffness_N_per_m{};  ///< of the whole joint, unless bonded
  double gap_m{0.0};         ///< largest distance between the faces
  /// Contact conductance; none: infinite in a bonded joint, zero in a spring joint.
  std::optional<double> conductance_W_per_m2_K;
};

/// Nodes that form one input of the model.
struct BlockSpec {
  std::string name;  ///< "column_upper_degC"
  Region on;
  bool rest{false};  ///< all nodes outside the other blocks
};

/// A displacement at one point, or the tilt between two.
struct PlaceSpec {
  Index part{0};
  std::vector<Vec3> at_m;  ///< one point, or from and to
  double tolerance_m{0.0};
  double sign{1.0};  ///< tool 1, work -1
  Origin origin;
};

struct OutputSpec {
  std::string name;
  Vec3 direction{};  ///< unit vector
  std::vector<PlaceSpec> places;
};

struct SensorSpec {
  std::string name;
  PlaceSpec place;
};

struct GuidewayRows {
  std::string name;
  std::string axis;
  std::vector<double> positions_mm;
  std::vector<PlaceSpec> places;  ///< one per position
  /// Position of the axis in the meshes: rows then contain the difference from it.
  std::optional<PlaceSpec> drawn;
  std::map<std::string, Vec3> outputs;  ///< name -> direction
};

struct ConvectionSpec {
  Region on;
  double coefficient_W_per_m2_K{0.0};
  bool to_coolant{false};
};

/// heat = heat_W (|signal| / at)^exponent into faces, or with `inside` into the volume.
struct HeatSpec {
  std::string name;
  Region on;
  bool inside{false};
  double heat_W{0.0};
  std::optional<std::string> signal;  ///< none: constant
  double at{1.0};
  double exponent{1.0};
};

/// One thermal analysis, starting at room temperature.
struct LoadCaseSpec {
  std::string name;
  bool steady{false};
  double duration_s{0.0};
  double step_s{0.0};
  std::vector<double> at_s;               ///< evaluated times, increasing
  std::map<std::string, double> signals;  ///< others are 0
  double room_change_K{0.0};              ///< linear over the duration
  bool coolant_on{false};
  bool left_out{false};  ///< used to validate a placement, not to find it
};

/// Default changes of a pattern's rises.
inline const std::vector<double> usual_percents{10.0, -10.0, 5.0, -5.0};

/// Blocks whose rises are varied together for the placement of sensors.
struct PatternSpec {
  std::string name;
  std::vector<Index> blocks;     ///< indices into StructureSpec::blocks
  std::vector<double> percents;  ///< of the rise
};

struct StructureSpec {
  std::filesystem::path file;
  std::vector<Material> materials;
  std::vector<PartSpec> parts;
  std::vector<SupportSpec> supports;
  std::vector<SpringSpec> springs;
  std::vector<JointSpec> joints;
  std::vector<BlockSpec> blocks;
  std::vector<OutputSpec> outputs;
  std::vector<GuidewayRows> guideways;
  double room_degC{20.0};
  double coolant_degC{20.0};
  std::vector<ConvectionSpec> convections;
  std::vector<HeatSpec> heats;
  std::vector<LoadCaseSpec> load_cases;
  std::vector<SensorSpec> sensors;
  bool sensors_on_surface{true};      ///< sensors only on the surface
  std::vector<PatternSpec> patterns;  ///< none: derived from the structure
};

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] StructureSpec load_structure(const std::filesystem::path& path);
/// @param path  file name for problems; mesh files are relative to it
[[nodiscard]] StructureSpec parse_structure(const std::string& text,
                                            const std::filesystem::path& path);

}  // namespace thermocomp::structure
