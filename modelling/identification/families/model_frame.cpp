#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "modelling/identification/families/families.hpp"
#include "modelling/identification/printed.hpp"

namespace thermocomp::identification {
namespace {

using Names = std::vector<std::string>;

Names together(const Names& first, const Names& second) {
  Names all = first;
  for (const std::string& name : second)
    if (std::find(all.begin(), all.end(), name) == all.end()) all.push_back(name);
  return all;
}

Names without(const Names& all, const Names& those) {
  Names rest;
  for (const std::string& name : all)
    if (std::find(those.begin(), those.end(), name) == those.end()) rest.push_back(name);
  return rest;
}

std::size_t place_of(const Names& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

void take_rows(const ThermalModel& from, ThermalModel& into) {
  for (std::size_t i = 0; i < from.outputs.size(); ++i) {
    auto& row = into.matrix_um_per_K[place_of(into.outputs, from.outputs[i])];
    std::fill(row.begin(), row.end(), 0.0);
    for (std::size_t j = 0; j < from.inputs.size(); ++j)
      row[place_of(into.inputs, from.inputs[j])] = from.matrix_um_per_K[i][j];
  }
}

}  // namespace

ThermalModel in_frame(const ThermalModel& fitted, const ThermalModel& frame, Names& notes) {
  const Names kept = without(frame.outputs, fitted.outputs);
  const bool has_more = !frame.terms.empty() || !frame.guideways.empty() || frame.course;
  if (has_more && !kept.empty())
    throw std::runtime_error("--like: " + joined(kept) +
                             " of that model was not fitted, and its terms, guideways or course "
                             "would be lost: add it to --outputs, or name a model with a matrix "
                             "only");
  if (!kept.empty()) notes.push_back(joined(kept) + ": not fitted, keeps the row of --like");
  for (const std::string& name : without(fitted.outputs, frame.outputs))
    notes.push_back(name +
                    ": no output of the model of --like; it compensates only where an axis "
                    "of the configuration names it");
  if (has_more) notes.emplace_back("terms, guideways and course of --like are not copied");
  if (!frame.covariance_K2.empty())
    notes.emplace_back(
        "the covariance of --like is not copied: compute it again (thermocomp covariance)");
  ThermalModel model = fitted;
  model.inputs = together(frame.inputs, fitted.inputs);
  model.outputs = together(frame.outputs, fitted.outputs);
  model.matrix_um_per_K.assign(model.outputs.size(), std::vector<double>(model.inputs.size(), 0.0));
  take_rows(frame, model);
  take_rows(fitted, model);
  if (!fitted.reference_degC.empty() && model.inputs.size() != fitted.inputs.size())
    model.reference_degC.clear();
  return model;
}

}  // namespace thermocomp::identification
