/// The structure file, what a user writes about a machine's structure, as plain structures. Only
/// what can be judged without the meshes is judged here; structure_model.hpp does the rest.
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

/// Where something stands in the file, for problems that show only with the mesh at hand.
struct Origin {
  int line{0};
  std::string key;    ///< "support[1].on"
  std::string value;  ///< as it may be shown
};

/// Nodes or faces: everything that meets all given conditions.
struct Region {
  std::optional<std::string> part;
  std::optional<std::string> group;  ///< a name of the mesh file
  Box within_m;                      ///< infinite where no range is given
  Origin origin;
};

struct PartSpec {
  std::string name;
  Index material{0};
  /// A mesh file, or boxes.
  std::filesystem::path mesh;
  std::optional<std::string> group;  ///< of the mesh file, the part's elements; none: all
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
  Vec3 stiffness_N_per_m{};  ///< of the whole joint, where it is not bonded
  double gap_m{0.0};         ///< greatest distance between the faces
  /// Heat through the faces; none: a bonded joint conducts perfectly, one by springs not at all.
  std::optional<double> conductance_W_per_m2_K;
};

/// Nodes whose temperature is one input of the model.
struct BlockSpec {
  std::string name;  ///< "column_upper_degC"
  Region on;
  bool rest{false};  ///< everything that no other block takes
};

/// The mean over one point, or the tilt between two.
struct PlaceSpec {
  Index part{0};
  std::vector<Vec3> at_m;  ///< one point, or from and to
  double tolerance_m{0.0};
  double sign{1.0};  ///< tool 1, work -1
  Origin origin;
};

struct OutputSpec {
  std::string name;
  Vec3 direction{};  ///< of length 1
  std::vector<PlaceSpec> places;
};

/// A thermocouple, for a simulated machine.
struct SensorSpec {
  std::string name;
  PlaceSpec place;
};

struct GuidewayRows {
  std::string name;
  std::string axis;
  std::vector<double> positions_mm;
  std::vector<PlaceSpec> places;  ///< one per position
  /// Where the meshes have the axis: rows then say what other positions differ by.
  std::optional<PlaceSpec> drawn;
  std::map<std::string, Vec3> outputs;  ///< name -> direction
};

/// Heat between faces and the air or the coolant.
struct ConvectionSpec {
  Region on;
  double coefficient_W_per_m2_K{0.0};
  bool to_coolant{false};
};

/// heat = heat_W (|signal| / at)^exponent into faces or, with `inside`, the volume.
struct HeatSpec {
  std::string name;
  Region on;
  bool inside{false};
  double heat_W{0.0};
  std::optional<std::string> signal;  ///< none: constant
  double at{1.0};
  double exponent{1.0};
};

/// One thermal analysis, from everything at the temperature of the room.
struct LoadCaseSpec {
  std::string name;
  bool steady{false};
  double duration_s{0.0};
  double step_s{0.0};
  std::vector<double> at_s;               ///< moments that count, increasing
  std::map<std::string, double> signals;  ///< others are 0
  double room_change_K{0.0};              ///< evenly over the duration
  bool coolant_on{false};
  bool left_out{false};  ///< judges a placement and takes no part in it
};

/// By how much a pattern changes the rise of its blocks where the file does not say.
inline const std::vector<double> usual_percents{10.0, -10.0, 5.0, -5.0};

/// Blocks that are made warmer or cooler together where sensors are placed.
struct PatternSpec {
  std::string name;
  std::vector<Index> blocks;     ///< places among StructureSpec::blocks
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
  bool sensors_on_surface{true};      ///< a sensor is screwed on, not cast in
  std::vector<PatternSpec> patterns;  ///< none: derived from the structure
};

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] StructureSpec load_structure(const std::filesystem::path& path);
/// @param path  stands for the file in problems; mesh files are sought beside it
[[nodiscard]] StructureSpec parse_structure(const std::string& text,
                                            const std::filesystem::path& path);

}  // namespace thermocomp::structure
