#include "tied_structure.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "config/toml/toml_reader.hpp"
#include "estimator/checks.hpp"
#include "modelling/identification/printed.hpp"
#include "modelling/structure/solve/statics.hpp"
#include "modelling/structure/structure_model.hpp"

namespace thermocomp::gate_tests {

using namespace thermocomp::structure;

namespace {

constexpr double depth_mm = 60.0;  // of a column
constexpr double width_mm = 80.0;
constexpr double tie_length_mm = 400.0;
constexpr double tie_high_mm = 12.5;  // height of the file's tie; a larger area first widens it
constexpr double above_tie_mm = 40.0;
// Sizes of refined elements: the first two at an edge, those of a tie; and the smallest distance.
constexpr double edge_mm = 5.0;
constexpr double edge_next_mm = 14.0;
constexpr double tie_size_mm = 6.25;
constexpr double nearest_planes_mm = 2.0;
constexpr double mm = 1e3;
constexpr double um = 1e6;
constexpr Index first_tie_part = 2;

void replace(std::string& text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  THERMOCOMP_ENSURE(at != std::string::npos);
  text.replace(at, what.size(), by);
}

struct TieSection {
  double wide_mm;
  double high_mm;
};

/// Widens the tie to its area, up to the column's depth, then increases its height.
TieSection section_of(const FiniteTie& tie) {
  const double wide_mm = std::min(depth_mm, tie.area_mm2 / tie_high_mm);
  return {wide_mm, tie.area_mm2 / wide_mm};
}

std::string box_of(const FiniteTie& tie) {
  const auto [wide, high] = section_of(tie);
  const auto corner = [&tie, half_wide = wide / 2, half_high = high / 2](double x, double sign) {
    return identification::printed("[%f, %f, %f]", x, depth_mm / 2 + sign * half_wide,
                                   tie.height_mm + sign * half_high);
  };
  return "from_mm = " + corner(width_mm, -1) + "\nto_mm = " + corner(width_mm + tie_length_mm, 1) +
         "\n";
}

std::string text_of_tie(const std::string& name, const FiniteTie& tie) {
  std::string text = identification::printed(
      "[[part]]\nname = \"%s\"\nmaterial = \"steel\"\nsize_mm = [20, 12, 12.5]\n[[part.box]]\n%s",
      name.c_str(), box_of(tie).c_str());
  for (const auto& [column, x] : {std::pair{"warm_column", "80"}, std::pair{"cold_column", "480"}})
    text += identification::printed(
        "[[joint]]\nname = \"%s_on_%s\"\nfrom = { part = \"%s\", x_mm = [%s, %s] }\n"
        "to = { part = \"%s\", x_mm = [%s, %s] }\nconductance_W_per_m2_K = 10000.0\n",
        name.c_str(), column, name.c_str(), x, x, column, x, x);
  return text;
}

/// Adds planes of elements as ends of boxes inside the part.
void add_planes(PartSpec& part, std::size_t axis, std::vector<double> planes_mm) {
  Box whole = part.boxes.front().box;
  whole.high_m[2] = part.boxes.back().box.high_m[2];
  std::sort(planes_mm.begin(), planes_mm.end());
  double last_mm = mm * whole.low_m[axis];
  for (const double plane_mm : planes_mm) {
    if (plane_mm - last_mm < nearest_planes_mm ||
        mm * whole.high_m[axis] - plane_mm < nearest_planes_mm)
      continue;
    BoxShape box{whole, false};
    box.box.high_m[axis] = plane_mm / mm;
    part.boxes.push_back(box);
    last_mm = plane_mm;
  }
}

/// Small elements at the feet's edges, which hold the columns crosswise, and at the ties' ends.
void refine(StructureSpec& spec, std::size_t ties) {
  const auto between = [](double low_mm, double high_mm) {
    return std::vector<double>{low_mm + edge_mm, low_mm + edge_next_mm, high_mm - edge_next_mm,
                               high_mm - edge_mm};
  };
  std::vector<double> depth_planes_mm = between(0.0, depth_mm);
  std::vector<double> height_planes_mm{edge_mm, edge_next_mm};
  for (Index tie = first_tie_part; tie < first_tie_part + ties; ++tie) {
    PartSpec& part = spec.parts[tie];
    const Box box = part.boxes.front().box;
    part.size_m = {part.size_m[0], tie_size_mm / mm, tie_size_mm / mm};
    add_planes(part, 0, between(mm * box.low_m[0], mm * box.high_m[0]));
    for (const double share : {0.0, 0.5, 1.0}) {
      depth_planes_mm.push_back(mm * std::lerp(box.low_m[1], box.high_m[1], share));
      height_planes_mm.push_back(mm * std::lerp(box.low_m[2], box.high_m[2], share));
    }
    height_planes_mm.push_back(mm * box.low_m[2] - edge_next_mm + edge_mm);
    height_planes_mm.push_back(mm * box.high_m[2] + edge_next_mm - edge_mm);
  }
  for (const std::size_t column : {0U, 1U}) {
    PartSpec& part = spec.parts[column];
    const Box box = part.boxes.front().box;
    add_planes(part, 0, between(mm * box.low_m[0], mm * box.high_m[0]));
    add_planes(part, 1, depth_planes_mm);
    add_planes(part, 2, height_planes_mm);
  }
}

StructureSpec spec_of(const std::vector<FiniteTie>& ties) {
  std::string text = read_text_file(THERMOCOMP_GATE_STRUCTURE);
  replace(text, "from_mm = [80, 24, 243.75]", "");
  replace(text, "to_mm = [480, 36, 256.25]\n", box_of(ties.front()));
  for (std::size_t i = 1; i < ties.size(); ++i)
    text += text_of_tie("tie_" + std::to_string(i + 1), ties[i]);
  StructureSpec spec = parse_structure(text, THERMOCOMP_GATE_STRUCTURE);
  for (const FiniteTie& tie : ties)
    for (const std::size_t column : {0U, 1U}) {
      double& top_m = spec.parts[column].boxes.back().box.high_m[2];
      top_m = std::max(top_m, (tie.height_mm + above_tie_mm) / mm);
    }
  std::erase_if(spec.sensors,
                [](const SensorSpec& sensor) { return sensor.name.starts_with("tie_"); });
  refine(spec, ties.size());
  return spec;
}

identification::TiedColumns beams_of(const StructureSpec& spec,
                                     const std::vector<FiniteTie>& ties) {
  const Material& material = spec.materials[spec.parts.front().material];
  identification::TiedColumns columns;
  columns.working_height_mm = mm * spec.outputs.front().places.front().at_m.front()[2];
  columns.heated_height_mm = mm * spec.parts.front().boxes.front().box.high_m[2];
  columns.column_width_mm = width_mm;
  columns.column_inertia_mm4 = depth_mm * width_mm * width_mm * width_mm / 12.0;
  columns.column_modulus_MPa = 1e-6 * material.youngs_modulus_Pa;
  columns.column_expansion_per_K = material.expansion_per_K;
  columns.column_poisson_ratio = material.poisson_ratio;
  columns.column_shear_compliance_per_N =
      2.0 * (1.0 + material.poisson_ratio) /
      (columns.column_modulus_MPa *
       identification::rectangle_shear_area_mm2(width_mm, depth_mm, depth_mm));
  columns.foot_length_mm =
      identification::held_foot_length_mm(width_mm, depth_mm, material.poisson_ratio);
  for (const FiniteTie& tie : ties)
    columns.ties.push_back({tie.height_mm, tie_length_mm, tie.area_mm2, columns.column_modulus_MPa,
                            columns.column_expansion_per_K, section_of(tie).high_mm});
  return columns;
}

}  // namespace

struct TiedStructure::Parts {
  explicit Parts(const std::vector<FiniteTie>& ties)
      : spec(spec_of(ties)),
        beams(beams_of(spec, ties)),
        structure(build_structure(spec, [](std::string_view) {})) {
    const Statics statics(structure.mesh, structure.material_of_part, structure.reduction,
                          structure.springs);
    sensitivity_m_per_K = statics.sensitivities(structure.rows).front();
  }

