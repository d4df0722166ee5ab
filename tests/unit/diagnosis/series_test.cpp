// The filters of many time constants at once against the estimator's, which take a value at a time.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>

#include <catch2/catch.hpp>

#include "estimator/model/terms/low_pass.hpp"
#include "estimator/model/terms/play.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"

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

}  // namespace

TEST_CASE("lags of many time constants equal the estimator's", "[diagnosis]") {
  const Series series = uneven();
  const std::vector<double> taus_s = {0.0, 5.0, 60.0, 333.0, 1e4};
  const Panel all = lagged(series.time_s, series.values, taus_s);
  for (std::size_t i = 0; i < taus_s.size(); ++i) {
    LowPass filter(taus_s[i]);
    for (Eigen::Index row = 0; row < all.rows(); ++row)
      REQUIRE(std::abs(all(row, static_cast<Eigen::Index>(i)) -
                       filter.step(at(series.time_s[row]), series.values[row])) < 1e-9);
  }
}

TEST_CASE("plays of many widths equal the estimator's", "[diagnosis]") {
  const Series series = uneven();
  const std::vector<double> widths = {0.0, 0.5, 3.0, 100.0};
  const Panel all = played_less_values(series.values, widths);
  for (std::size_t i = 0; i < widths.size(); ++i) {
    Play filter(widths[i]);
    for (Eigen::Index row = 0; row < all.rows(); ++row)
      REQUIRE(std::abs(all(row, static_cast<Eigen::Index>(i)) -
                       (filter.step(series.values[row]) - series.values[row])) < 1e-9);
  }
}

TEST_CASE("slopes are central differences of the smoothed values", "[diagnosis]") {
  const Series series = uneven();
  const double tau_s = GENERATE(0.0, 30.0, 400.0);
  const Column smooth = smoothed(series.time_s, series.values, tau_s);
  const Column all = slope(series.time_s, series.values, tau_s);
  const Eigen::Index last = smooth.rows() - 1;
  for (Eigen::Index row = 0; row <= last; ++row) {
    const Eigen::Index low = std::max<Eigen::Index>(0, row - 1);
    const Eigen::Index high = std::min(last, row + 1);
    REQUIRE(std::abs(all[row] - (smooth[high] - smooth[low]) /
                                    (series.time_s[high] - series.time_s[low])) < 1e-9);
  }
}

TEST_CASE("denoising removes noise and keeps a reading without noise", "[diagnosis]") {
  const Eigen::Index n = 400;
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.05);
  Column time_s(n);
  Column truth(n);
  Column noisy(n);
  for (Eigen::Index row = 0; row < n; ++row) {
    time_s[row] = 60.0 * static_cast<double>(row);
    truth[row] = 5.0 * std::sin(time_s[row] / 3000.0);
    noisy[row] = truth[row] + noise(random);
  }
  CHECK((denoised(time_s, noisy) - truth).norm() < 0.6 * (noisy - truth).norm());
  CHECK((denoised(time_s, truth) - truth).cwiseAbs().maxCoeff() < 1e-9);
}

TEST_CASE("a shifted series is late by the shift, held at its ends", "[diagnosis]") {
  const Series series = uneven();
  const Column late = shifted(series.time_s, series.time_s, 90.0);
  CHECK(late[0] == series.time_s[0]);
  CHECK(late[100] == Approx(series.time_s[100] - 90.0));
  const Column early = shifted(series.time_s, series.time_s, -90.0);
  CHECK(early[100] == Approx(series.time_s[100] + 90.0));
  CHECK(early[299] == series.time_s[299]);
}

}  // namespace thermocomp::diagnosis
