#include "gate_structure.hpp"

#include <algorithm>
#include <string_view>
#include <vector>

#include "estimator/checks.hpp"
#include "modelling/structure/heat_model.hpp"
#include "modelling/structure/solve/locate.hpp"
#include "modelling/structure/solve/statics.hpp"
#include "modelling/structure/structure_model.hpp"

namespace thermocomp::bench {

using namespace thermocomp::structure;

namespace {

constexpr double above_tie_m = 0.04;  ///< column's end above tie or working point
constexpr double um = 1e6;
constexpr double mm = 1e3;

PartSpec& part_of(StructureSpec& spec, std::string_view name) {
  const auto found = std::find_if(spec.parts.begin(), spec.parts.end(),
                                  [&](const PartSpec& part) { return part.name == name; });
  THERMOCOMP_ENSURE(found != spec.parts.end());
  return *found;
}

/// The file's machine with its tie at another height.
StructureSpec with_tie_at(double height_m) {
  StructureSpec spec = load_structure(THERMOCOMP_GATE_STRUCTURE);
  Box& tie = part_of(spec, "tie").boxes.front().box;
  const double half_m = (tie.high_m[2] - tie.low_m[2]) / 2.0;
  tie.low_m[2] = height_m - half_m;
  tie.high_m[2] = height_m + half_m;
  for (SensorSpec& sensor : spec.sensors)
    if (sensor.name.starts_with("tie_")) sensor.place.at_m.front()[2] = height_m;
  for (const char* name : {"warm_column", "cold_column"}) {
    Box& top = part_of(spec, name).boxes.back().box;
    top.high_m[2] = std::max(top.high_m[2], height_m + above_tie_m);
  }
  return spec;
}

identification::TiedColumns beams_of(StructureSpec& spec) {
  const auto& column = part_of(spec, "warm_column");
  const Box& zone = column.boxes.front().box;
  const Box& tie = part_of(spec, "tie").boxes.front().box;
  const Material& material = spec.materials[column.material];
  const double width_mm = mm * (zone.high_m[0] - zone.low_m[0]);
  const double depth_mm = mm * (zone.high_m[1] - zone.low_m[1]);
  identification::TiedColumns m;
  m.working_height_mm = mm * spec.outputs.front().places.front().at_m.front()[2];
  m.heated_height_mm = mm * zone.high_m[2];
  m.column_width_mm = width_mm;
  m.column_inertia_mm4 = depth_mm * width_mm * width_mm * width_mm / 12.0;
  m.column_modulus_MPa = 1e-6 * material.youngs_modulus_Pa;
  m.column_expansion_per_K = material.expansion_per_K;
  m.ties = {{mm * (tie.low_m[2] + tie.high_m[2]) / 2.0, mm * (tie.high_m[0] - tie.low_m[0]),
             mm * mm * (tie.high_m[1] - tie.low_m[1]) * (tie.high_m[2] - tie.low_m[2]),
             m.column_modulus_MPa, m.column_expansion_per_K}};
  return m;
}

double at(std::span<const Weighted> place, std::span<const double> field) {
  double sum = 0.0;
  for (const Weighted& node : place) sum += node.weight * field[node.node];
  return sum;
}

}  // namespace

struct GateStructure::Parts {
  Parts(double tie_height_mm, double each_step_s)
      : spec(with_tie_at(tie_height_mm / mm)),
        beams(beams_of(spec)),
        structure(build_structure(spec, [](std::string_view) {})),
        heat(build_heat_model(spec, structure)),
        empty(structure.mesh, structure.material_of_part, heat.reduction, heat.dry),
        filled(structure.mesh, structure.material_of_part, heat.reduction, heat.flooded),
        step_s(each_step_s),
        rise_K(structure.mesh.nodes_m.size(), 0.0) {
    const Statics statics(structure.mesh, structure.material_of_part, structure.reduction,
                          structure.springs);
    sensitivity_m_per_K = statics.sensitivities(structure.rows).front();
    for (const SensorSpec& sensor : spec.sensors) {
      const auto found = locate_in_part(structure.mesh, sensor.place.part,
                                        sensor.place.at_m.front(), sensor.place.tolerance_m);
      THERMOCOMP_ENSURE(found.has_value());
      sensors.push_back(found->nodes);
    }
  }

