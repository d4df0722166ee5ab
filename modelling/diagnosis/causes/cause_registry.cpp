#include <algorithm>
#include <memory>

#include "config/text/units.hpp"
#include "estimator/checks.hpp"
#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Least rows of a run in which faults of this run are sought.
constexpr Eigen::Index fault_rows_min = 24;

}  // namespace

const std::vector<Cause>& all_causes() {
  static const std::vector<Cause> all = [] {
    std::vector<Cause> joined;
    for (const auto family : {causes::of_structure, causes::of_heat, causes::of_datum,
                              causes::of_sensor, causes::of_network})
      for (Cause& each : family()) joined.push_back(std::move(each));
    return joined;
  }();
  return all;
}

const CauseParameter* find_parameter(const Cause& cause, std::string_view name) {
  const auto at = std::find_if(cause.parameters.begin(), cause.parameters.end(),
                               [&](const CauseParameter& each) { return each.name == name; });
  return at == cause.parameters.end() ? nullptr : &*at;
}

const Cause& cause_named(std::string_view name) {
  const std::vector<Cause>& all = all_causes();
  const auto at =
      std::find_if(all.begin(), all.end(), [&](const Cause& each) { return each.name == name; });
  THERMOCOMP_ENSURE(at != all.end());
  return *at;
}

std::vector<Hypothesis> hypotheses(const MeasuredData& data) {
  const auto material = std::make_shared<Material>(data);
  std::vector<Hypothesis> all;
  const auto add = [&](const Subject& subject) {
    for (const Cause& cause : all_causes()) {
      if (cause.hypotheses == nullptr) continue;
      for (Hypothesis& each : cause.hypotheses(*material, subject)) {
        each.cause = cause.name;
        // `effect` refers to the material, which `columns` keeps alive.
        each.columns = [material, effect = each.effect, run = each.run](const Shapes& shapes,
                                                                        std::size_t output) {
          return stacked(
              material->data(), [&](const MeasuredRun& of) { return effect(of, shapes, output); },
              run);
        };
        all.push_back(std::move(each));
      }
    }
  };
  const auto add_moving = [&](const Subject& subject) {
    if (material->moves_anywhere(material->values_of(subject))) add(subject);
  };
  const std::size_t inputs = data.model.inputs.size();
  for (std::size_t i = 0; i < data.temperatures.size(); ++i)
    add_moving({i < inputs ? SubjectKind::input : SubjectKind::other_temperature, i});
  for (std::size_t i = 0; i < data.signals.size(); ++i)
    if (kind_of(data.signals[i]) == QuantityKind::signal) add_moving({SubjectKind::signal, i});
  for (std::size_t i = 0; i < data.model.outputs.size(); ++i) add({SubjectKind::output, i});
  for (std::size_t run = 0; run < data.runs.size(); ++run) {
    const Block& rows = data.rows.runs[run];
    if (rows.end - rows.begin < fault_rows_min) continue;
    for (std::size_t i = 0; i < data.model.outputs.size(); ++i)
      add({SubjectKind::output_in_run, i, run});
    for (std::size_t i = 0; i < inputs; ++i) add({SubjectKind::input_in_run, i, run});
  }
  return all;
}

}  // namespace thermocomp::diagnosis
