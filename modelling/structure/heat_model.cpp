#include "modelling/structure/heat_model.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "modelling/structure/regions.hpp"

namespace thermocomp::structure {
namespace {

/// Adds the heat into each node per kelvin of the other side.
void add_inflow(std::span<const Coupling> couplings, std::vector<double>& inflow_W_per_K) {
  for (const Coupling& coupling : couplings) {
    for (std::size_t i = 0; i < coupling.count; ++i) {
      inflow_W_per_K[coupling.nodes[i]] += coupling.strength[0] * coupling.weight[i];
    }
  }
}

void scale(std::vector<Coupling>& couplings, double factor) {
  for (Coupling& coupling : couplings) coupling.strength = factor * coupling.strength;
}

std::vector<double> share_of(const HeatSpec& heat, const Mesh& mesh, RegionFinder& finder,
                             const std::vector<double>& volumes_m3) {
  std::vector<double> share(mesh.nodes_m.size(), 0.0);
  if (heat.inside) {
    // Volume integrals are larger at mid-side nodes; at corners they are zero in a tet10 and
    // negative in a hex20. Their sum is the volume all the same.
    for (const Index node : finder.nodes_in(heat.on)) share[node] = volumes_m3[node];
  } else {
    add_inflow(couplings_on(mesh, finder.faces_in(heat.on)), share);
  }
  double sum = 0.0;
  for (const double value : share) sum += value;
  if (sum > 0.0) {
    for (double& value : share) value /= sum;
  } else if (!finder.has_problems()) {
    finder.problem(heat.on.origin, "heat " + heat.name + " has neither area nor volume there");
  }
  return share;
}

/// Reports bodies without a heat path to room or coolant, which would warm without limit.
void check_cooling(const Structure& structure, const HeatModel& heat, RegionFinder& finder) {
  const std::vector<Index> bodies = bodies_of_nodes(structure.mesh);
  std::vector<Index> root(structure.mesh.nodes_m.size() + 1);
  for (Index i = 0; i < root.size(); ++i) root[i] = i;
  const std::function<Index(Index)> find = [&](Index i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  const auto air = static_cast<Index>(root.size() - 1);
  for (Index node = 0; node < bodies.size(); ++node) {
    for (const Weighted& master : heat.reduction.masters_of(node)) {
      root[find(bodies[node])] = find(bodies[master.node]);
    }
    if (heat.room_W_per_K[node] != 0.0) root[find(bodies[node])] = find(air);
  }
  for (const Coupling& coupling : heat.dry) {
    for (std::size_t i = 1; i < coupling.count; ++i) {
      root[find(bodies[coupling.nodes[i]])] = find(bodies[coupling.nodes[0]]);
    }
  }
  const std::vector<Index> parts = parts_of_nodes(structure.mesh);
  std::vector<bool> reported(structure.mesh.part_names.size(), false);
  for (Index node = 0; node < bodies.size(); ++node) {
    if (reported[parts[node]] || find(bodies[node]) == find(air)) continue;
    reported[parts[node]] = true;
    finder.problem({0, "convection", structure.mesh.part_names[parts[node]]},
                   "no heat can leave this part: it needs a [[convection]] to the room or a joint "
                   "that conducts");
  }
}

double signal_of(const HeatSpec& heat, const LoadCaseSpec& load) {
  if (!heat.signal) return heat.at;  // constant heat
  const auto found = load.signals.find(*heat.signal);
  return found == load.signals.end() ? 0.0 : found->second;
}

class CaseRun {
 public:
  CaseRun(const StructureSpec& spec, const HeatModel& heat, const LoadCaseSpec& load)
      : spec_(spec), heat_(heat), load_(load), sources_W_(heat.room_W_per_K.size(), 0.0) {
    for (std::size_t i = 0; i < spec.heats.size(); ++i) {
      const double power_W = heat_W(spec.heats[i], signal_of(spec.heats[i], load));
      for (std::size_t node = 0; node < sources_W_.size(); ++node) {
        sources_W_[node] += power_W * heat.shares[i][node];
      }
    }
  }

  /// Relative to the room's initial temperature, since the equations are linear.
  void fill(double time_s, HeatInput& input) const {
    const double share = load_.steady ? 1.0 : time_s / load_.duration_s;
    const double room_K = load_.room_change_K * share;
    const double coolant_K = spec_.coolant_degC - spec_.room_degC;
    for (std::size_t i = 0; i < sources_W_.size(); ++i) {
      input.load_W[i] = sources_W_[i] + heat_.room_W_per_K[i] * room_K +
                        (load_.coolant_on ? heat_.coolant_W_per_K[i] * coolant_K : 0.0);
    }
  }

 private:
  const StructureSpec& spec_;
  const HeatModel& heat_;
  const LoadCaseSpec& load_;
  std::vector<double> sources_W_;
};

void run_transient(const Conduction& conduction, const CaseRun& run, const LoadCaseSpec& load,
                   std::size_t index, std::vector<RiseField>& fields) {
  const auto steps = static_cast<long>(std::ceil(load.duration_s / load.step_s - 1e-9));
  const double step_s = load.duration_s / static_cast<double>(steps);
  TransientConduction transient(conduction, step_s, std::vector<double>(conduction.nodes(), 0.0));
  auto wanted = load.at_s.begin();
  std::vector<double> before_K = transient.temps_degC();
  for (long i = 0; i < steps && wanted != load.at_s.end(); ++i) {
    before_K = transient.temps_degC();
    const double begin_s = transient.time_s();
    transient.step([&](double time_s, double, HeatInput& input) { run.fill(time_s, input); });
    // Interpolates linearly to times between two steps.
    while (wanted != load.at_s.end() && *wanted <= transient.time_s() * (1.0 + 1e-9)) {
      const double share = std::clamp((*wanted - begin_s) / step_s, 0.0, 1.0);
      RiseField field{index, *wanted, transient.temps_degC()};
      for (std::size_t node = 0; node < before_K.size(); ++node) {
        field.rise_K[node] = before_K[node] + share * (field.rise_K[node] - before_K[node]);
      }
      fields.push_back(std::move(field));
      ++wanted;
    }
  }
}

}  // namespace

double heat_W(const HeatSpec& heat, double signal) {
  return heat.heat_W * std::pow(std::fabs(signal) / heat.at, heat.exponent);
}

HeatModel build_heat_model(const StructureSpec& spec, const Structure& structure) {
  const Mesh& mesh = structure.mesh;
  const std::size_t nodes = mesh.nodes_m.size();
  RegionFinder finder(mesh, spec.file.string());
  HeatModel heat{Reduction(static_cast<Index>(nodes), 1), {}, {}, std::vector<double>(nodes, 0.0),
                 std::vector<double>(nodes, 0.0),         {}, {}};
  for (const JointSpec& joint : spec.joints) {
    if (joint.bonded && !joint.conductance_W_per_m2_K) {
      tie_faces(finder, mesh, joint, heat.reduction);
    } else if (joint.conductance_W_per_m2_K.value_or(0.0) > 0.0) {
      auto contact = couplings_between(finder, mesh, joint);
      scale(contact, *joint.conductance_W_per_m2_K);
      heat.dry.insert(heat.dry.end(), contact.begin(), contact.end());
      heat.named.push_back({joint.name, BodyPartKind::joint, std::move(contact)});
    }
  }
  std::vector<Coupling> wet;
  for (const ConvectionSpec& convection : spec.convections) {
    auto couplings = couplings_on(mesh, finder.faces_in(convection.on));
    scale(couplings, convection.coefficient_W_per_m2_K);
    add_inflow(couplings, convection.to_coolant ? heat.coolant_W_per_K : heat.room_W_per_K);
    auto& all = convection.to_coolant ? wet : heat.dry;
    all.insert(all.end(), couplings.begin(), couplings.end());
    heat.named.push_back(
        {convection.on.origin.value + (convection.to_coolant ? "|coolant" : "|room"),
         convection.to_coolant ? BodyPartKind::coolant_film : BodyPartKind::room_film,
         std::move(couplings)});
  }
  const std::vector<double> volumes_m3 = nodal_volumes(mesh);
  for (const HeatSpec& source : spec.heats) {
    heat.shares.push_back(share_of(source, mesh, finder, volumes_m3));
  }
  finder.throw_problems();
  heat.flooded = heat.dry;
  heat.flooded.insert(heat.flooded.end(), wet.begin(), wet.end());
  check_cooling(structure, heat, finder);
  finder.throw_problems();
  heat.reduction.finish();
  return heat;
}

std::vector<RiseField> run_load_cases(const StructureSpec& spec, const Structure& structure,
                                      const HeatModel& heat, const Progress& progress) {
  std::unique_ptr<Conduction> dry, flooded;
  std::vector<RiseField> fields;
  for (std::size_t i = 0; i < spec.load_cases.size(); ++i) {
    const LoadCaseSpec& load = spec.load_cases[i];
    progress("load case " + load.name);
    auto& conduction = load.coolant_on ? flooded : dry;
    if (!conduction) {
      conduction =
          std::make_unique<Conduction>(structure.mesh, structure.material_of_part, heat.reduction,
                                       load.coolant_on ? heat.flooded : heat.dry);
    }
    const CaseRun run(spec, heat, load);
    if (load.steady) {
      const std::size_t nodes = structure.mesh.nodes_m.size();
      HeatInput input{std::vector<double>(nodes), std::vector<double>(nodes)};
      run.fill(0.0, input);
      fields.push_back({i, 0.0, conduction->steady_degC(input)});
    } else {
      run_transient(*conduction, run, load, i, fields);
    }
  }
  return fields;
}

}  // namespace thermocomp::structure
