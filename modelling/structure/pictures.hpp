/// Mesh, blocks, temperatures and displacements: as a VTK XML file, for ParaView and its like, as a
/// picture that needs no other program (SVG), and in three dimensions for a browser.
#pragma once

#include <string>
#include <vector>

#include "modelling/structure/structure_model.hpp"
#include "report/body_page.hpp"

namespace thermocomp::structure {

/// The structure with one block 1 K warm.
struct BlockShape {
  std::string block;
  std::vector<double> displacement_m;  ///< shape (3 nodes)
};

/// A quantity at every node.
struct NodeValues {
  std::string name;            ///< with its unit
  int components{1};           ///< of the value at a node
  std::vector<double> values;  ///< shape (nodes)(components)
};

/// Point data: `block` (counted from 0) and what is given; cell data: `part`.
[[nodiscard]] std::string vtu_file(const Structure& structure, const std::vector<NodeValues>& data);
/// The names are BLOCK_um_per_K.
[[nodiscard]] std::vector<NodeValues> values_of(const std::vector<BlockShape>& shapes);

/// One panel with the structure as it is, its blocks in colours, and one for each block: the shape
/// with that block 1 K warm, enlarged so that it shows. The factor stands below each panel.
[[nodiscard]] std::string svg_picture(const Structure& structure,
                                      const std::vector<BlockShape>& shapes);

/// Up to 25 of the numbers from first to last, evenly, both among them. A page with 25 moments of
/// some thousand nodes has less than ten megabytes.
[[nodiscard]] std::vector<std::size_t> moments(std::size_t first, std::size_t last);

/// A page of the structure's surface, with the sensors of its file and the points of its outputs.
class SurfacePicture {
 public:
  SurfacePicture(const StructureSpec& spec, const Structure& structure);

  /// @param state  its values are filled in
  /// @param rise_K  shape (nodes)
  /// @param displacement_m  shape (3 nodes)
  void add_state(BodyState state, std::span<const double> rise_K,
                 std::span<const double> displacement_m);
  void add_sensor(const std::string& name, const Vec3& at_m);
  void leave_out_sensors();
  /// In place of the structure's name.
  void set_title(const std::string& title, const std::string& note);
  [[nodiscard]] std::string page() const { return body_page(picture_); }

 private:
  void add_point(const std::string& name, bool is_sensor, const Vec3& at_m);

  BodyPicture picture_;
  std::vector<Functional> rows_;  ///< one an output
  std::vector<Index> nodes_;      ///< of the mesh, in the picture's order
};

}  // namespace thermocomp::structure
