#include "modelling/series/hierarchy.hpp"

#include <cmath>
#include <limits>
#include <random>

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>

namespace thermocomp::series {
namespace {

using Catch::WithinAbs;
using Catch::WithinRel;

Evidence scalar(double xx, double xy) {
  return {Eigen::MatrixXd::Constant(1, 1, xx), Eigen::VectorXd::Constant(1, xy), xy * xy / xx, 1.0};
}

Population standard(Eigen::Index columns) {
  Population population;
  population.mean = Eigen::VectorXd::Zero(columns);
  population.covariance = Eigen::MatrixXd::Identity(columns, columns);
  return population;  // density 1
}

Assumed nothing(Eigen::Index columns) {
  Assumed assumed;
  assumed.scatter_sd = Eigen::VectorXd::Ones(columns);
  assumed.machines = 0.0;
  assumed.estimate_remainder = false;
  return assumed;
}

Eigen::VectorXd normal(std::mt19937& random, Eigen::Index count) {
  std::normal_distribution<double> each;
  Eigen::VectorXd values(count);
  for (double& value : values) value = each(random);
  return values;
}

/// Rows of a machine with coefficients b and noise of standard deviation 1, one per second.
Evidence rows_of(std::mt19937& random, const Eigen::VectorXd& b, int rows) {
  Evidence evidence{Eigen::MatrixXd::Zero(b.size(), b.size()), Eigen::VectorXd::Zero(b.size()), 0,
                    static_cast<double>(rows)};
  for (int i = 0; i < rows; ++i) {
    const Eigen::VectorXd x = normal(random, b.size());
    const double y = x.dot(b) + normal(random, 1)[0];
    evidence.xx += x * x.transpose();
    evidence.xy += y * x;
    evidence.yy += y * y;
  }
  return evidence;
}

TEST_CASE("two steps of EM match the manual calculation", "[series]") {
  // V = 1/2, b = 1 and 2; m = 3/2, S = 1/2 + 1/4. Then V = 3/7, b = 12/7 and 18/7; m = 15/7,
  // S = 3/7 + 9/49.
  const std::vector<Evidence> machines{scalar(1.0, 2.0), scalar(1.0, 4.0)};
  const Population first = em_step(machines, standard(1), nothing(1));
  CHECK_THAT(first.mean[0], WithinRel(1.5, 1e-12));
  CHECK_THAT(first.covariance(0, 0), WithinRel(0.75, 1e-12));
  const Population second = em_step(machines, first, nothing(1));
  CHECK_THAT(second.mean[0], WithinRel(15.0 / 7.0, 1e-12));
  CHECK_THAT(second.covariance(0, 0), WithinRel(30.0 / 49.0, 1e-12));
}

TEST_CASE("EM converges to the maximum of the likelihood", "[series]") {
  // Estimates 1 and 5 with an error of variance 1: m = 3, S + 1 = 4.
  const std::vector<Evidence> machines{scalar(1.0, 1.0), scalar(1.0, 5.0)};
  Population now = standard(1);
  for (int step = 0; step < 500; ++step) now = em_step(machines, now, nothing(1));
  CHECK_THAT(now.mean[0], WithinRel(3.0, 1e-6));
  CHECK_THAT(now.covariance(0, 0), WithinRel(3.0, 1e-4));
}

TEST_CASE("m and S of simulated machines are recovered", "[series]") {
  std::mt19937 random(5);
  const Eigen::Vector3d mean(4.0, -2.0, 1.0);
  const Eigen::Vector3d scatter(0.5, 1.0, 0.2);
  std::vector<Evidence> machines;
  for (int i = 0; i < 200; ++i)
    machines.push_back(rows_of(random, mean + scatter.cwiseProduct(normal(random, 3)), 40));
  Assumed assumed = nothing(3);
  assumed.estimate_remainder = true;
  const Population found = population_of(machines, assumed, 0.5);
  CHECK_THAT(found.remainder_um, WithinRel(1.0, 0.03));
  for (Eigen::Index i = 0; i < 3; ++i) {
    CHECK_THAT(found.mean[i], WithinAbs(mean[i], 4.0 * std::hypot(scatter[i], 0.16) / 14.0));
    CHECK_THAT(std::sqrt(found.covariance(i, i)), WithinRel(scatter[i], 0.2));
    CHECK_THAT(std::sqrt(found.mean_covariance(i, i)),
               WithinRel(std::hypot(scatter[i], 0.16) / std::sqrt(200.0), 0.25));
  }
}

TEST_CASE("a very wide prior gives the machine's own fit, no rows give the prior",
          "[series][property]") {
  const unsigned seed = GENERATE(range(0U, 20U));
  std::mt19937 random(seed);
  const Eigen::Index columns = 2 + seed % 4;
  const Eigen::VectorXd mean = 10.0 * normal(random, columns);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(columns, columns);
  const Eigen::VectorXd tilt = normal(random, columns);
  covariance += tilt * tilt.transpose();
  const Evidence evidence = rows_of(random, normal(random, columns), 60);
  const Eigen::VectorXd own = evidence.xx.ldlt().solve(evidence.xy);
  const Coefficients wide = posterior(evidence, 1.0, mean, 1e10 * covariance);
  CHECK((wide.mean - own).norm() < 1e-6 * own.norm());
  CHECK((wide.covariance * evidence.xx - Eigen::MatrixXd::Identity(columns, columns)).norm() <
        1e-6);
  const Evidence none{Eigen::MatrixXd::Zero(columns, columns), Eigen::VectorXd::Zero(columns), 0.0,
                      0.0};
  const Coefficients prior = posterior(none, 1.0, mean, covariance);
  CHECK((prior.mean - mean).norm() < 1e-12 * mean.norm());
  CHECK((prior.covariance - covariance).norm() < 1e-12 * covariance.norm());
}

TEST_CASE("a singular covariance is refused", "[series]") {
  CHECK_THROWS(
      posterior(scalar(1.0, 1.0), 1.0, Eigen::VectorXd::Zero(1), Eigen::MatrixXd::Zero(1, 1)));
}

TEST_CASE("the distance of sisters has the stated distribution", "[series]") {
  std::mt19937 random(8);
  const Eigen::Vector3d mean(1.0, 2.0, 3.0);
  const Eigen::Matrix3d covariance = Eigen::Vector3d(0.25, 1.0, 4.0).asDiagonal();
  int beyond = 0;
  double sum = 0.0;
  constexpr int machines = 2000;
  for (int i = 0; i < machines; ++i) {
    const Eigen::VectorXd b = mean + Eigen::Vector3d(0.5, 1.0, 2.0).cwiseProduct(normal(random, 3));
    const Departure departure =
        departure_of(rows_of(random, b, 50), 1.0, mean, covariance, 1e6, {});
    REQUIRE(departure.freedom == 3.0);
    sum += departure.distance2;
    beyond += departure.probability < 0.05 ? 1 : 0;
  }
  CHECK_THAT(sum / machines, WithinAbs(3.0, 0.2));
  CHECK_THAT(static_cast<double>(beyond) / machines, WithinAbs(0.05, 0.02));
}

TEST_CASE("the departing coefficient is named first", "[series]") {
  std::mt19937 random(9);
  const Eigen::Vector3d mean(1.0, 2.0, 3.0);
  const std::vector<Group> groups{{"a", {0}}, {"b", {1}}, {"c", {2}}};
  const Departure departure =
      departure_of(rows_of(random, mean + Eigen::Vector3d(0, 3, 0), 100), 1.0, mean,
                   0.01 * Eigen::Matrix3d::Identity(), 20.0, groups);
  CHECK(departure.probability < 1e-3);
  CHECK(departure.parts.front().name == "b");
  CHECK_THAT(departure.parts.front().effect_um, WithinRel(3.0, 0.2));
}

TEST_CASE("the tail of F matches tables", "[series]") {
  CHECK_THAT(f_tail(4.10, 2.0, 10.0), WithinAbs(0.05, 0.003));
  CHECK_THAT(f_tail(4.94, 5.0, 12.0), WithinAbs(0.011, 0.003));
  const double of_chi_square = f_tail(1.8307, 10.0, std::numeric_limits<double>::infinity());
  CHECK_THAT(of_chi_square, WithinAbs(0.05, 0.001));
}

}  // namespace
}  // namespace thermocomp::series
