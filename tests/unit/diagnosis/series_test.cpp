// The filters of many time constants at once against the estimator's, which take a value at a time.
#include "modelling/diagnosis/data/series.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <catch2/catch.hpp>

#include "estimator/model/terms/low_pass.hpp"
#include "estimator/model/terms/play.hpp"
#include "modelling/diagnosis/data/panel.hpp"
#include "modelling/diagnosis/evidence/coloured_noise.hpp"
#include "modelling/diagnosis/evidence/evidence.hpp"
#include "modelling/diagnosis/evidence/settings_together.hpp"

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
  std::vector<double> taus_s = {0.0, 5.0, 60.0, 333.0, 1e4};
  for (double tau_s = 20.0; taus_s.size() < 23; tau_s *= 1.4) taus_s.push_back(tau_s);
  Panel all(series.values.size(), std::ssize(taus_s));
  lagged(series.time_s, series.values, taus_s, all);
  Panel less(all.rows(), all.cols());
  lagged_less_values(series.time_s, series.values, taus_s, less);
  Panel each = series.values.replicate(1, all.cols());
  lag_each(series.time_s, taus_s, each);
  for (std::size_t i = 0; i < taus_s.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    LowPass filter(taus_s[i]);
    for (Eigen::Index row = 0; row < all.rows(); ++row) {
      const double expected = filter.step(at(series.time_s[row]), series.values[row]);
      REQUIRE(std::abs(all(row, column) - expected) < 1e-9);
      REQUIRE(std::abs(less(row, column) - (expected - series.values[row])) < 1e-9);
      REQUIRE(std::abs(each(row, column) - expected) < 1e-9);
    }
  }
}

TEST_CASE("plays of many widths are those of the estimator", "[diagnosis]") {
  const Series series = uneven();
  std::vector<double> widths = {0.0, 0.5, 3.0, 100.0};
  while (widths.size() < 21) widths.push_back(1.2 * widths.back() / 7.0);
  const Column factors = 0.01 * series.time_s;
  Panel all(series.values.size(), std::ssize(widths));
  played_less_values(series.values, widths, factors, all);
  for (std::size_t i = 0; i < widths.size(); ++i) {
    Play filter(widths[i]);
    for (Eigen::Index row = 0; row < all.rows(); ++row)
      REQUIRE(std::abs(all(row, static_cast<Eigen::Index>(i)) -
                       factors[row] * (filter.step(series.values[row]) - series.values[row])) <
              1e-9);
  }
}

TEST_CASE("slopes are central differences of what is smoothed to and fro", "[diagnosis]") {
  const Series series = uneven();
  std::vector<double> taus_s = {0.0, 30.0};
  while (taus_s.size() < 21) taus_s.push_back(1.2 * taus_s.back());
  const Column of_rows = 0.01 * series.time_s;
  const std::vector<double>& of_columns = taus_s;
  Panel smooth(series.values.size(), std::ssize(taus_s));
  smoothed(series.time_s, series.values, taus_s, smooth);
  Panel all(smooth.rows(), smooth.cols());
  slopes(series.time_s, series.values, taus_s, of_rows, of_columns, all);
  const Eigen::Index last = smooth.rows() - 1;
  for (Eigen::Index row = 0; row <= last; ++row) {
    const Eigen::Index low = std::max<Eigen::Index>(0, row - 1);
    const Eigen::Index high = std::min(last, row + 1);
    const double seconds = series.time_s[high] - series.time_s[low];
    for (Eigen::Index column = 0; column < smooth.cols(); ++column)
      REQUIRE(std::abs(all(row, column) -
                       of_rows[row] * of_columns[static_cast<std::size_t>(column)] *
                           (smooth(high, column) - smooth(low, column)) / seconds) < 1e-9);
  }
}

TEST_CASE("waves keep their phase over uneven rows", "[diagnosis]") {
  const Series series = uneven();
  const std::size_t periods = GENERATE(2U, 16U, 19U);
  const Eigen::Index apart = GENERATE(2, 6);
  std::vector<double> periods_s = {300.0, 3600.0};
  while (periods_s.size() < periods) periods_s.push_back(1.1 * periods_s.back());
  Panel all(series.time_s.size(), apart * std::ssize(periods_s));
  waves(series.time_s, periods_s, apart, all);
  for (Eigen::Index i = 0; i < std::ssize(periods_s); ++i)
    for (Eigen::Index row = 0; row < series.time_s.size(); ++row) {
      const double phase =
          2.0 * 3.141592653589793 * series.time_s[row] / periods_s[static_cast<std::size_t>(i)];
      REQUIRE(std::abs(all(row, apart * i) - std::sin(phase)) < 1e-9);
      REQUIRE(std::abs(all(row, apart * i + 1) - std::cos(phase)) < 1e-9);
    }
}

