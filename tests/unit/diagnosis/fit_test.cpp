// Whitening and normal equations against the covariance written out.
#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <catch2/catch.hpp>

#include "modelling/diagnosis/rank/output_fit.hpp"

using namespace thermocomp::diagnosis;

namespace {

constexpr Eigen::Index n = 60;

struct Rows {
  StackedRows stacked;
  Panel values;  ///< a remainder and three columns

  Rows() : values(n, 4) {
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    stacked.time_s.resize(n);
    stacked.runs = {{0, 25}, {25, n}};
    for (Eigen::Index i = 0; i < n; ++i) {
      stacked.time_s[i] = 300.0 * static_cast<double>(i) + (i % 3 == 0 ? 100.0 : 0.0);
      for (Eigen::Index j = 0; j < 4; ++j) values(i, j) = normal(random);
    }
  }
};

Eigen::MatrixXd covariance(const Background& background, const StackedRows& rows) {
  Eigen::MatrixXd all = Eigen::MatrixXd::Identity(n, n);
  for (const Block& run : rows.runs)
    for (Eigen::Index i = run.begin; i < run.end; ++i)
      for (Eigen::Index j = run.begin; j < run.end; ++j)
        all(i, j) += background.ratio * background.ratio *
                     std::exp(-std::abs(rows.time_s[i] - rows.time_s[j]) / background.tau_s);
  return all;
}

}  // namespace

TEST_CASE("whitened columns have the products that the covariance gives", "[diagnosis]") {
  const Rows rows;
  for (const Background& background : backgrounds()) {
    const Eigen::MatrixXd all = covariance(background, rows.stacked);
    const Eigen::MatrixXd expected = rows.values.transpose() * all.llt().solve(rows.values);
    Panel white = rows.values;
    const double log_determinant =
        whiten(background, rows.stacked.time_s, rows.stacked.runs, white);
    CHECK((white.transpose() * white - expected).norm() < 1e-9 * expected.norm());
    CHECK(log_determinant == Approx(std::log(all.determinant())));
  }
}

TEST_CASE("equations with common columns equal those of columns projected off them",
          "[diagnosis]") {
  const Rows rows;
  OutputRows of(rows.stacked, Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(n, true));
  REQUIRE(of.size() == n);
  const Column remainder = rows.values.col(0);
  const Panel common = rows.values.middleCols(1, 1);
  const OutputFit fit(of, remainder, common,
                      Eigen::VectorXd::Constant(1, std::numeric_limits<double>::infinity()), 1e-3);
  const Equations equations = fit.equations(rows.values.rightCols(2), 2);
  for (std::size_t under = 0; under < backgrounds().size(); ++under) {
    const Eigen::MatrixXd weight = covariance(backgrounds()[under], rows.stacked).inverse();
    const Eigen::MatrixXd x = rows.values.rightCols(2);
    const Eigen::VectorXd z = common.col(0);
    const double zz = z.dot(weight * z);
    const Eigen::MatrixXd free = weight - (weight * z) * (weight * z).transpose() / zz;
    const auto b = static_cast<Eigen::Index>(under);
    CHECK((equations.right_of(0, b) - x.transpose() * free * remainder).norm() < 1e-6);
    CHECK((equations.square_of(0, b) - x.transpose() * free * x).norm() < 1e-6);
  }
}

TEST_CASE("the discrepancy limits the likelihood lost by an approximate form", "[diagnosis]") {
  const Rows rows;
  OutputRows of(rows.stacked, Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(n, true));
  const OutputFit fit(of, rows.values.col(0), Panel(n, 0), Eigen::VectorXd(0), 1e-3);
  const double squares = static_cast<double>(n) * fit.variance(0, 0.0);
  // Of a small effect what it explains decides alone; of a large one more than its own discrepancy
  // cannot be asked for.
  const double small = fit.log_likelihood(0, 0.999 * squares, 1e-6);
  const double less = fit.log_likelihood(0, 0.99 * squares, 1e-6);
  CHECK(small - less == Approx(0.5 * static_cast<double>(n) * std::log(10.0)));
  const double size = 1e4 * fit.variance(0, 0.0);
  CHECK(fit.log_likelihood(0, 0.999 * squares, size) - fit.log_likelihood(0, 0.99 * squares, size) <
        1.0);
}

TEST_CASE("many rows are averaged, missing ones left out", "[diagnosis]") {
  StackedRows rows;
  rows.time_s = Column::LinSpaced(5000, 0.0, 4999.0);
  rows.runs = {{0, 2000}, {2000, 5000}};
  Eigen::Array<bool, Eigen::Dynamic, 1> present =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(5000, true);
  present.segment(100, 800).setConstant(false);
  const OutputRows few(rows, present);
  CHECK(few.size() <= 482);
  CHECK(few.size() > 400);
  const Panel means = few.means_of(rows.time_s);
  CHECK((means.col(0) - few.time_s()).norm() < 1e-9);
  REQUIRE(few.runs().size() == 2);
  for (Eigen::Index row = 0; row < few.size(); ++row) {
    CHECK((few.time_s()[row] < 110.0 || few.time_s()[row] > 890.0));
    CHECK((few.time_s()[row] < 2000.0) == (row < few.runs()[0].end));
  }
}
