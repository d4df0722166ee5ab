#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "modelling/structure/mesh/mesh.hpp"

namespace thermocomp::structure {
namespace {

constexpr double same_plane_of_size = 1e-9;

/// Coordinates of the grid's planes along one axis, the boxes' faces among them.
std::vector<double> planes(const std::vector<BoxShape>& boxes, std::size_t axis, double size_m) {
  std::vector<double> faces;
  for (const BoxShape& shape : boxes) {
    faces.push_back(shape.box.low_m[axis]);
    faces.push_back(shape.box.high_m[axis]);
  }
  std::sort(faces.begin(), faces.end());
  const double same = same_plane_of_size * (faces.back() - faces.front());
  std::vector<double> result{faces.front()};
  for (const double face : faces) {
    const double from = result.back();
    if (face - from <= same) continue;
    const double count = std::max(1.0, std::ceil((face - from) / size_m - 1e-6));
    for (double i = 1; i < count; ++i) result.push_back(from + (face - from) * i / count);
    result.push_back(face);
  }
  return result;
}

/// The nodes of one part's grid: at planes (even index) and half-way between them (odd).
class GridNodes {
 public:
  GridNodes(Mesh& mesh, const std::array<std::vector<double>, 3>& planes_m)
      : mesh_(mesh), planes_m_(planes_m) {}

  using Place = std::array<std::size_t, 3>;  ///< in half steps

  Index at(const Place& place) {
    std::size_t key = 0;
    for (std::size_t d = 0; d < 3; ++d) key = key * (2 * planes_m_[d].size()) + place[d];
    const auto [entry, is_new] =
        numbers_.try_emplace(key, static_cast<Index>(mesh_.nodes_m.size()));
    if (is_new) {
      Vec3 node{};
      for (std::size_t d = 0; d < 3; ++d) {
        const std::size_t below = place[d] / 2;
        const std::size_t above = (place[d] + 1) / 2;
        node[d] = 0.5 * (planes_m_[d][below] + planes_m_[d][above]);
      }
      mesh_.nodes_m.push_back(node);
    }
    return entry->second;
  }

 private:
  Mesh& mesh_;
  const std::array<std::vector<double>, 3>& planes_m_;
  std::unordered_map<std::size_t, Index> numbers_;
};

using Place = GridNodes::Place;

/// An element from its corners in half steps; the middles of its edges are between them.
void add_from_corners(Mesh& mesh, GridNodes& nodes, Index part, Shape shape,
                      const std::vector<Place>& corners, Index number) {
  const ShapeInfo& info = shape_info(shape);
  std::vector<Index> all;
  all.reserve(info.nodes);
  for (const Place& corner : corners) all.push_back(nodes.at(corner));
  if (info.nodes > info.corners) {
    for (const auto& [a, b] : info.edges) {
      Place middle{};
      for (std::size_t d = 0; d < 3; ++d) middle[d] = (corners[a][d] + corners[b][d]) / 2;
      all.push_back(nodes.at(middle));
    }
  }
  mesh.add_element(shape, part, all, number);
}

/// Six tetrahedra along one diagonal of a cell; neighbouring cells meet in equal triangles.
std::vector<std::vector<Place>> tetrahedra_of(const Place& low) {
  std::vector<std::vector<Place>> result;
  std::array<std::size_t, 3> order{0, 1, 2};
  bool even = true;
  do {
    std::vector<Place> corners{low};
    for (const std::size_t axis : order) {
      corners.push_back(corners.back());
      corners.back()[axis] += 2;
    }
    if (!even) std::swap(corners[1], corners[2]);
    result.push_back(corners);
    // std::next_permutation runs through 012 021 102 120 201 210: signs + - - + + -.
    const std::size_t done = result.size();
    even = done == 3 || done == 4;
  } while (std::next_permutation(order.begin(), order.end()));
  return result;
}

std::vector<Place> hexahedron_of(const Place& low) {
  std::vector<Place> corners;
  for (const Vec3& local : shape_info(Shape::hex8).node_locals) {
    Place corner = low;
    for (std::size_t d = 0; d < 3; ++d) corner[d] += local[d] > 0 ? 2U : 0U;
    corners.push_back(corner);
  }
  return corners;
}

bool is_filled(const std::vector<BoxShape>& boxes, const Vec3& centre_m) {
  bool filled = false;
  for (const BoxShape& shape : boxes) {
    bool inside = true;
    for (std::size_t d = 0; d < 3; ++d) {
      inside = inside && centre_m[d] > shape.box.low_m[d] && centre_m[d] < shape.box.high_m[d];
    }
    if (inside) filled = !shape.cut;
  }
  return filled;
}

}  // namespace

std::size_t add_boxes(Mesh& mesh, Index part, const std::vector<BoxShape>& boxes,
                      const Vec3& size_m, Shape shape) {
  std::array<std::vector<double>, 3> planes_m;
  for (std::size_t d = 0; d < 3; ++d) planes_m[d] = planes(boxes, d, size_m[d]);
  GridNodes nodes(mesh, planes_m);
  const bool tetrahedra = shape_info(shape).corners == 4;
  Index number = 0;
  for (std::size_t k = 0; k + 1 < planes_m[2].size(); ++k) {
    for (std::size_t j = 0; j + 1 < planes_m[1].size(); ++j) {
      for (std::size_t i = 0; i + 1 < planes_m[0].size(); ++i) {
        const Vec3 centre{0.5 * (planes_m[0][i] + planes_m[0][i + 1]),
                          0.5 * (planes_m[1][j] + planes_m[1][j + 1]),
                          0.5 * (planes_m[2][k] + planes_m[2][k + 1])};
        if (!is_filled(boxes, centre)) continue;
        const Place low{2 * i, 2 * j, 2 * k};
        if (!tetrahedra) {
          add_from_corners(mesh, nodes, part, shape, hexahedron_of(low), ++number);
          continue;
        }
        for (const std::vector<Place>& corners : tetrahedra_of(low)) {
          add_from_corners(mesh, nodes, part, shape, corners, ++number);
        }
      }
    }
  }
  return number;
}

double cells_of_boxes(const std::vector<BoxShape>& boxes, const Vec3& size_m) {
  double cells = 1.0;
  for (std::size_t d = 0; d < 3; ++d) {
    double low = boxes.front().box.low_m[d];
    double high = low;
    for (const BoxShape& shape : boxes) {
      low = std::min(low, shape.box.low_m[d]);
      high = std::max(high, shape.box.high_m[d]);
    }
    cells *= std::ceil((high - low) / size_m[d]) + 2.0 * static_cast<double>(boxes.size());
  }
  return cells;
}

}  // namespace thermocomp::structure
