#include "modelling/diagnosis/network/thermal_body.hpp"

#include <vector>

#include "modelling/structure/heat_model.hpp"
#include "modelling/structure/pictures.hpp"

namespace thermocomp::diagnosis {
struct ThermalBody::Parts {
  structure::StructureSpec spec;
  structure::Structure structure;
  structure::Statics statics;
  structure::BodyReduction reduction;
  structure::SurfacePicture picture;

  Parts(const std::filesystem::path& file, const structure::Progress& progress)
      : spec(structure::load_structure(file)),
        structure(structure::build_structure(spec, progress)),
        statics(structure.mesh, structure.material_of_part, structure.reduction, structure.springs),
        reduction(structure::reduce_body(spec, structure,
                                         structure::build_heat_model(spec, structure), statics,
                                         /*with_parts=*/true)),
        picture(spec, structure) {}

  void add(const std::string& group, double time_s, const Eigen::VectorXd& amplitudes) {
    std::vector<double> rise_K(structure.mesh.nodes_m.size(), 0.0);
    for (std::size_t state = 0; state < reduction.fields.size(); ++state)
      for (std::size_t node = 0; node < rise_K.size(); ++node)
        rise_K[node] +=
            amplitudes[static_cast<Eigen::Index>(state)] * reduction.fields[state][node];
    picture.add_state({group, group, time_s, "", {}, {}, {}}, rise_K,
                      statics.displacement_m(rise_K));
  }
};

ThermalBody::ThermalBody(const std::filesystem::path& structure,
                         const structure::Progress& progress)
    : parts_(std::make_unique<Parts>(structure, progress)) {}

ThermalBody::~ThermalBody() = default;

const ReducedBody& ThermalBody::body() const {
  return parts_->reduction.body;
}

void ThermalBody::show(const ThermalRuns& runs, const HeatNetwork& before,
                       const HeatNetwork& after) {
  const NetworkSimulation as_filed(before);
  const NetworkSimulation as_found(after);
  for (std::size_t i = 0; i < runs.runs.size(); ++i) {
    const ThermalRun& run = runs.runs[i];
    const Eigen::MatrixXd filed = as_filed.states(runs, i);
    const Eigen::MatrixXd found = as_found.states(runs, i);
    for (const std::size_t moment : structure::moments(static_cast<std::size_t>(run.begin),
                                                       static_cast<std::size_t>(run.rows() - 1))) {
      const auto row = static_cast<Eigen::Index>(moment);
      const double time_s = run.time_s[row] - run.time_s[run.begin];
      parts_->add(run.name + ", as in the file", time_s, filed.col(row) - filed.col(run.begin));
      if (found == filed) continue;  // no finding
      parts_->add(run.name + ", as found", time_s, found.col(row) - found.col(run.begin));
      parts_->add(run.name + ", what the findings change", time_s, found.col(row) - filed.col(row));
    }
  }
}

std::string ThermalBody::page(const std::string& title, const std::string& note) {
  parts_->picture.set_title(title, note);
  return parts_->picture.page();
}

}  // namespace thermocomp::diagnosis
