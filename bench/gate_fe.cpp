#include "gate_fe.hpp"

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>

namespace thermocomp::bench {
namespace {

using identification::GateMachine;
using identification::TieCoefficients;
using Sparse = Eigen::SparseMatrix<double>;
using Vector = Eigen::VectorXd;

constexpr int across = 6;  // elements over the width
constexpr double poisson = 0.3;
constexpr double conductivity_W_per_mK = 50.0;
constexpr double heat_J_per_m3K = 7800.0 * 460.0;
constexpr double air_W_per_m2K = 12.0;
constexpr double tie_ends_W_per_K = 1.5;  // contact of the tie with each column
constexpr double warm_air_share = 0.3;    // of the tank's rise, around the tie
constexpr int tie_nodes = 10;

/// Corners, then middles of sides, of the reference square.
constexpr std::array<std::array<double, 2>, 8> places{
    {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {0, -1}, {1, 0}, {0, 1}, {-1, 0}}};

struct Shape {
  Eigen::Matrix<double, 8, 1> value;
  Eigen::Matrix<double, 8, 2> slope;  ///< by the reference coordinates
};

Shape shape_at(double r, double s) {
  Shape shape;
  for (int i = 0; i < 8; ++i) {
    const double a = places[static_cast<std::size_t>(i)][0];
    const double b = places[static_cast<std::size_t>(i)][1];
    if (i < 4) {
      shape.value[i] = 0.25 * (1 + r * a) * (1 + s * b) * (r * a + s * b - 1);
      shape.slope(i, 0) = 0.25 * a * (1 + s * b) * (2 * r * a + s * b);
      shape.slope(i, 1) = 0.25 * b * (1 + r * a) * (2 * s * b + r * a);
    } else if (a == 0) {
      shape.value[i] = 0.5 * (1 - r * r) * (1 + s * b);
      shape.slope(i, 0) = -r * (1 + s * b);
      shape.slope(i, 1) = 0.5 * (1 - r * r) * b;
    } else {
      shape.value[i] = 0.5 * (1 + r * a) * (1 - s * s);
      shape.slope(i, 0) = 0.5 * a * (1 - s * s);
      shape.slope(i, 1) = -s * (1 + r * a);
    }
  }
  return shape;
}

constexpr std::array<double, 3> gauss{-0.774596669241483377, 0.0, 0.774596669241483377};
constexpr std::array<double, 3> weight{5.0 / 9, 8.0 / 9, 5.0 / 9};

/// Stiffness, forces of temperatures, conductance and capacity of one element.
struct ElementMatrices {
  Eigen::Matrix<double, 16, 16> ke = Eigen::Matrix<double, 16, 16>::Zero();
  Eigen::Matrix<double, 16, 8> fe = Eigen::Matrix<double, 16, 8>::Zero();
  Eigen::Matrix<double, 8, 8> he = Eigen::Matrix<double, 8, 8>::Zero();
  Eigen::Matrix<double, 8, 8> ce = Eigen::Matrix<double, 8, 8>::Zero();
};

using Triplet = Eigen::Triplet<double>;

void build(Sparse& matrix, int rows, int columns, const std::vector<Triplet>& from) {
  matrix.resize(rows, columns);
  matrix.setFromTriplets(from.begin(), from.end());
}

int dof(int node, int direction) {
  return 2 * node + direction;
}

}  // namespace

/// Lengths in m here. Node (i, j) of a grid of half elements; centres of elements are not used.
struct GateFe::Parts {
  Parts(const GateMachine& gate, double depth_mm)
      : machine(gate),
        depth_m(depth_mm * 1e-3),
        width_m(gate.column_width_mm * 1e-3),
        height_m(1.02e-3 * std::max(gate.working_height_mm, gate.tie_height_mm)),
        up(2 * static_cast<int>(std::lround(height_m / width_m * 3.0)) + 8) {
    number.assign(static_cast<std::size_t>(2 * across + 1) * static_cast<std::size_t>(2 * up + 1),
                  -1);
    for (int j = 0; j <= 2 * up; ++j)
      for (int i = 0; i <= 2 * across; ++i)
        if (i % 2 == 0 || j % 2 == 0) number[index(i, j)] = nodes++;
    assemble();
    rise = Vector::Zero(nodes);
    tie_rise = Vector::Zero(tie_nodes);
    work = influence(machine.working_height_mm * 1e-3);
    tie = influence(machine.tie_height_mm * 1e-3);
  }

