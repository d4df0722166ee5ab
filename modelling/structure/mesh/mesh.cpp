#include "modelling/structure/mesh/mesh.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "config/text/printable_text.hpp"

namespace thermocomp::structure {

namespace {

constexpr double coincidence_of_size = 1e-7;

/// Corner nodes of a face in increasing order; a triangle ends with `no_part`.
using FaceKey = std::array<Index, 4>;

FaceKey key_of(const Face& face) {
  FaceKey key{no_part, no_part, no_part, no_part};
  std::copy_n(face.nodes.begin(), shape_info(face.shape).corners, key.begin());
  std::sort(key.begin(), key.end());
  return key;
}

struct KeyHash {
  std::size_t operator()(const FaceKey& key) const noexcept {
    std::size_t hash = 0;
    for (const Index node : key) hash = (hash ^ node) * 0x9e3779b97f4a7c15u;
    return hash ^ (hash >> 29u);
  }
};

Face face_of(const Mesh& mesh, const Element& element, const ShapeFace& local) {
  const auto nodes = mesh.nodes_of(element);
  Face face{local.shape, element.part, {}};
  for (std::size_t i = 0; i < local.nodes.size(); ++i) face.nodes[i] = nodes[local.nodes[i]];
  return face;
}

Index root_of(std::vector<Index>& parent, Index node) {
  while (parent[node] != node) {
    parent[node] = parent[parent[node]];
    node = parent[node];
  }
  return node;
}

}  // namespace

void Mesh::add_element(Shape shape, Index part, std::span<const Index> nodes, Index number) {
  elements.push_back({shape, part, static_cast<Index>(connectivity.size()), number});
  connectivity.insert(connectivity.end(), nodes.begin(), nodes.end());
}

NodeCoordinates coordinates_of(const Mesh& mesh, std::span<const Index> nodes) {
  NodeCoordinates coordinates;
  for (std::size_t i = 0; i < nodes.size(); ++i) coordinates[i] = mesh.nodes_m[nodes[i]];
  return coordinates;
}

std::vector<Face> surface_of(const Mesh& mesh) {
  std::unordered_map<FaceKey, unsigned, KeyHash> seen;
  const auto each_face = [&mesh](const auto& action) {
    for (const Element& element : mesh.elements) {
      for (const ShapeFace& local : shape_info(element.shape).faces) {
        action(face_of(mesh, element, local));
      }
    }
  };
  each_face([&](const Face& face) { ++seen[key_of(face)]; });
  std::vector<Face> surface;
  each_face([&](const Face& face) {
    if (seen[key_of(face)] == 1) surface.push_back(face);
  });
  return surface;
}

std::vector<Index> parts_of_nodes(const Mesh& mesh) {
  std::vector<Index> parts(mesh.nodes_m.size(), no_part);
  for (const Element& element : mesh.elements) {
    for (const Index node : mesh.nodes_of(element)) {
      parts[node] = std::min(parts[node], element.part);
    }
  }
  return parts;
}

std::vector<bool> nodes_of_part(const Mesh& mesh, Index part) {
  std::vector<bool> inside(mesh.nodes_m.size(), false);
  for (const Element& element : mesh.elements) {
    if (element.part != part) continue;
    for (const Index node : mesh.nodes_of(element)) inside[node] = true;
  }
  return inside;
}

std::vector<Index> bodies_of_nodes(const Mesh& mesh) {
  std::vector<Index> parent(mesh.nodes_m.size());
  std::iota(parent.begin(), parent.end(), Index{0});
  std::vector<bool> used(parent.size(), false);
  for (const Element& element : mesh.elements) {
    const auto nodes = mesh.nodes_of(element);
    for (const Index node : nodes) {
      used[node] = true;
      const Index a = root_of(parent, nodes[0]);
      const Index b = root_of(parent, node);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  std::vector<Index> bodies(parent.size(), no_part);
  Index count = 0;
  for (Index node = 0; node < parent.size(); ++node) {
    if (!used[node]) continue;
    const Index root = root_of(parent, node);
    bodies[node] = root == node ? count++ : bodies[root];
  }
  return bodies;
}

std::vector<std::string> inverted_elements(const Mesh& mesh, std::size_t count_max) {
  std::vector<std::string> lines;
  for (const Element& element : mesh.elements) {
    if (lines.size() == count_max) break;
    const auto nodes = mesh.nodes_of(element);
    const NodeCoordinates at = coordinates_of(mesh, nodes);
    const auto good = [&](const RulePoint& point) {
      return gradients_at({at.data(), nodes.size()}, point).volume > 0.0;
    };
    const ShapeInfo& info = shape_info(element.shape);
    const auto good_corner = [&](const Vec3& local) {
      return good({local, 1.0, shape_values(element.shape, local)});
    };
    const auto last_corner = info.node_locals.begin() + static_cast<std::ptrdiff_t>(info.corners);
    if (std::all_of(info.product_rule.begin(), info.product_rule.end(), good) &&
        std::all_of(info.node_locals.begin(), last_corner, good_corner)) {
      continue;
    }
    const Vec3 place = 1000.0 * at[0];
    std::string line = "element " + std::to_string(element.number);
    line.append(" (").append(info.name).append(") near ");
    for (std::size_t d = 0; d < 3; ++d) {
      line.append(d == 0 ? "[" : ", ").append(number_text(std::round(place[d] * 1e3) / 1e3));
    }
    line.append("] mm of part ").append(mesh.part_names[element.part]);
    lines.push_back(line.append(" is inverted or flat"));
  }
  return lines;
}

void drop_unused_nodes(Mesh& mesh) {
  std::vector<Index> number(mesh.nodes_m.size(), no_part);
  for (const Index node : mesh.connectivity) number[node] = 0;
  Index count = 0;
  for (Index node = 0; node < number.size(); ++node) {
    if (number[node] == no_part) continue;
    mesh.nodes_m[count] = mesh.nodes_m[node];
    number[node] = count++;
  }
  mesh.nodes_m.resize(count);
  for (Index& node : mesh.connectivity) node = number[node];
  for (auto& groups : mesh.groups) {
    for (auto& [name, group] : groups) {
      std::erase_if(group.nodes, [&](Index node) { return number[node] == no_part; });
      std::erase_if(group.faces, [&](const Face& face) {
        const auto nodes = nodes_of(face);
        return std::any_of(nodes.begin(), nodes.end(),
                           [&](Index node) { return number[node] == no_part; });
      });
      for (Index& node : group.nodes) node = number[node];
      for (Face& face : group.faces) {
        const std::size_t nodes = shape_info(face.shape).nodes;
        for (std::size_t i = 0; i < nodes; ++i) face.nodes[i] = number[face.nodes[i]];
      }
    }
  }
}

Box bounds_of(std::span<const Vec3> points_m) {
  Box box;
  if (points_m.empty()) return box;
  box = {points_m[0], points_m[0]};
  for (const Vec3& point : points_m) {
    for (std::size_t d = 0; d < 3; ++d) {
      box.low_m[d] = std::min(box.low_m[d], point[d]);
      box.high_m[d] = std::max(box.high_m[d], point[d]);
    }
  }
  return box;
}

double coincidence_m(const Mesh& mesh) {
  return coincidence_of_size * bounds_of(mesh.nodes_m).diagonal_m();
}

namespace {

constexpr double same_plane_of_size = 1e-9;

/// Grid planes along one axis, including the boxes' faces.
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

/// Nodes of one part's grid: on planes (even index) and half-way between them (odd).
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

/// Adds an element from its corners in half steps, with the mid-side nodes between them.
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

/// Six tetrahedra around one diagonal of a cell; neighbouring cells share their triangles.
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
    // Order of std::next_permutation: 012 021 102 120 201 210, with signs + - - + + -.
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
