#include "modelling/structure/joints.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "modelling/structure/solve/locate.hpp"

namespace thermocomp::structure {
namespace {

constexpr double weight_least = 1e-12;

void say_that_they_do_not_meet(RegionFinder& finder, const JointSpec& joint) {
  finder.problem(joint.from.origin, "the faces of joint " + joint.name +
                                        " are nowhere nearer to each other than gap_mm");
}

}  // namespace

void tie_faces(RegionFinder& finder, const Mesh& mesh, const JointSpec& joint,
               Reduction& reduction) {
  const std::vector<Face> from = finder.faces_in(joint.from);
  const std::vector<Face> to = finder.faces_in(joint.to);
  if (from.empty() || to.empty()) return;  // a problem already
  std::set<Index> nodes;
  for (const Face& face : from) {
    const auto its = nodes_of(face);
    nodes.insert(its.begin(), its.end());
  }
  const FaceSearch search(mesh, to);
  bool met = false;
  for (const Index node : nodes) {
    auto found = search.nearest(mesh.nodes_m[node], joint.gap_m + finder.tolerance_m());
    if (!found) continue;
    std::erase_if(found->nodes,
                  [](const Weighted& w) { return std::fabs(w.weight) < weight_least; });
    static_cast<void>(reduction.tie(node, found->nodes));
    met = true;
  }
  if (!met) say_that_they_do_not_meet(finder, joint);
}

std::vector<Coupling> couplings_between(RegionFinder& finder, const Mesh& mesh,
                                        const JointSpec& joint) {
  const std::vector<Face> from = finder.faces_in(joint.from);
  const std::vector<Face> to = finder.faces_in(joint.to);
  if (from.empty() || to.empty()) return {};
  const FaceSearch search(mesh, to);
  const double gap_m = joint.gap_m + finder.tolerance_m();
  std::vector<Coupling> couplings =
      couplings_on(mesh, from, [&](const Vec3& place, Coupling& coupling) {
        const auto found = search.nearest(place, gap_m);
        if (!found) return false;
        for (const Weighted& other : found->nodes) {
          coupling.add({&other.node, 1}, {&other.weight, 1}, -1.0);
        }
        return true;
      });
  if (couplings.empty()) say_that_they_do_not_meet(finder, joint);
  return couplings;
}

}  // namespace thermocomp::structure
