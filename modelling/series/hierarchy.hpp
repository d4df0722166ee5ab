/// Machines of one type: coefficients b_i ~ N(m, S), rows y_i = X_i b_i + e_i. Pure arithmetic.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace thermocomp::series {

/// What the rows of a machine say of its coefficients in one output; integrals over time.
struct Evidence {
  Eigen::MatrixXd xx;  ///< integral of x x' dt, shape (columns, columns)
  Eigen::VectorXd xy;  ///< integral of x y dt
  double yy{0.0};      ///< integral of y^2 dt
  double time_s{0.0};
};

/// m and S. An error e that is correlated over `noise_time_s` has at the slow frequencies of a
/// machine's temperatures the spectral density 2 noise_time_s remainder_um^2, which whitens it.
struct Population {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;       ///< S
  Eigen::MatrixXd mean_covariance;  ///< of m itself
  double remainder_um{1.0};
  double noise_time_s{0.5};
  [[nodiscard]] double density() const { return 2.0 * noise_time_s * remainder_um * remainder_um; }
};

struct Coefficients {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;  ///< V
};

/// V = (A + S^-1)^-1, b = V (c + S^-1 m) with A = xx / density, c = xy / density, in a form that
/// holds for S near singular and for A = 0, which gives m and S.
/// @throws std::runtime_error when `covariance` is not positive definite
[[nodiscard]] Coefficients posterior(const Evidence& evidence, double density,
                                     const Eigen::VectorXd& mean,
                                     const Eigen::MatrixXd& covariance);

/// What is assumed before a machine was seen; it counts as `machines` machines.
struct Assumed {
  Eigen::VectorXd mean_sd;     ///< m ~ N(0, mean_sd^2); infinite where empty
  Eigen::VectorXd scatter_sd;  ///< square root of the diagonal of S
  double machines{2.0};        ///< 0: nothing is assumed of S
  bool estimate_remainder{true};
};

/// Share by which the off-diagonal elements of S are reduced.
[[nodiscard]] double shrinkage(std::size_t machines, Eigen::Index columns);

/// One step of expectation and maximisation: V_i and b_i of each machine from `now`; then m, S =
/// mean of V_i + (b_i - m)(b_i - m)', shrunk to its diagonal, and the remainder.
[[nodiscard]] Population em_step(std::span<const Evidence> machines, const Population& now,
                                 const Assumed& assumed);
/// em_step() from m = 0, S = scatter_sd^2 until it stands. @pre machines is not empty
[[nodiscard]] Population population_of(std::span<const Evidence> machines, const Assumed& assumed,
                                       double noise_time_s);

/// Columns of one subject: what can depart as one.
struct Group {
  std::string name;
  std::vector<Eigen::Index> columns;
};

struct Departure {
  struct Part {
    std::string name;
    double share{0.0};      ///< of distance2 that a departure of this group alone explains
    double effect_um{0.0};  ///< RMS of what the departing coefficients do in these rows
  };
  double distance2{0.0};    ///< Mahalanobis distance, squared
  double freedom{0.0};      ///< directions that the rows determine
  double probability{1.0};  ///< of such a distance, or a larger one, in a machine of the series
  std::vector<Part> parts;  ///< largest share first
};

/// Distance of a machine's own estimate from `mean` in S + V, over the directions that its rows
/// determine. In sisters whose S was estimated from `machines` of them the distance has an F
/// distribution with freedom and `machines` degrees of freedom; infinite: S is known.
[[nodiscard]] Departure departure_of(const Evidence& evidence, double density,
                                     const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance,
                                     double machines, std::span<const Group> groups);

/// P(F >= f) by Paulson's approximation (Biometrika 29, 1942); that of Wilson and Hilferty for
/// chi-square where `freedom_below` is infinite.
[[nodiscard]] double f_tail(double f, double freedom, double freedom_below);

}  // namespace thermocomp::series
