#include <algorithm>
#include <cmath>
#include <random>

#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "estimator/sensing/neighbours.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

/// n inputs that mostly move together, random by seed.
ThermalModel model_of(std::size_t n, unsigned seed = 1) {
  std::mt19937_64 engine(seed);
  const auto chance = [&] { return 2.0 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1.0; };
  Eigen::MatrixXd mix(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  for (Eigen::Index i = 0; i < mix.rows(); ++i)
    for (Eigen::Index j = 0; j < mix.cols(); ++j)
      mix(i, j) = chance() / (1.0 + static_cast<double>(j));
  const Eigen::MatrixXd covariance = mix * mix.transpose();
  ThermalModel model;
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {std::vector<double>(n, 1.0)};
  for (std::size_t i = 0; i < n; ++i) {
    std::string name("t");
    model.inputs.push_back(name.append(std::to_string(i + 1)).append("_degC"));
    auto& row = model.covariance_K2.emplace_back();
    for (std::size_t j = 0; j < n; ++j)
      row.push_back(covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
  }
  model.covariance_growth.drift_time_s = 3600.0;
  return model;
}

/// Steps of 10 s.
struct Bank {
  explicit Bank(const ThermalModel& model, nanoseconds settle = 5s)
      : lost(model, settle), temps_degC(model.inputs.size(), 20.0), good(model.inputs.size(), 1) {}
  void step(int count = 1) {
    for (int i = 0; i < count; ++i) lost.step(now += 10s, temps_degC, good);
  }
  LostBlocks lost;
  std::vector<double> temps_degC;
  std::vector<std::uint8_t> good;
  nanoseconds now{};
};

/// B of x_L = a_L + B (x_O - a_O) from the covariance itself.
Eigen::MatrixXd gains(const ThermalModel& model, const std::vector<std::size_t>& lost,
                      const std::vector<std::size_t>& seen) {
  const auto part = [&](const auto& rows, const auto& columns) {
    Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows.size()),
                           static_cast<Eigen::Index>(columns.size()));
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t j = 0; j < columns.size(); ++j) {
        const double noise_K = model.covariance_growth.noise_K;
        matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
            model.covariance_K2[rows[i]][columns[j]] +
            (rows[i] == columns[j] ? noise_K * noise_K : 0.0);
      }
    return matrix;
  };
  return part(seen, seen).ldlt().solve(part(seen, lost)).transpose();
}

}  // namespace

TEST_CASE("a lost block follows the others by the conditional expectation", "[lost_blocks]") {
  const ThermalModel model = model_of(7);
  const std::vector<std::size_t> lost =
      GENERATE(std::vector<std::size_t>{3}, std::vector<std::size_t>{0, 4},
               std::vector<std::size_t>{1, 2, 3, 5, 6});
  Bank bank(model);
  bank.step();
  for (const std::size_t i : lost) bank.good[i] = 0;
  bank.step();
  std::vector<std::size_t> seen;
  Eigen::VectorXd change_K(static_cast<Eigen::Index>(7 - lost.size()));
  for (std::size_t i = 0; i < 7; ++i) {
    if (bank.good[i] == 0) continue;
    change_K(static_cast<Eigen::Index>(seen.size())) = 0.3 * static_cast<double>(i) - 1.0;
    bank.temps_degC[i] += change_K(static_cast<Eigen::Index>(seen.size()));
    seen.push_back(i);
  }
  bank.step();
  const Eigen::VectorXd expected_K = gains(model, lost, seen) * change_K;
  CHECK(bank.lost.complete());
  for (std::size_t a = 0; a < lost.size(); ++a) {
    CHECK(bank.lost.temps_degC()[lost[a]] ==
          Approx(20.0 + expected_K(static_cast<Eigen::Index>(a))).margin(1e-9));
    CHECK(bank.lost.estimated(lost[a]));
  }
  CHECK_FALSE(bank.lost.estimated(seen[0]));
  CHECK(bank.lost.sd_K(seen[0]) == 0.0);
}