TEST_CASE("a column is whitened alike alone and among any number of others", "[diagnosis]") {
  const Series series = uneven();
  const Whitener whitener = with_gap_and_blocks(series);
  const Column alone = whitener.apply(series.values);
  for (const Eigen::Index count : {1, 3, 23, 32}) {
    Panel many = Panel::Random(series.time_s.size(), count);
    many.col(count - 1) = series.values;
    Eigen::MatrixXd squares;
    const Panel white = whitener.apply(many, squares);
    CHECK((white.col(count - 1) - alone).norm() < 1e-12 * alone.norm());
    CHECK((squares - white.colwise().squaredNorm()).norm() < 1e-12 * squares.norm());
    const Whitener::Squares both = whitener.squares(many);
    CHECK((squares - both.white).norm() < 1e-12 * squares.norm());
    CHECK((both.plain - many.colwise().squaredNorm()).norm() < 1e-12 * both.plain.norm());
  }
}

TEST_CASE("products of panels are those of their columns", "[diagnosis]") {
  const Eigen::Index columns = GENERATE(1, 2, 5, 6, 13, 26);
  const Panel a = Panel::Random(200, columns);
  for (const Eigen::Index count : {1, 2, 3, 21, 47, 48}) {
    const Panel b = Panel::Random(200, count);
    for (const Eigen::Index end : {30, 31, 94, 180}) {
      const Eigen::MatrixXd expected =
          a.middleRows(30, end - 30).transpose() * b.middleRows(30, end - 30);
      CHECK((cross_products(a, b, 30, end) - expected).norm() <= 1e-12 * expected.norm());
    }
    const Eigen::MatrixXd own = b.middleRows(30, 150).transpose() * b.middleRows(30, 150);
    for (const Eigen::Index width : {2, 21}) {
      if (count < width) continue;
      const Eigen::MatrixXd neighbours = neighbour_products(b, width, 30, 180);
      for (Eigen::Index column = 0; column < count; ++column)
        for (Eigen::Index apart = 0; apart < width; ++apart) {
          const double product = column + apart < count ? own(column, column + apart) : 0.0;
          CHECK(std::abs(neighbours(apart, column) - product) < 1e-10);
        }
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

TEST_CASE("settings together give the equations of each", "[diagnosis]") {
  const Series series = uneven();
  const StackedRows rows{{{0, 300}}, {{0, 150}, {150, 300}}, series.time_s};
  const bool complete = GENERATE(true, false);
  Eigen::Array<bool, Eigen::Dynamic, 1> present(300);
  for (Eigen::Index row = 0; row < 300; ++row) present[row] = complete || row < 40 || row > 46;
  const auto cleared = [&](Panel panel) {
    for (Eigen::Index row = 0; row < 300; ++row)
      if (!present[row]) panel.row(row).setZero();
    return panel;
  };
  const Column residual = cleared(Panel::Random(300, 1));
  const Eigen::MatrixXd common = cleared(Panel::Ones(300, 1));
  const Eigen::VectorXd precision = Eigen::VectorXd::Constant(1, 1e-6);
  const Setting white({0.0, 1.0}, rows, present, residual, common, precision);
  const Setting wandering({4.0, 3600.0}, rows, present, residual, common, precision);
  const Setting longer(wandering, cleared(Panel::Random(300, 7)), 0.01);
  const std::vector<const Setting*> settings = {&wandering, &white, &longer};
  const SettingsTogether together(settings);
  const auto same = [](const EquationsTable& a, std::size_t of_a, const EquationsTable& b,
                       std::size_t of_b) {
    const double size = b.square(of_b).norm() + b.right(of_b).norm();
    return (a.square(of_a) - b.square(of_b)).norm() + (a.right(of_a) - b.right(of_b)).norm() <
           1e-11 * size;
  };
  for (const Eigen::Index width : {1, 2}) {
    const Panel columns = cleared(Panel::Random(300, 22));
    const auto all = together.equations(columns, width);
    const auto each = Setting::equations_of_groups(settings, columns, width);
    for (std::size_t under = 0; under < settings.size(); ++under)
      for (std::size_t group = 0; group < static_cast<std::size_t>(22 / width); ++group)
        CHECK(same(all[under], group, each[under], group));
  }
  const Panel whole = cleared(Panel::Random(300, 3));
  const std::vector<Eigen::Index> first_rows = {0, 43, 151, 290};
  const auto all = together.equations_from_rows(whole, first_rows);
  for (std::size_t i = 0; i < first_rows.size(); ++i) {
    Panel begun = whole;
    begun.topRows(first_rows[i]).setZero();
    const auto each = Setting::equations_of_groups(settings, begun, 1);
    for (std::size_t under = 0; under < settings.size(); ++under)
      for (std::size_t column = 0; column < 3; ++column)
        CHECK(same(all[under], 3 * i + column, each[under], column));
  }
}

}  // namespace thermocomp::diagnosis
