/// Pictures of blocks, temperatures and displacements: VTK XML file, SVG, and a page in 3D.
#pragma once

#include <string>
#include <vector>

#include "modelling/structure/structure_model.hpp"
#include "report/body_page.hpp"

namespace thermocomp::structure {

/// Displacement with one block 1 K warmer.
struct BlockShape {
  std::string block;
  std::vector<double> displacement_m;  ///< shape (3 nodes)
};

struct NodeValues {
  std::string name;            ///< with unit
  int components{1};           ///< per node
  std::vector<double> values;  ///< shape (nodes)(components)
};

/// Point data: `block` (from 0) and `data`; cell data: `part`.
[[nodiscard]] std::string vtu_file(const Structure& structure, const std::vector<NodeValues>& data);
/// Names: BLOCK_um_per_K.
[[nodiscard]] std::vector<NodeValues> values_of(const std::vector<BlockShape>& shapes);

/// One panel with the structure and its blocks in colours, and one per block with the enlarged
/// shape for 1 K. The factor is printed below each panel.
[[nodiscard]] std::string svg_picture(const Structure& structure,
                                      const std::vector<BlockShape>& shapes);

/// Up to 25 evenly spaced numbers from `first` to `last`, both included: a page with 25 moments of
/// some thousand nodes is smaller than 10 MB.
[[nodiscard]] std::vector<std::size_t> moments(std::size_t first, std::size_t last);

/// Page of the structure's surface, with the file's sensors and the points of its outputs.
class SurfacePicture {
 public:
  SurfacePicture(const StructureSpec& spec, const Structure& structure);

  /// @param state  its values are overwritten
  /// @param rise_K  shape (nodes)
  /// @param displacement_m  shape (3 nodes)
  void add_state(BodyState state, std::span<const double> rise_K,
                 std::span<const double> displacement_m);
  void add_sensor(const std::string& name, const Vec3& at_m);
  void leave_out_sensors();
  /// Replaces the structure's name as the title.
  void set_title(const std::string& title, const std::string& note);
  [[nodiscard]] std::string page() const { return body_page(picture_); }

 private:
  void add_point(const std::string& name, bool is_sensor, const Vec3& at_m);

  BodyPicture picture_;
  std::vector<Functional> rows_;  ///< by output
  std::vector<Index> nodes_;      ///< of the mesh, in the picture's order
};

}  // namespace thermocomp::structure