TEST_CASE("an estimate starts at the last good value and becomes uncertain with time",
          "[lost_blocks]") {
  Bank bank(model_of(5));
  bank.temps_degC = {20, 21, 22, 23, 24};
  bank.step();
  bank.good[2] = 0;
  bank.temps_degC[2] = 99.0;  // the value of a block that is not good is not used
  bank.step();
  CHECK(bank.lost.temps_degC()[2] == 22.0);
  double before_K = bank.lost.sd_K(2);
  CHECK(before_K == Approx(0.02 * std::sqrt(2.0)).margin(1e-6));
  for (int i = 0; i < 500; ++i) {
    bank.step();
    CHECK(bank.lost.sd_K(2) > before_K);
    before_K = bank.lost.sd_K(2);
  }
  const std::vector<double> gain{0, 0, -3.0, 0, 0};
  CHECK(bank.lost.sd_of(gain) == Approx(3.0 * before_K));
}

TEST_CASE("a second loss changes no estimate and keeps the uncertainty", "[lost_blocks]") {
  Bank bank(model_of(6));
  bank.step();
  bank.good[1] = 0;
  bank.step();
  bank.temps_degC = {20.5, 0, 21.0, 20.2, 19.0, 20.4};
  bank.step(200);
  const double estimate_degC = bank.lost.temps_degC()[1];
  const double sd_K = bank.lost.sd_K(1);
  CHECK(estimate_degC != 20.0);
  bank.good[4] = 0;
  bank.step();
  CHECK(bank.lost.temps_degC()[1] == Approx(estimate_degC).margin(1e-12));
  CHECK(bank.lost.temps_degC()[4] == 19.0);
  CHECK(bank.lost.sd_K(1) >= sd_K);
}

TEST_CASE("a returning block corrects one that is still lost", "[lost_blocks]") {
  ThermalModel model = model_of(3);
  model.covariance_K2 = {{4.0, 3.9, 0.0}, {3.9, 4.0, 0.0}, {0.0, 0.0, 4.0}};
  Bank bank(model);
  bank.step();
  bank.good = {0, 0, 1};
  bank.step(360);
  CHECK(bank.lost.temps_degC()[0] == Approx(20.0));
  const double sd_K = bank.lost.sd_K(0);
  bank.good[1] = 1;
  bank.temps_degC[1] = 22.0;
  bank.step();
  CHECK(bank.lost.temps_degC()[0] == Approx(20.0 + 2.0 * 3.9 / 4.0).epsilon(0.01));
  CHECK(bank.lost.sd_K(0) < 0.4 * sd_K);
}

TEST_CASE("without a measured block, or without a first value, nothing is estimated",
          "[lost_blocks]") {
  Bank bank(model_of(3));
  bank.step();
  bank.good = {0, 0, 0};
  bank.step();
  CHECK_FALSE(bank.lost.complete());
  CHECK_FALSE(bank.lost.estimated(0));
  bank.good = {0, 1, 1};
  bank.step();
  CHECK(bank.lost.complete());

  Bank never(model_of(3));
  never.good = {0, 1, 1};
  never.temps_degC[0] = not_a_number;
  never.step(100);
  CHECK_FALSE(never.lost.complete());
  never.good[0] = 1;
  never.temps_degC[0] = 25.0;
  never.step();
  CHECK(never.lost.complete());
  never.good[0] = 0;
  never.step();
  CHECK(never.lost.complete());
  CHECK(never.lost.temps_degC()[0] == 25.0);
}

TEST_CASE("without a covariance a lost block stays lost", "[lost_blocks]") {
  ThermalModel model = model_of(3);
  model.covariance_K2.clear();
  Bank bank(model);
  bank.step();
  bank.good[0] = 0;
  bank.step();
  CHECK_FALSE(bank.lost.complete());
  CHECK_FALSE(bank.lost.estimated(0));
}

