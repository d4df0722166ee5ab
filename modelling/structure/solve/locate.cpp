#include "modelling/structure/solve/locate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace thermocomp::structure {
namespace {

constexpr int newton_steps_max = 25;
constexpr double newton_done = 1e-12;  ///< in local coordinates

Vec3 point_of(std::span<const Vec3> at, const ShapeValues& values) {
  Vec3 point{};
  for (std::size_t i = 0; i < at.size(); ++i) point = point + values.n[i] * at[i];
  return point;
}

std::array<Vec3, 3> tangents_of(std::span<const Vec3> at, const ShapeValues& values) {
  std::array<Vec3, 3> tangents{};
  for (std::size_t i = 0; i < at.size(); ++i) {
    for (std::size_t d = 0; d < 3; ++d) {
      tangents[d] = tangents[d] + values.slope[i][d] * at[i];
    }
  }
  return tangents;
}

/// Newton step in local coordinates towards a point `miss` away; in a face's tangent plane.
Vec3 local_step(std::array<Vec3, 3> tangents, const Vec3& miss, std::size_t dimension) {
  if (dimension == 2) tangents[2] = cross(tangents[0], tangents[1]);
  const std::array<Vec3, 3> dual{cross(tangents[1], tangents[2]), cross(tangents[2], tangents[0]),
                                 cross(tangents[0], tangents[1])};
  const double determinant = dot(tangents[0], dual[0]);
  Vec3 step{};
  for (std::size_t d = 0; d < dimension; ++d) step[d] = dot(dual[d], miss) / determinant;
  return step;
}

/// Nearest point of one element or face by Newton's method within the element.
PointOnMesh nearest_in(const Mesh& mesh, Shape shape, std::span<const Index> nodes,
                       const Vec3& point_m) {
  const ShapeInfo& info = shape_info(shape);
  const NodeCoordinates coordinates = coordinates_of(mesh, nodes);
  const std::span<const Vec3> at(coordinates.data(), nodes.size());
  Vec3 local{};
  for (const Vec3& corner : info.node_locals) {
    local = local + (1.0 / static_cast<double>(info.node_locals.size())) * corner;
  }
  for (int step = 0; step < newton_steps_max; ++step) {
    const ShapeValues values = shape_values(shape, local);
    const Vec3 miss = point_m - point_of(at, values);
    const Vec3 next =
        clamped_local(shape, local + local_step(tangents_of(at, values), miss, info.dimension));
    const double moved = length(next - local);
    local = next;
    if (!(moved > newton_done)) break;
  }
  const ShapeValues values = shape_values(shape, local);
  PointOnMesh found;
  found.distance_m = length(point_m - point_of(at, values));
  for (std::size_t i = 0; i < nodes.size(); ++i) found.nodes.push_back({nodes[i], values.n[i]});
  return found;
}

Box box_of(const Mesh& mesh, std::span<const Index> nodes) {
  const NodeCoordinates at = coordinates_of(mesh, nodes);
  return bounds_of({at.data(), nodes.size()});
}

/// A curved side may extend beyond the box of its nodes.
bool is_near(const Box& box, const Vec3& point_m, double tolerance_m) {
  const double slack = tolerance_m + 0.1 * box.diagonal_m();
  for (std::size_t d = 0; d < 3; ++d) {
    if (!(point_m[d] >= box.low_m[d] - slack && point_m[d] <= box.high_m[d] + slack)) return false;
  }
  return true;
}

void keep_nearer(std::optional<PointOnMesh>& best, PointOnMesh candidate, double tolerance_m) {
  if (!(candidate.distance_m <= tolerance_m)) return;
  if (!best || candidate.distance_m < best->distance_m) best = std::move(candidate);
}

}  // namespace

std::optional<PointOnMesh> locate_in_part(const Mesh& mesh, Index part, const Vec3& point_m,
                                          double tolerance_m) {
  std::optional<PointOnMesh> best;
  for (const Element& element : mesh.elements) {
    if (element.part != part) continue;
    const auto nodes = mesh.nodes_of(element);
    if (!is_near(box_of(mesh, nodes), point_m, tolerance_m)) continue;
    keep_nearer(best, nearest_in(mesh, element.shape, nodes, point_m), tolerance_m);
  }
  return best;
}

FaceSearch::FaceSearch(const Mesh& mesh, std::vector<Face> faces) : mesh_(mesh) {
  std::vector<Box> boxes;
  std::vector<Vec3> corners;
  for (const Face& face : faces) {
    boxes.push_back(box_of(mesh, nodes_of(face)));
    corners.push_back(boxes.back().low_m);
    corners.push_back(boxes.back().high_m);
  }
  const Box whole = bounds_of(corners);
  for (std::size_t d = 1; d < 3; ++d) {
    if (whole.high_m[d] - whole.low_m[d] > whole.high_m[axis_] - whole.low_m[axis_]) axis_ = d;
  }
  std::vector<std::size_t> order(faces.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return boxes[a].low_m[axis_] < boxes[b].low_m[axis_];
  });
  for (const std::size_t i : order) {
    faces_.push_back(faces[i]);
    boxes_.push_back(boxes[i]);
    extent_m_ = std::max(extent_m_, boxes[i].high_m[axis_] - boxes[i].low_m[axis_]);
  }
}

std::optional<PointOnMesh> FaceSearch::nearest(const Vec3& point_m, double tolerance_m) const {
  const double from = point_m[axis_] - tolerance_m - 2.0 * extent_m_;
  const auto first =
      std::lower_bound(boxes_.begin(), boxes_.end(), from,
                       [this](const Box& box, double value) { return box.low_m[axis_] < value; });
  std::optional<PointOnMesh> best;
  for (auto i = static_cast<std::size_t>(first - boxes_.begin()); i < faces_.size(); ++i) {
    if (boxes_[i].low_m[axis_] > point_m[axis_] + tolerance_m + extent_m_) break;
    if (!is_near(boxes_[i], point_m, tolerance_m)) continue;
    keep_nearer(best, nearest_in(mesh_, faces_[i].shape, nodes_of(faces_[i]), point_m),
                tolerance_m);
  }
  return best;
}

}  // namespace thermocomp::structure
