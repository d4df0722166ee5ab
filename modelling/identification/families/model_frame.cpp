#include "modelling/identification/families/model_frame.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

namespace thermocomp::identification {
namespace {

using Names = std::vector<std::string>;

Names together(const Names& first, const Names& second) {
  Names all = first;
  for (const std::string& name : second)
    if (std::find(all.begin(), all.end(), name) == all.end()) all.push_back(name);
  return all;
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

ThermalModel in_frame(const ThermalModel& fitted, const ThermalModel& frame) {
  if (!frame.terms.empty() || !frame.guideways.empty() || frame.course ||
      !frame.covariance_K2.empty())
    throw std::runtime_error(
        "--like: that model has terms, guideways, a covariance or a course, which a fit cannot "
        "keep; "
        "name one with a matrix alone, as init writes it");
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
