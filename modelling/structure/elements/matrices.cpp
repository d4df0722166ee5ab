#include "modelling/structure/elements/matrices.hpp"

#include <algorithm>

#include "estimator/checks.hpp"

namespace thermocomp::structure {
namespace {

class Neighbourhood {
 public:
  Neighbourhood(const Mesh& mesh, std::span<const Coupling> couplings)
      : mesh_(mesh), couplings_(couplings), start_(mesh.nodes_m.size() + 1, 0) {
    each([this](Index node, Index) { ++start_[node + 1]; });
    for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
    users_.resize(start_.back());
    std::vector<Index> next(start_.begin(), start_.end() - 1);
    each([&](Index node, Index user) { users_[next[node]++] = user; });
  }

  /// Nodes that share an element or a coupling with `node`; may repeat.
  template <class Action>
  void each_neighbour(Index node, const Action& action) const {
    const auto elements = static_cast<Index>(mesh_.elements.size());
    for (Index k = start_[node]; k < start_[node + 1]; ++k) {
      const Index user = users_[k];
      if (user < elements) {
        for (const Index other : mesh_.nodes_of(mesh_.elements[user])) action(other);
      } else {
        const Coupling& coupling = couplings_[user - elements];
        for (std::size_t i = 0; i < coupling.count; ++i) action(coupling.nodes[i]);
      }
    }
  }

 private:
  template <class Action>
  void each(const Action& action) const {
    Index user = 0;
    for (const Element& element : mesh_.elements) {
      for (const Index node : mesh_.nodes_of(element)) action(node, user);
      ++user;
    }
    for (const Coupling& coupling : couplings_) {
      for (std::size_t i = 0; i < coupling.count; ++i) action(coupling.nodes[i], user);
      ++user;
    }
  }

  const Mesh& mesh_;
  std::span<const Coupling> couplings_;
  std::vector<Index> start_;
  std::vector<Index> users_;
};

SparseSymmetric empty_matrix(const Mesh& mesh, std::span<const Coupling> couplings,
                             Index components) {
  const Neighbourhood neighbourhood(mesh, couplings);
  std::vector<Index> near;
  Index last_node = no_part;
  const auto neighbours = [&](Index column, std::vector<Index>& rows) {
    const Index node = column / components;
    if (node != last_node) {
      near.clear();
      neighbourhood.each_neighbour(node, [&](Index other) {
        if (other >= node) near.push_back(other);
      });
      std::sort(near.begin(), near.end());
      near.erase(std::unique(near.begin(), near.end()), near.end());
      last_node = node;
    }
    for (Index c = 0; c < components; ++c) rows.push_back(node * components + c);
    for (const Index other : near) {
      for (Index c = 0; c < components; ++c) rows.push_back(other * components + c);
    }
  };
  return SparseSymmetric::with_pattern(static_cast<Index>(mesh.nodes_m.size()) * components,
                                       neighbours);
}

/// Adds a 3 x 3 block at nodes (a, b), a >= b; a node's rows are consecutive in the pattern.
void add_block(SparseSymmetric& matrix, Index a, Index b, const std::array<Vec3, 3>& block) {
  for (Index column = 0; column < 3; ++column) {
    const Index full = 3 * b + column;
    const auto first = matrix.row.begin() + matrix.column_start[full];
    const auto last = matrix.row.begin() + matrix.column_start[full + 1];
    const Index top = a == b ? column : 0;  // the upper triangle is not stored
    const auto place = std::lower_bound(first, last, 3 * a + top);
    THERMOCOMP_ENSURE(place != last && *place == 3 * a + top);
    auto at = static_cast<std::size_t>(place - matrix.row.begin());
    for (Index row = top; row < 3; ++row) matrix.value[at++] += block[row][column];
  }
}

template <class Action>
void each_element(const Mesh& mesh, const Action& action) {
  for (const Element& element : mesh.elements) {
    const auto nodes = mesh.nodes_of(element);
    const NodeCoordinates at = coordinates_of(mesh, nodes);
    action(element, nodes, std::span<const Vec3>(at.data(), nodes.size()));
  }
}

/// Stiffness of an isotropic element from G = integral of (gradient a)(gradient b)^T:
/// K_ab = lambda G_ab + mu (G_ab^T + trace(G_ab) 1).
void add_stiffness(SparseSymmetric& matrix, const Element& element, std::span<const Index> nodes,
                   std::span<const Vec3> at, const Material& material) {
  const double nu = material.poisson_ratio;
  const double mu = material.youngs_modulus_Pa / (2.0 * (1.0 + nu));
  const double lambda = 2.0 * mu * nu / (1.0 - 2.0 * nu);
  using Block = std::array<Vec3, 3>;
  std::array<std::array<Block, shape_nodes_max>, shape_nodes_max> sums{};
  for (const RulePoint& point : shape_info(element.shape).slope_rule) {
    const Gradients g = gradients_at(at, point);
    for (std::size_t a = 0; a < nodes.size(); ++a) {
      const Vec3 scaled = g.volume * g.gradient[a];
      for (std::size_t b = 0; b <= a; ++b) {
        for (std::size_t i = 0; i < 3; ++i) {
          for (std::size_t j = 0; j < 3; ++j) sums[a][b][i][j] += scaled[i] * g.gradient[b][j];
        }
      }
    }
  }
  for (std::size_t a = 0; a < nodes.size(); ++a) {
    for (std::size_t b = 0; b <= a; ++b) {
      const Block& sum = sums[a][b];
      const double trace = sum[0][0] + sum[1][1] + sum[2][2];
      Block block{};
      const bool in_order = nodes[a] >= nodes[b];
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
          const double value = lambda * sum[i][j] + mu * sum[j][i] + (i == j ? mu * trace : 0.0);
          (in_order ? block[i][j] : block[j][i]) = value;
        }
      }
      add_block(matrix, std::max(nodes[a], nodes[b]), std::min(nodes[a], nodes[b]), block);
    }
  }
}

