// The filters of many time constants at once against the estimator's, which take a value at a time.
#include "modelling/diagnosis/series.hpp"

#include <chrono>
#include <cmath>

#include <catch2/catch.hpp>

#include "estimator/low_pass.hpp"
#include "estimator/play.hpp"
#include "modelling/diagnosis/coloured_noise.hpp"
#include "modelling/diagnosis/panel.hpp"

namespace thermocomp::diagnosis {
namespace {

struct Series {
  Column time_s{300};
  Column values{300};
};

/// Rows a minute apart, with a pause and some closer rows: three lengths of steps.
Series uneven() {
  Series series;
  double time_s = 0.0;
  for (Eigen::Index row = 0; row < series.time_s.size(); ++row) {
    time_s += row == 120 ? 4000.0 : row > 200 ? 7.5 : 60.0;
    series.time_s[row] = time_s;
    series.values[row] = 20.0 + 5.0 * std::sin(time_s / 900.0) + 0.1 * std::cos(40.0 * time_s);
  }
  return series;
}

nanoseconds at(double time_s) {
  return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(time_s));
}

/// Seven rows are missing, the others are two blocks.
Whitener with_gap_and_blocks(const Series& series) {
  Eigen::Array<bool, Eigen::Dynamic, 1> present(series.time_s.size());
  for (Eigen::Index row = 0; row < present.size(); ++row) present[row] = row < 40 || row > 46;
  return {{4.0, 3600.0}, series.time_s, {{0, 150}, {150, 300}}, present};
}

}  // namespace

TEST_CASE("lags of many time constants are those of the estimator", "[diagnosis]") {
  const Series series = uneven();
  const std::vector<double> taus_s = {0.0, 5.0, 60.0, 333.0, 1e4};
  const Panel all = lagged(series.time_s, series.values, taus_s);
  REQUIRE(all.cols() == 5);
  for (std::size_t i = 0; i < taus_s.size(); ++i) {
    LowPass filter(taus_s[i]);
    for (Eigen::Index row = 0; row < all.rows(); ++row)
      REQUIRE(std::abs(all(row, static_cast<Eigen::Index>(i)) -
                       filter.step(at(series.time_s[row]), series.values[row])) < 1e-9);
  }
}

TEST_CASE("plays of many widths are those of the estimator", "[diagnosis]") {
  const Series series = uneven();
  const std::vector<double> widths = {0.0, 0.5, 3.0, 100.0};
  const Panel all = played(series.values, widths);
  for (std::size_t i = 0; i < widths.size(); ++i) {
    Play filter(widths[i]);
    for (Eigen::Index row = 0; row < all.rows(); ++row)
      REQUIRE(all(row, static_cast<Eigen::Index>(i)) == filter.step(series.values[row]));
  }
}

TEST_CASE("waves keep their phase over uneven rows", "[diagnosis]") {
  const Series series = uneven();
  const std::vector<double> periods_s = {300.0, 3600.0};
  const Waves all = waves(series.time_s, periods_s);
  for (Eigen::Index i = 0; i < 2; ++i)
    for (Eigen::Index row = 0; row < series.time_s.size(); ++row) {
      const double phase =
          2.0 * 3.141592653589793 * series.time_s[row] / periods_s[static_cast<std::size_t>(i)];
      REQUIRE(std::abs(all.sines(row, i) - std::sin(phase)) < 1e-9);
      REQUIRE(std::abs(all.cosines(row, i) - std::cos(phase)) < 1e-9);
    }
}

TEST_CASE("a column is whitened alike alone and among any number of others", "[diagnosis]") {
  const Series series = uneven();
  const Whitener whitener = with_gap_and_blocks(series);
  const Column alone = whitener.apply(series.values);
  for (const Eigen::Index count : {1, 3, 23, 32}) {
    Panel many = Panel::Random(series.time_s.size(), count);
    many.col(count - 1) = series.values;
    CHECK(whitener.apply(many).col(count - 1) == alone);
  }
}

TEST_CASE("products of panels are those of their columns", "[diagnosis]") {
  const Panel a = Panel::Random(200, 5);
  for (const Eigen::Index count : {1, 2, 21}) {
    const Panel b = Panel::Random(200, count);
    const Eigen::MatrixXd expected = a.middleRows(30, 150).transpose() * b.middleRows(30, 150);
    CHECK((cross_products(a, b, 30, 180) - expected).norm() < 1e-12 * expected.norm());
    const Eigen::MatrixXd own = b.middleRows(30, 150).transpose() * b.middleRows(30, 150);
    const Eigen::MatrixXd neighbours = neighbour_products(b, 2, 30, 180);
    for (Eigen::Index column = 0; column < count; ++column) {
      CHECK(std::abs(neighbours(0, column) - own(column, column)) < 1e-10);
      const double next = column + 1 < count ? own(column, column + 1) : 0.0;
      CHECK(std::abs(neighbours(1, column) - next) < 1e-10);
    }
  }
}

TEST_CASE("whitening transposed gives the same products", "[diagnosis]") {
  const Series series = uneven();
  const Whitener whitener = with_gap_and_blocks(series);
  const Panel a = Panel::Random(series.time_s.size(), 3);
  const Panel b = Panel::Random(series.time_s.size(), 5);
  const Eigen::MatrixXd expected = a.transpose() * whitener.apply(b);
  CHECK((whitener.transposed(a).transpose() * b - expected).norm() < 1e-12 * expected.norm());
}

TEST_CASE("columns that begin at a row have the squares of each whitened for itself",
          "[diagnosis]") {
  const Series series = uneven();
  const Whitener whitener = with_gap_and_blocks(series);
  const Panel whole = Panel::Random(series.time_s.size(), 4);
  const std::vector<Eigen::Index> first_rows = {0, 1, 43, 149, 150, 151, 299, 300};
  const Eigen::MatrixXd squares = whitener.squares_from_rows(whole, first_rows);
  for (std::size_t i = 0; i < first_rows.size(); ++i) {
    Panel from_row = whole;
    from_row.topRows(first_rows[i]).setZero();
    const Panel white = whitener.apply(from_row);
    for (Eigen::Index column = 0; column < whole.cols(); ++column)
      CHECK(std::abs(squares(static_cast<Eigen::Index>(i), column) -
                     white.col(column).squaredNorm()) < 1e-10);
  }
}

}  // namespace thermocomp::diagnosis