TEST_CASE("after a restart a lost block continues from its stored value, with fully grown drift",
          "[lost_blocks]") {
  const ThermalModel model = model_of(4);
  Bank bank(model, 60s);
  for (std::size_t i = 0; i < 4; ++i) bank.lost.restore(i, 30.0);
  bank.good[3] = 0;
  bank.temps_degC = {31.0, 30.5, 30.0, not_a_number};
  bank.step(3);
  CHECK_FALSE(bank.lost.complete());  // its sensor may still be starting up
  bank.step(10);
  REQUIRE(bank.lost.complete());
  const Eigen::Vector3d change_K(1.0, 0.5, 0.0);
  const double expected_K = (gains(model, {3}, {0, 1, 2}) * change_K)(0);
  CHECK(bank.lost.temps_degC()[3] == Approx(30.0 + expected_K));
  Bank grown(model);
  grown.step();
  grown.good[3] = 0;
  grown.step(100'000);
  CHECK(bank.lost.sd_K(3) >= 0.99 * grown.lost.sd_K(3));
}

TEST_CASE("a value given for a block that stays measured is dropped and not part of the state",
          "[lost_blocks]") {
  Bank bank(model_of(4));
  bank.step(3);
  bank.lost.continue_from(1, 19.0, 2.0);  // the block continues with another sensor
  bank.step();
  StateArchive count;
  bank.lost.visit_state(count);
  std::vector<std::byte> bytes(count.position_bytes());
  StateArchive save{std::span<std::byte>(bytes)};
  bank.lost.visit_state(save);
  Bank again(model_of(4));
  StateArchive load{std::span<const std::byte>(bytes)};
  again.lost.visit_state(load);
  again.now = bank.now;
  for (Bank* each : {&bank, &again}) {
    each->good[1] = 0;
    each->step();
  }
  CHECK(bank.lost.sd_K(1) == again.lost.sd_K(1));
  CHECK(bank.lost.temps_degC()[1] == 20.0);
}

TEST_CASE("a reload continues estimates by name", "[lost_blocks]") {
  const ThermalModel model = model_of(4);
  Bank bank(model);
  bank.step();
  bank.good[2] = 0;
  bank.temps_degC[0] = 21.0;
  bank.step(50);
  ThermalModel next_model = model;
  std::swap(next_model.inputs[2], next_model.inputs[0]);
  Bank next(next_model);
  next.lost.plan_adoption(bank.lost);
  next.lost.adopt(bank.lost);
  next.now = bank.now;
  next.good = {0, 1, 1, 1};
  next.temps_degC = {not_a_number, 20.0, 21.0, 20.0};
  next.step();
  CHECK(next.lost.complete());
  CHECK(next.lost.temps_degC()[0] == Approx(bank.lost.temps_degC()[2]).margin(1e-9));
  CHECK(next.lost.sd_K(0) >= bank.lost.sd_K(2));
}

TEST_CASE("for any losses and returns, estimates and their deviations stay finite",
          "[lost_blocks][property]") {
  const auto seed = GENERATE(range(0u, 60u));
  std::mt19937_64 engine(seed);
  ThermalModel model = model_of(2 + engine() % 12, seed);
  if (seed % 3 == 0)  // all inputs equal: the matrix is singular
    for (auto& row : model.covariance_K2) std::fill(row.begin(), row.end(), 2.0);
  model.covariance_growth.scatter_factor.assign(model.inputs.size(), 1.5);
  if (seed % 2 == 0) model.covariance_growth.drift_time_s = 0.0;
  Bank bank(model);
  for (int i = 0; i < 400; ++i) {
    for (std::size_t k = 0; k < bank.good.size(); ++k) {
      bank.temps_degC[k] += 0.1 * static_cast<double>(engine() % 11) - 0.5;
      if (engine() % 10 == 0) bank.good[k] ^= 1u;
    }
    bank.step();
    for (std::size_t k = 0; k < bank.good.size(); ++k) {
      REQUIRE(bank.lost.sd_K(k) >= 0.0);
      REQUIRE(bank.lost.sd_K(k) < 1e4);
      if (bank.good[k] != 0) REQUIRE(bank.lost.temps_degC()[k] == bank.temps_degC[k]);
      if (bank.lost.estimated(k)) REQUIRE(std::abs(bank.lost.temps_degC()[k]) < 1e4);
    }
    REQUIRE(bank.lost.sd_of(std::vector<double>(bank.good.size(), 5.0)) >= 0.0);
  }
}

TEST_CASE("a covariance that does not fit is refused", "[lost_blocks]") {
  const auto refused = [](auto change) {
    ThermalModel model = model_of(3);
    change(model);
    CHECK_THROWS_AS(LostBlocks(model, 5s), InvalidValue);
  };
  refused([](auto& model) { model.covariance_K2.pop_back(); });
  refused([](auto& model) { model.covariance_K2[0][0] = -50.0; });
  refused([](auto& model) { model.covariance_growth.drift_factor = {1.0}; });
  refused([](auto& model) { model.covariance_growth.scatter_factor = {1.0, -1.0, 1.0}; });
  refused([](auto& model) { model.covariance_growth.noise_K = 0.0; });
  refused([](auto& model) { model.covariance_growth.drift_time_s = not_a_number; });
}
