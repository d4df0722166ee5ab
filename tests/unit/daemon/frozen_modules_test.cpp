#include "daemon/status/frozen_modules.hpp"

#include <cmath>
#include <random>

#include <catch2/catch.hpp>

namespace thermocomp {
namespace {

using std::chrono::milliseconds;

/// One module, seen every 0.1 s and polled every 0.2 s.
class ModuleWatch {
 public:
  explicit ModuleWatch(std::size_t channels) {
    config_.sensors.resize(channels);
    for (SensorConfig& sensor : config_.sensors) sensor.module = "m1";
    report_.sensors.resize(channels);
  }

  /// @param value_degC  of a channel at a time [s] since the first call
  template <class Value>
  bool is_frozen_after(double seconds, const Value& value_degC) {
    for (int i = 0; i < static_cast<int>(10 * seconds); ++i, ++looks_) {
      const double time_s = 0.1 * looks_;
      if (looks_ % 2 == 0)
        for (std::size_t k = 0; k < report_.sensors.size(); ++k) {
          report_.sensors[k].raw_degC = value_degC(k, time_s);
          if (std::isfinite(report_.sensors[k].raw_degC))  // else not taken
            report_.sensors[k].taken_at = milliseconds(100 * (looks_ + 1));
        }
      modules_.note(report_, config_);
    }
    return !modules_.frozen_s().empty();
  }
  [[nodiscard]] double frozen_s() const { return modules_.frozen_s().at("m1"); }
  double noise(double sd_K) { return std::normal_distribution<double>(0.0, sd_K)(random_); }

 private:
  EstimatorConfig config_;
  Report report_;
  FrozenModules modules_;
  int looks_{0};
  std::mt19937 random_{7};
};

double in_steps(double value_degC, double step_K) {
  return step_K * std::round(value_degC / step_K);
}

TEST_CASE("noisy values that become bit-identical are reported after 60 s, until the next change",
          "[frozen]") {
  ModuleWatch watch(4);
  const auto noisy = [&](std::size_t k, double time_s) {
    return in_steps(22.0 + static_cast<double>(k) + 0.01 * time_s + watch.noise(0.02), 0.01);
  };
  const auto still = [](std::size_t k, double) { return 22.0 + static_cast<double>(k); };
  CHECK_FALSE(watch.is_frozen_after(15, noisy));
  CHECK_FALSE(watch.is_frozen_after(59, still));
  REQUIRE(watch.is_frozen_after(3, still));
  CHECK(watch.frozen_s() == Approx(61.0).margin(1.0));
  REQUIRE(watch.is_frozen_after(3600, still));
  CHECK_FALSE(watch.is_frozen_after(0.2, noisy));
  CHECK_FALSE(watch.is_frozen_after(59, still));
}

TEST_CASE("one channel that goes on moving keeps its module alive", "[frozen]") {
  ModuleWatch watch(4);
  const auto noisy = [&](std::size_t, double) { return 22.0 + watch.noise(0.02); };
  const auto one = [&](std::size_t k, double) { return k == 0 ? 22.0 + watch.noise(0.02) : 22.0; };
  CHECK_FALSE(watch.is_frozen_after(30, noisy));
  CHECK_FALSE(watch.is_frozen_after(300, one));
}

TEST_CASE("a ramp that ends is not frozen", "[frozen]") {
  ModuleWatch watch(2);
  CHECK_FALSE(watch.is_frozen_after(
      300, [](std::size_t, double time_s) { return 22.0 + 0.05 * std::min(time_s, 60.0); }));
}

TEST_CASE("a coarse channel that flickers between two steps and then rests is not frozen",
          "[frozen]") {
  const double sd_K = GENERATE(0.0, 0.02, 0.04);
  ModuleWatch watch(4);
  CHECK_FALSE(watch.is_frozen_after(300, [&](std::size_t k, double time_s) {
    const double rest_degC = 22.05 + 0.002 * std::min(time_s, 25.0);
    return in_steps(
        rest_degC + (time_s < 25 ? watch.noise(sd_K) : 0.0) + 0.1 * static_cast<double>(k), 0.1);
  }));
}

TEST_CASE("a module renewed every 2 s is not frozen when it rests", "[frozen]") {
  ModuleWatch watch(2);
  double shown_degC = 22.0;
  CHECK_FALSE(watch.is_frozen_after(600, [&](std::size_t k, double time_s) {
    if (k == 0 && time_s < 300 && std::fmod(time_s + 0.01, 2.0) < 0.1)
      shown_degC = 22.0 + watch.noise(0.05);
    return shown_degC;
  }));
}

TEST_CASE("a quiet channel alone on its module is not frozen", "[frozen]") {
  ModuleWatch watch(1);
  CHECK_FALSE(watch.is_frozen_after(600, [](std::size_t, double) { return 22.0; }));
}

TEST_CASE("a silent module is not frozen", "[frozen]") {
  ModuleWatch watch(2);
  const auto noisy = [&](std::size_t, double) { return 22.0 + watch.noise(0.02); };
  CHECK_FALSE(watch.is_frozen_after(30, noisy));
  CHECK_FALSE(watch.is_frozen_after(300, [](std::size_t, double) { return not_a_number; }));
}

}  // namespace
}  // namespace thermocomp