/// E alpha / (1 - 2 nu): stress of a restrained kelvin [Pa/K].
double thermal_stress_Pa_per_K(const Material& material) {
  return material.youngs_modulus_Pa * material.expansion_per_K /
         (1.0 - 2.0 * material.poisson_ratio);
}

}  // namespace

void Coupling::add(std::span<const Index> face_nodes, std::span<const double> values, double sign) {
  for (std::size_t i = 0; i < face_nodes.size(); ++i) {
    THERMOCOMP_ENSURE(count < nodes_max);
    nodes[count] = face_nodes[i];
    weight[count++] = sign * values[i];
  }
}

SparseSymmetric stiffness_matrix(const Mesh& mesh, std::span<const Material> material_of_part,
                                 std::span<const Coupling> couplings) {
  SparseSymmetric matrix = empty_matrix(mesh, couplings, 3);
  each_element(mesh, [&](const Element& element, auto nodes, auto at) {
    add_stiffness(matrix, element, nodes, at, material_of_part[element.part]);
  });
  for (const Coupling& coupling : couplings) {
    for (std::size_t a = 0; a < coupling.count; ++a) {
      for (std::size_t b = 0; b < coupling.count; ++b) {
        if (coupling.nodes[a] < coupling.nodes[b]) continue;
        for (Index c = 0; c < 3; ++c) {
          const double amount = coupling.strength[c] * coupling.weight[a] * coupling.weight[b];
          if (amount != 0.0)
            matrix.add(3 * coupling.nodes[a] + c, 3 * coupling.nodes[b] + c, amount);
        }
      }
    }
  }
  return matrix;
}

std::vector<double> thermal_load(const Mesh& mesh, std::span<const Material> material_of_part,
                                 std::span<const double> rise_K) {
  std::vector<double> load_N(3 * mesh.nodes_m.size(), 0.0);
  each_element(mesh, [&](const Element& element, auto nodes, auto at) {
    const double stress = thermal_stress_Pa_per_K(material_of_part[element.part]);
    for (const RulePoint& point : shape_info(element.shape).product_rule) {
      const Gradients g = gradients_at(at, point);
      double rise = 0.0;
      for (std::size_t a = 0; a < nodes.size(); ++a) rise += point.at.n[a] * rise_K[nodes[a]];
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        for (std::size_t c = 0; c < 3; ++c) {
          load_N[3 * std::size_t{nodes[a]} + c] += stress * rise * g.volume * g.gradient[a][c];
        }
      }
    }
  });
  return load_N;
}