  [[nodiscard]] double displacement_um(const std::vector<double>& field_K) const {
    double sum_um = 0.0;
    for (std::size_t i = 0; i < field_K.size(); ++i)
      sum_um += um * sensitivity_m_per_K[i] * field_K[i];
    return sum_um;
  }
  /// Linear across the heated zone, to 0 within the element rows above and below its top.
  [[nodiscard]] std::vector<double> linear_field() const {
    const auto belongs = nodes_of_part(structure.mesh, 0);
    const double top_m = beams.heated_height_mm / mm;
    const double row_m = spec.parts.front().size_m[2];
    std::vector<double> field(belongs.size(), 0.0);
    for (std::size_t i = 0; i < field.size(); ++i) {
      if (!belongs[i]) continue;
      const Vec3& place_m = structure.mesh.nodes_m[i];
      const double warm = std::clamp((top_m - place_m[2]) / (2.0 * row_m) + 0.5, 0.0, 1.0);
      field[i] = warm * (0.5 - place_m[0] * mm / width_mm);
    }
    return field;
  }

  StructureSpec spec;
  identification::TiedColumns beams;
  Structure structure;
  std::vector<double> sensitivity_m_per_K;
};

TiedStructure::TiedStructure(const std::vector<FiniteTie>& ties)
    : parts_(std::make_unique<Parts>(ties)) {}
TiedStructure::~TiedStructure() = default;

const identification::TiedColumns& TiedStructure::columns() const {
  return parts_->beams;
}

identification::TiedCoefficients TiedStructure::coefficients() const {
  identification::TiedCoefficients k{parts_->displacement_um(parts_->linear_field()), {}};
  for (std::size_t j = 0; j < parts_->beams.ties.size(); ++j) {
    const auto belongs =
        nodes_of_part(parts_->structure.mesh, first_tie_part + static_cast<Index>(j));
    k.kc_um_per_K.push_back(
        -parts_->displacement_um(std::vector<double>(belongs.begin(), belongs.end())));
  }
  return k;
}

}  // namespace thermocomp::gate_tests