  [[nodiscard]] std::size_t index(int i, int j) const {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(2 * across + 1) +
           static_cast<std::size_t>(i);
  }
  [[nodiscard]] int node(int i, int j) const { return number[index(i, j)]; }
  [[nodiscard]] double x_m(int i) const { return width_m * i / (2.0 * across); }
  [[nodiscard]] double y_m(int j) const { return height_m * j / (2.0 * up); }

  struct Element {
    std::array<int, 8> nodes{};
  };
  [[nodiscard]] Element element(int a, int b) const {
    Element e;
    for (std::size_t i = 0; i < 8; ++i)
      e.nodes[i] = node(2 * a + 1 + static_cast<int>(places[i][0]),
                        2 * b + 1 + static_cast<int>(places[i][1]));
    return e;
  }

  void assemble();
  [[nodiscard]] ElementMatrices matrices_of(const Eigen::Matrix3d& elastic, double half_x,
                                            double half_y) const;
  void add_sides();
  [[nodiscard]] Vector influence(double at_m) const;
  [[nodiscard]] double at_middle(const Vector& field, double height) const;
  [[nodiscard]] double thermal(const Vector& w, const Vector& theta) const {
    return w.dot(expansion * theta);
  }
  [[nodiscard]] double displacement_um(const Vector& theta, double tie_K) const;
  [[nodiscard]] double at_side(bool side_a, double height) const;

