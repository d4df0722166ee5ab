/// Hierarchical model of machines: coefficients b_i ~ N(m, S), rows y_i = X_i b_i + e_i.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace thermocomp::series {

/// Normal equations of a machine's rows for one output; integrals over time.
struct Evidence {
  Eigen::MatrixXd xx;  ///< integral of x x' dt, shape (columns, columns)
  Eigen::VectorXd xy;  ///< integral of x y dt
  double yy{0.0};      ///< integral of y^2 dt
  double time_s{0.0};
};

/// m and S. An error e correlated over `noise_time_s` is whitened by its spectral density at the
/// low frequencies of a machine's temperatures, 2 noise_time_s remainder_um^2.
struct Population {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;       ///< S
  Eigen::MatrixXd mean_covariance;  ///< of m
  double remainder_um{1.0};
  double noise_time_s{0.5};
  [[nodiscard]] double density() const { return 2.0 * noise_time_s * remainder_um * remainder_um; }
};

struct Coefficients {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;  ///< V
};

/// V = (A + S^-1)^-1, b = V (c + S^-1 m) with A = xx / density, c = xy / density, in a form that is
/// stable for nearly singular S and gives m and S for A = 0.
/// @throws std::runtime_error if `covariance` is not positive definite
[[nodiscard]] Coefficients posterior(const Evidence& evidence, double density,
                                     const Eigen::VectorXd& mean,
                                     const Eigen::MatrixXd& covariance);

/// Prior assumptions, equivalent to `machines` machines.
struct Assumed {
  Eigen::VectorXd mean_sd;     ///< m ~ N(0, mean_sd^2); empty: infinite
  Eigen::VectorXd scatter_sd;  ///< square root of S's diagonal
  double machines{2.0};        ///< 0: no assumption about S
  bool estimate_remainder{true};
};

/// Share by which off-diagonal elements of S are reduced.
[[nodiscard]] double shrinkage(std::size_t machines, Eigen::Index columns);

/// One step of expectation maximisation: V_i and b_i of each machine from `now`; then m, S = mean
/// of V_i + (b_i - m)(b_i - m)', shrunk towards its diagonal, and the remainder.
[[nodiscard]] Population em_step(std::span<const Evidence> machines, const Population& now,
                                 const Assumed& assumed);
/// Repeats em_step() from m = 0, S = scatter_sd^2 until convergence. @pre machines is not empty
[[nodiscard]] Population population_of(std::span<const Evidence> machines, const Assumed& assumed,
                                       double noise_time_s);

/// Columns of one subject, which depart together.
struct Group {
  std::string name;
  std::vector<Eigen::Index> columns;
};

struct Departure {
  struct Part {
    std::string name;
    double share{0.0};      ///< of distance2 explained by a departure of this group alone
    double effect_um{0.0};  ///< RMS effect of the departing coefficients in these rows
  };
  double distance2{0.0};    ///< squared Mahalanobis distance
  double freedom{0.0};      ///< number of determined directions
  double probability{1.0};  ///< of at least this distance in a machine of the series
  std::vector<Part> parts;  ///< largest share first
};

/// Distance of a machine's own estimate from `mean` in S + V, over the directions that its rows
/// determine. If S was estimated from `machines` sisters, the distance has an F distribution with
/// freedom and `machines` degrees of freedom; infinite: S is known.
[[nodiscard]] Departure departure_of(const Evidence& evidence, double density,
                                     const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance,
                                     double machines, std::span<const Group> groups);

/// P(F >= f) by Paulson's approximation (Biometrika 29, 1942); by Wilson and Hilferty's if
/// `freedom_below` is infinite.
[[nodiscard]] double f_tail(double f, double freedom, double freedom_below);

}  // namespace thermocomp::series
