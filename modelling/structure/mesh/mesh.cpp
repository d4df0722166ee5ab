#include "modelling/structure/mesh/mesh.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "config/text/number_text.hpp"

namespace thermocomp::structure {
namespace {

constexpr double coincidence_of_size = 1e-7;

/// Corner nodes of a face in increasing order; triangles end in `no_part`.
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

}  // namespace thermocomp::structure