std::vector<double> thermal_load_transposed(const Mesh& mesh,
                                            std::span<const Material> material_of_part,
                                            std::span<const double> v) {
  std::vector<double> result(mesh.nodes_m.size(), 0.0);
  each_element(mesh, [&](const Element& element, auto nodes, auto at) {
    const double stress = thermal_stress_Pa_per_K(material_of_part[element.part]);
    for (const RulePoint& point : shape_info(element.shape).product_rule) {
      const Gradients g = gradients_at(at, point);
      double divergence = 0.0;
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        const double* at_node = &v[3 * std::size_t{nodes[a]}];
        divergence += dot(g.gradient[a], {at_node[0], at_node[1], at_node[2]});
      }
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        result[nodes[a]] += stress * divergence * g.volume * point.at.n[a];
      }
    }
  });
  return result;
}

HeatMatrices heat_matrices(const Mesh& mesh, std::span<const Material> material_of_part,
                           std::span<const Coupling> couplings) {
  HeatMatrices heat{empty_matrix(mesh, couplings, 1), {}};
  heat.capacity = heat.conduction;
  const auto add = [](SparseSymmetric& matrix, Index a, Index b, double amount) {
    if (a >= b) matrix.add(a, b, amount);
  };
  each_element(mesh, [&](const Element& element, auto nodes, auto at) {
    const Material& material = material_of_part[element.part];
    const double capacity_J_per_m3_K =
        material.density_kg_per_m3 * material.heat_capacity_J_per_kg_K;
    std::array<std::array<double, shape_nodes_max>, shape_nodes_max> conduct{};
    std::array<std::array<double, shape_nodes_max>, shape_nodes_max> store{};
    for (const RulePoint& point : shape_info(element.shape).slope_rule) {
      const Gradients g = gradients_at(at, point);
      const double scale = material.conductivity_W_per_m_K * g.volume;
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        for (std::size_t b = 0; b < nodes.size(); ++b) {
          conduct[a][b] += scale * dot(g.gradient[a], g.gradient[b]);
        }
      }
    }
    for (const RulePoint& point : shape_info(element.shape).product_rule) {
      const double scale = capacity_J_per_m3_K * gradients_at(at, point).volume;
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        for (std::size_t b = 0; b < nodes.size(); ++b) {
          store[a][b] += scale * point.at.n[a] * point.at.n[b];
        }
      }
    }
    for (std::size_t a = 0; a < nodes.size(); ++a) {
      for (std::size_t b = 0; b < nodes.size(); ++b) {
        add(heat.conduction, nodes[a], nodes[b], conduct[a][b]);
        add(heat.capacity, nodes[a], nodes[b], store[a][b]);
      }
    }
  });
  for (const Coupling& coupling : couplings) {
    for (std::size_t a = 0; a < coupling.count; ++a) {
      for (std::size_t b = 0; b < coupling.count; ++b) {
        add(heat.conduction, coupling.nodes[a], coupling.nodes[b],
            coupling.strength[0] * coupling.weight[a] * coupling.weight[b]);
      }
    }
  }
  return heat;
}

std::vector<double> nodal_volumes(const Mesh& mesh) {
  std::vector<double> volumes_m3(mesh.nodes_m.size(), 0.0);
  each_element(mesh, [&](const Element& element, auto nodes, auto at) {
    for (const RulePoint& point : shape_info(element.shape).product_rule) {
      const double volume = gradients_at(at, point).volume;
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        volumes_m3[nodes[a]] += point.at.n[a] * volume;
      }
    }
  });
  return volumes_m3;
}

}  // namespace thermocomp::structure