  [[nodiscard]] double displacement_um(std::span<const double> field_K) const {
    double sum_um = 0.0;
    for (std::size_t i = 0; i < field_K.size(); ++i)
      sum_um += um * sensitivity_m_per_K[i] * field_K[i];
    return sum_um;
  }

  /// Linear across the heated zone; ends within the rows of elements above and below its top.
  [[nodiscard]] std::vector<double> linear_field() const {
    const auto belongs = nodes_of_part(structure.mesh, 0);
    const double top_m = beams.heated_height_mm / mm;
    const double row_m = spec.parts.front().size_m[2];
    std::vector<double> field(belongs.size(), 0.0);
    for (std::size_t i = 0; i < field.size(); ++i) {
      if (!belongs[i]) continue;
      const Vec3& place_m = structure.mesh.nodes_m[i];
      const double warm = std::clamp((top_m - place_m[2]) / (2.0 * row_m) + 0.5, 0.0, 1.0);
      field[i] = warm * (0.5 - place_m[0] * mm / beams.column_width_mm);
    }
    return field;
  }

  StructureSpec spec;
  identification::TiedColumns beams;
  Structure structure;
  HeatModel heat;
  Conduction empty;  ///< the tank
  Conduction filled;
  double step_s;
  std::vector<double> rise_K;
  std::vector<double> sensitivity_m_per_K;
  std::vector<std::vector<Weighted>> sensors;  ///< A, B, then those of the tie
  std::unique_ptr<TransientConduction> course;
  bool oil_was_in{false};
};

GateStructure::GateStructure(double tie_height_mm, double step_s)
    : parts_(std::make_unique<Parts>(tie_height_mm, step_s)) {}
GateStructure::~GateStructure() = default;

const identification::TiedColumns& GateStructure::columns() const {
  return parts_->beams;
}

identification::TiedCoefficients GateStructure::coefficients() const {
  const auto in_tie = nodes_of_part(parts_->structure.mesh, 2);
  const std::vector<double> tie(in_tie.begin(), in_tie.end());
  return {parts_->displacement_um(parts_->linear_field()), {-parts_->displacement_um(tie)}};
}

void GateStructure::advance(const Oil& oil) {
  Parts& parts = *parts_;
  if (!parts.course || oil.in_tank != parts.oil_was_in) {
    parts.course = std::make_unique<TransientConduction>(oil.in_tank ? parts.filled : parts.empty,
                                                         parts.step_s, parts.rise_K);
    parts.oil_was_in = oil.in_tank;
  }
  const double oil_K = oil.in_tank ? oil.temp_degC - parts.spec.room_degC : 0.0;
  parts.course->step([&](double, double, HeatInput& input) {
    for (std::size_t i = 0; i < input.load_W.size(); ++i)
      input.load_W[i] = parts.heat.coolant_W_per_K[i] * oil_K;
  });
  parts.rise_K = parts.course->temps_degC();
}

double GateStructure::theta_a_K() const {
  return at(parts_->sensors[0], parts_->rise_K);
}
double GateStructure::theta_b_K() const {
  return at(parts_->sensors[1], parts_->rise_K);
}
double GateStructure::theta_c_K() const {
  double sum_K = 0.0;
  for (std::size_t i = 2; i < parts_->sensors.size(); ++i)
    sum_K += at(parts_->sensors[i], parts_->rise_K);
  return sum_K / static_cast<double>(parts_->sensors.size() - 2);
}
double GateStructure::displacement_um() const {
  return parts_->displacement_um(parts_->rise_K);
}

}  // namespace thermocomp::bench
