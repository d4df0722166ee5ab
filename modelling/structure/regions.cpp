#include "modelling/structure/regions.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "modelling/structure/solve/locate.hpp"

namespace thermocomp::structure {

RegionFinder::RegionFinder(const Mesh& mesh, std::string file)
    : mesh_(mesh),
      file_(std::move(file)),
      tolerance_m_(coincidence_m(mesh)),
      surface_(surface_of(mesh)) {
  for (Index part = 0; part < mesh.part_names.size(); ++part) {
    part_has_.push_back(nodes_of_part(mesh, part));
  }
}

void RegionFinder::problem(const Origin& origin, std::string rule) {
  problems_.push_back({file_, origin.line, origin.key, origin.value, std::move(rule)});
}

void RegionFinder::throw_problems() {
  if (!problems_.empty()) throw ConfigurationError(std::move(problems_));
}

bool RegionFinder::inside(const Region& region, Index node) const {
  for (std::size_t d = 0; d < 3; ++d) {
    const double at = mesh_.nodes_m[node][d];
    if (!(at >= region.within_m.low_m[d] - tolerance_m_ &&
          at <= region.within_m.high_m[d] + tolerance_m_)) {
      return false;
    }
  }
  return !region.part || part_has_[part_index(*region.part)][node];
}

Index RegionFinder::part_index(const std::string& name) const {
  const auto found = std::find(mesh_.part_names.begin(), mesh_.part_names.end(), name);
  return static_cast<Index>(found - mesh_.part_names.begin());
}

// Groups with the region's name, of its part or of all parts; reports a missing one.
std::vector<const Group*> RegionFinder::groups_of(const Region& region) {
  std::vector<const Group*> found;
  std::set<std::string> known;
  for (Index part = 0; part < mesh_.groups.size(); ++part) {
    if (region.part && part != part_index(*region.part)) continue;
    for (const auto& [name, group] : mesh_.groups[part]) {
      known.insert(name);
      if (name == *region.group) found.push_back(&group);
    }
  }
  if (found.empty()) {
    std::string rule = "there is no group \"" + *region.group + "\" in the mesh; there are:";
    for (const std::string& name : known) rule.append(" ").append(name);
    problem(region.origin, known.empty() ? rule + " none" : rule);
  }
  return found;
}

std::vector<Index> RegionFinder::nodes_in(const Region& region) {
  std::vector<bool> chosen(mesh_.nodes_m.size(), !region.group);
  if (region.group) {
    const auto groups = groups_of(region);
    if (groups.empty()) return {};
    for (const Group* group : groups) {
      for (const Index node : group->nodes) chosen[node] = true;
    }
  }
  std::vector<Index> nodes;
  for (Index node = 0; node < chosen.size(); ++node) {
    if (chosen[node] && inside(region, node)) nodes.push_back(node);
  }
  if (nodes.empty()) problem(region.origin, "the region contains no node of the mesh");
  return nodes;
}

std::vector<Face> RegionFinder::faces_in(const Region& region) {
  std::vector<Face> candidates;
  std::vector<bool> chosen(mesh_.nodes_m.size(), true);
  if (region.group) {
    const auto groups = groups_of(region);
    if (groups.empty()) return {};
    chosen.assign(chosen.size(), false);
    for (const Group* group : groups) {
      candidates.insert(candidates.end(), group->faces.begin(), group->faces.end());
      for (const Index node : group->nodes) chosen[node] = true;
    }
  }
  if (candidates.empty()) candidates = surface_;
  std::erase_if(candidates, [&](const Face& face) {
    const auto nodes = nodes_of(face);
    return !std::all_of(nodes.begin(), nodes.end(),
                        [&](Index node) { return chosen[node] && inside(region, node); });
  });
  if (candidates.empty())
    problem(region.origin, "the region contains no face of the mesh's surface");
  return candidates;
}

namespace {

constexpr double weight_least = 1e-12;

void refuse_joint_without_contact(RegionFinder& finder, const JointSpec& joint) {
  finder.problem(joint.from.origin,
                 "the faces of joint " + joint.name + " are further apart than gap_mm everywhere");
}

}  // namespace

void tie_faces(RegionFinder& finder, const Mesh& mesh, const JointSpec& joint,
               Reduction& reduction) {
  const std::vector<Face> from = finder.faces_in(joint.from);
  const std::vector<Face> to = finder.faces_in(joint.to);
  if (from.empty() || to.empty()) return;  // already reported
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
  if (!met) refuse_joint_without_contact(finder, joint);
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
  if (couplings.empty()) refuse_joint_without_contact(finder, joint);
  return couplings;
}

}  // namespace thermocomp::structure