  GateMachine machine;
  double depth_m;
  double width_m;
  double height_m;
  int up;
  int nodes{0};
  std::vector<int> number;
  Sparse stiffness;    ///< shape (2 nodes) squared, clamped at the bottom
  Sparse expansion;    ///< forces of temperatures, shape (2 nodes, nodes)
  Sparse conductance;  ///< W/K
  Sparse capacity;     ///< J/K
  Sparse oil_surface;  ///< m^2, consistent
  Sparse air_surface;
  Eigen::SimplicialLDLT<Sparse> solver;
  Vector work;  ///< displacements under a unit force across at the working height
  Vector tie;   ///< ... and at the tie
  Vector rise;
  Vector tie_rise;
};

ElementMatrices GateFe::Parts::matrices_of(const Eigen::Matrix3d& elastic, double half_x,
                                           double half_y) const {
  ElementMatrices m;
  for (std::size_t g = 0; g < 9; ++g) {
    const Shape shape = shape_at(gauss[g % 3], gauss[g / 3]);
    const double volume = weight[g % 3] * weight[g / 3] * half_x * half_y * depth_m;
    const Eigen::Matrix<double, 8, 1> dx = shape.slope.col(0) / half_x;
    const Eigen::Matrix<double, 8, 1> dy = shape.slope.col(1) / half_y;
    Eigen::Matrix<double, 3, 16> strain = Eigen::Matrix<double, 3, 16>::Zero();
    for (Eigen::Index i = 0; i < 8; ++i) {
      strain(0, 2 * i) = strain(2, 2 * i + 1) = dx[i];
      strain(1, 2 * i + 1) = strain(2, 2 * i) = dy[i];
    }
    m.ke += volume * strain.transpose() * elastic * strain;
    const Eigen::Vector3d free(machine.column_expansion_per_K, machine.column_expansion_per_K, 0);
    m.fe += volume * strain.transpose() * elastic * free * shape.value.transpose();
    m.he += volume * conductivity_W_per_mK * (dx * dx.transpose() + dy * dy.transpose());
    m.ce += volume * heat_J_per_m3K * shape.value * shape.value.transpose();
  }
  return m;
}

void GateFe::Parts::assemble() {
  std::vector<Triplet> k;
  std::vector<Triplet> f;
  std::vector<Triplet> conduct;
  std::vector<Triplet> store;
  const double modulus_Pa = machine.column_modulus_MPa * 1e6;
  Eigen::Matrix3d elastic;
  elastic << 1, poisson, 0, poisson, 1, 0, 0, 0, (1 - poisson) / 2;
  elastic *= modulus_Pa / (1 - poisson * poisson);
  const double half_x = width_m / across / 2;
  const double half_y = height_m / up / 2;
  for (int b = 0; b < up; ++b) {
    for (int a = 0; a < across; ++a) {
      const Element e = element(a, b);
      const ElementMatrices m = matrices_of(elastic, half_x, half_y);
      for (int i = 0; i < 16; ++i)
        for (int j = 0; j < 16; ++j)
          k.emplace_back(2 * e.nodes[static_cast<std::size_t>(i / 2)] + i % 2,
                         2 * e.nodes[static_cast<std::size_t>(j / 2)] + j % 2, m.ke(i, j));
      for (int i = 0; i < 16; ++i)
        for (int j = 0; j < 8; ++j)
          f.emplace_back(2 * e.nodes[static_cast<std::size_t>(i / 2)] + i % 2,
                         e.nodes[static_cast<std::size_t>(j)], m.fe(i, j));
      for (int i = 0; i < 8; ++i)
        for (int j = 0; j < 8; ++j) {
          const int row = e.nodes[static_cast<std::size_t>(i)];
          const int column = e.nodes[static_cast<std::size_t>(j)];
          conduct.emplace_back(row, column, m.he(i, j));
          store.emplace_back(row, column, m.ce(i, j));
        }
    }
  }
  for (int i = 0; i <= 2 * across; ++i)  // clamped: stiff beyond measure
    for (int d = 0; d < 2; ++d)
      k.emplace_back(dof(node(i, 0), d), dof(node(i, 0), d), 1e6 * modulus_Pa);
  build(stiffness, 2 * nodes, 2 * nodes, k);
  build(expansion, 2 * nodes, nodes, f);
  build(conductance, nodes, nodes, conduct);
  build(capacity, nodes, nodes, store);
  add_sides();
  solver.compute(stiffness);
}

void GateFe::Parts::add_sides() {
  // Sides: quadratic lines, Simpson-like consistent matrix of a line of three nodes.
  std::vector<Triplet> oil;
  std::vector<Triplet> air;
  Eigen::Matrix3d line;
  line << 4, 2, -1, 2, 16, 2, -1, 2, 4;
  line *= 2 * (height_m / up / 2) * depth_m / 30;
  for (int b = 0; b < up; ++b)
    for (const int i : {0, 2 * across}) {
      const bool heated = i == 0 && y_m(2 * b + 1) < machine.heated_height_mm * 1e-3;
      for (int m = 0; m < 3; ++m)
        for (int n = 0; n < 3; ++n)
          (heated ? oil : air).emplace_back(node(i, 2 * b + m), node(i, 2 * b + n), line(m, n));
    }
  build(oil_surface, nodes, nodes, oil);
  build(air_surface, nodes, nodes, air);
}

/// Across at the middle of the width, between the two nearest nodes by height.
double GateFe::Parts::at_middle(const Vector& field, double height) const {
  const double place = std::min(height / height_m * up, static_cast<double>(up));
  const int below = std::min(static_cast<int>(place), up - 1);
  const double share = place - below;
  return (1 - share) * field[Eigen::Index{2} * node(across, 2 * below)] +
         share * field[Eigen::Index{2} * node(across, 2 * below + 2)];
}

Vector GateFe::Parts::influence(double at) const {
  const double place = std::min(at / height_m * up, static_cast<double>(up));
  const int below = std::min(static_cast<int>(place), up - 1);
  Vector force = Vector::Zero(Eigen::Index{2} * nodes);
  force[Eigen::Index{2} * node(across, 2 * below)] = 1 - (place - below);
  force[Eigen::Index{2} * node(across, 2 * below + 2)] = place - below;
  return solver.solve(force);
}

double GateFe::Parts::displacement_um(const Vector& theta, double tie_K) const {
  const double tie_m = machine.tie_height_mm * 1e-3;
  const double work_m = machine.working_height_mm * 1e-3;
  const double free_tie = thermal(tie, theta);
  const double tie_per_N =
      machine.tie_length_mm * 1e-3 / (machine.tie_area_mm2 * 1e-6 * machine.tie_modulus_MPa * 1e6);
  const double longer = machine.tie_expansion_per_K * machine.tie_length_mm * 1e-3 * tie_K;
  // Tension of the tie, from the gap between the columns there.
  const double tension_N = -(free_tie + longer) / (tie_per_N + 2 * at_middle(tie, tie_m));
  return 1e6 * (thermal(work, theta) + 2 * at_middle(tie, work_m) * tension_N);
}

double GateFe::Parts::at_side(bool side_a, double height) const {
  const int j = 2 * static_cast<int>(std::lround(height / height_m * up));
  return rise[node(side_a ? 0 : 2 * across, j)];
}

GateFe::GateFe(const GateMachine& machine, double depth_mm)
    : parts_(std::make_unique<Parts>(machine, depth_mm)) {}
GateFe::~GateFe() = default;

TieCoefficients GateFe::coefficients() const {
  const Parts& parts = *parts_;
  Vector linear = Vector::Zero(parts.nodes);
  for (int j = 0; j <= 2 * parts.up; ++j)
    for (int i = 0; i <= 2 * across; ++i)
      if (parts.node(i, j) >= 0) {
        // The zone ends within a row of elements: that share of the row is warm.
        const double top = parts.machine.heated_height_mm * 1e-3;
        const double step = parts.height_m / parts.up;
        const double warm = std::clamp((top - parts.y_m(j)) / step + 0.5, 0.0, 1.0);
        linear[parts.node(i, j)] = warm * (0.5 - parts.x_m(i) / parts.width_m);
      }
  return {parts.displacement_um(linear, 0.0),
          -parts.displacement_um(Vector::Zero(parts.nodes), 1.0)};
}

void GateFe::advance(const Surroundings& around, double seconds) {
  Parts& parts = *parts_;
  const double oil_K = around.oil_degC - 20.0;
  const Sparse outflow = parts.conductance + around.oil_W_per_m2K * parts.oil_surface +
                         air_W_per_m2K * parts.air_surface;
  const Sparse left = parts.capacity / seconds + outflow;
  const Vector ones = Vector::Ones(parts.nodes);
  const int joint =
      parts.node(2 * across, 2 * static_cast<int>(std::lround(parts.machine.tie_height_mm * 1e-3 /
                                                              parts.height_m * parts.up)));
  Vector right = parts.capacity * parts.rise / seconds +
                 around.oil_W_per_m2K * oil_K * (parts.oil_surface * ones);
  right[joint] += tie_ends_W_per_K * (parts.tie_rise[0] - parts.rise[joint]);
  const double joint_K = parts.rise[joint];
  parts.rise = Eigen::SimplicialLDLT<Sparse>(left).solve(right);
  // The tie: lumps in a row, each with the air around it, the first at the warm column.
  const double lump_m = parts.machine.tie_length_mm * 1e-3 / tie_nodes;
  const double area_m2 = parts.machine.tie_area_mm2 * 1e-6;
  const double along = conductivity_W_per_mK * area_m2 / lump_m;
  const double skin = air_W_per_m2K * 4 * std::sqrt(area_m2) * lump_m;
  const double store = heat_J_per_m3K * area_m2 * lump_m / seconds;
  const double air_K = around.oil_W_per_m2K > 0 ? warm_air_share * oil_K : 0.0;
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(tie_nodes, tie_nodes);
  Vector b = store * parts.tie_rise + Vector::Constant(tie_nodes, skin * air_K);
  for (int i = 0; i < tie_nodes; ++i) {
    a(i, i) += store + skin;
    if (i + 1 < tie_nodes) {
      a(i, i) += along;
      a(i + 1, i + 1) += along;
      a(i, i + 1) -= along;
      a(i + 1, i) -= along;
    }
  }
  a(0, 0) += tie_ends_W_per_K;
  b[0] += tie_ends_W_per_K * joint_K;
  a(tie_nodes - 1, tie_nodes - 1) += tie_ends_W_per_K;  // the other column stays cold
  parts.tie_rise = a.ldlt().solve(b);
}

double GateFe::theta_a_K() const {
  return parts_->at_side(true, parts_->machine.heated_height_mm * 0.5e-3);
}
double GateFe::theta_b_K() const {
  return parts_->at_side(false, parts_->machine.heated_height_mm * 0.5e-3);
}
double GateFe::theta_c_K() const {
  return parts_->tie_rise.mean();
}
double GateFe::displacement_um() const {
  return parts_->displacement_um(parts_->rise, theta_c_K());
}

}  // namespace thermocomp::bench
