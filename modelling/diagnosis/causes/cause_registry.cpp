#include <algorithm>
#include <memory>

#include "config/text/units.hpp"
#include "estimator/checks.hpp"
#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Of a run in which a fault of this run alone is sought.
constexpr Eigen::Index fault_rows_min = 24;

/// Writes every cause with every subject of one set of data.
class Catalogue {
 public:
  explicit Catalogue(const Material& material) : material_(material) {
    const std::size_t inputs = material.data().model.inputs.size();
    found_.reserve(inputs * (inputs + 1) / 2 + 16 * inputs);  // most are exchanged channels
  }

  std::vector<Hypothesis> all() {
    const MeasuredData& data = material_.data();
    for (std::size_t i = 0; i < data.model.inputs.size(); ++i) add_moving({SubjectKind::input, i});
    for (std::size_t i = 0; i < data.others.size(); ++i)
      add_moving({SubjectKind::other_temperature, i});
    for (std::size_t i = 0; i < data.signals.size(); ++i)
      if (kind_of(data.signals[i]) == QuantityKind::signal) add_moving({SubjectKind::signal, i});
    for (std::size_t i = 0; i < data.model.outputs.size(); ++i) add({SubjectKind::output, i});
    for (std::size_t run = 0; run < data.runs.size(); ++run) {
      const Block& rows = material_.rows().runs[run];
      if (rows.end - rows.begin < fault_rows_min) continue;
      for (std::size_t i = 0; i < data.model.outputs.size(); ++i)
        add({SubjectKind::output_in_run, i, run});
      for (std::size_t i = 0; i < data.model.inputs.size(); ++i)
        add({SubjectKind::input_in_run, i, run});
    }
    return std::move(found_);
  }

 private:
  void add(const Subject& subject) {
    for (const Cause& cause : all_causes()) {
      if (cause.hypotheses == nullptr) continue;
      for (Hypothesis& each : cause.hypotheses(material_, subject)) {
        each.cause = cause.name;
        found_.push_back(std::move(each));
      }
    }
  }

  void add_moving(const Subject& subject) {
    if (material_.moves_anywhere(material_.values_of(subject))) add(subject);
  }

  const Material& material_;
  std::vector<Hypothesis> found_;
};

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

const Cause* find_cause(std::string_view name) {
  const std::vector<Cause>& all = all_causes();
  const auto at =
      std::find_if(all.begin(), all.end(), [&](const Cause& each) { return each.name == name; });
  return at == all.end() ? nullptr : &*at;
}

const Cause& cause_named(std::string_view name) {
  const Cause* const cause = find_cause(name);
  THERMOCOMP_ENSURE(cause != nullptr);
  return *cause;
}

std::vector<Hypothesis> hypotheses(const MeasuredData& data, const StackedRows& rows) {
  // The hypotheses keep the material alive.
  const auto material = std::make_shared<Material>(data, rows);
  std::vector<Hypothesis> all = Catalogue(*material).all();
  for (Hypothesis& hypothesis : all)
    hypothesis.columns = [material, columns = std::move(hypothesis.columns)](const Shapes& shapes,
                                                                             std::size_t output) {
      return columns(shapes, output);
    };
  return all;
}

}  // namespace thermocomp::diagnosis
