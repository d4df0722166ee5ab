#include <algorithm>
#include <cmath>

#include "estimator/thermal_model.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double alike_min = 0.98;

bool alike(const PlaceGroups& groups, const std::string& one, const std::string& other) {
  if (one == other) return true;
  const auto group = groups.find(one);
  return group != groups.end() &&
         std::find(group->second.begin(), group->second.end(), other) != group->second.end();
}

}  // namespace

PlaceGroups place_groups(const MeasuredData& data) {
  std::vector<std::string> names = data.model.inputs;
  names.insert(names.end(), data.others.begin(), data.others.end());
  Panel rises_K = stacked(data, stacked_rows(data), [&](const MeasuredRun& run) {
    Panel columns(run.rows(), std::ssize(names));
    Eigen::Index column = 0;
    for (const auto* of : {&run.inputs_K, &run.others_K})
      for (const Column& rise_K : *of) columns.col(column++) = rise_K;
    return columns;
  });
  rises_K.rowwise() -= rises_K.colwise().mean().eval();
  const Eigen::MatrixXd products = rises_K.transpose() * rises_K;
  PlaceGroups groups;
  for (Eigen::Index i = 0; i < products.rows(); ++i) {
    std::vector<std::string>& group = groups[names[static_cast<std::size_t>(i)]];
    for (Eigen::Index j = 0; j < products.rows(); ++j)
      if (i == j || products(i, j) > alike_min * std::sqrt(products(i, i) * products(j, j)))
        group.push_back(names[static_cast<std::size_t>(j)]);
  }
  return groups;
}

bool same_places(const PlaceGroups& groups, const std::string& subject, const std::string& other) {
  const SubjectColumns a = subject_columns(subject);
  const SubjectColumns b = subject_columns(other);
  if (a.second.empty() != b.second.empty()) return false;
  const bool in_order =
      alike(groups, a.first, b.first) && (a.second.empty() || alike(groups, a.second, b.second));
  return in_order || (!a.second.empty() && alike(groups, a.first, b.second) &&
                      alike(groups, a.second, b.first));
}

std::vector<std::string> group_of(const PlaceGroups& groups, const std::string& subject,
                                  const std::vector<std::string>& others) {
  std::vector<std::string> all;
  const auto add = [&all](const std::string& name) {
    if (!name.empty() && std::find(all.begin(), all.end(), name) == all.end()) all.push_back(name);
  };
  const auto add_places = [&add](const std::string& of) {
    const SubjectColumns places = subject_columns(of);
    add(places.first);
    add(places.second);
  };
  add_places(subject);
  for (const std::string& place : std::vector<std::string>(all)) {
    const auto group = groups.find(place);
    if (group == groups.end()) continue;
    for (const std::string& name : group->second) add(name);
  }
  for (const std::string& other : others) add_places(other);
  return all;
}

}  // namespace thermocomp::diagnosis
