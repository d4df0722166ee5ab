#include "model_properties.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <optional>
#include <vector>

#include "estimator/model/displacement_model.hpp"
#include "fuzz.hpp"

namespace thermocomp::fuzz {
namespace {

bool same(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}
bool same(const std::vector<double>& a, const std::vector<double>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](double x, double y) { return same(x, y); });
}
bool same(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const auto& x, const auto& y) { return same(x, y); });
}

}  // namespace

void check_same(const ThermalModel& a, const ThermalModel& b) {
  FUZZ_REQUIRE(a.inputs == b.inputs);
  FUZZ_REQUIRE(a.outputs == b.outputs);
  FUZZ_REQUIRE(same(a.reference_degC, b.reference_degC));
  FUZZ_REQUIRE(same(a.matrix_um_per_K, b.matrix_um_per_K));
  FUZZ_REQUIRE(same(a.covariance_K2, b.covariance_K2));
  FUZZ_REQUIRE(same(a.covariance_growth.noise_K, b.covariance_growth.noise_K));
  FUZZ_REQUIRE(same(a.covariance_growth.drift_time_s, b.covariance_growth.drift_time_s));
  FUZZ_REQUIRE(same(a.covariance_growth.scatter_time_s, b.covariance_growth.scatter_time_s));
  FUZZ_REQUIRE(same(a.covariance_growth.drift_factor, b.covariance_growth.drift_factor));
  FUZZ_REQUIRE(same(a.covariance_growth.scatter_factor, b.covariance_growth.scatter_factor));
  FUZZ_REQUIRE(a.made_from == b.made_from);
  FUZZ_REQUIRE(a.guideways.size() == b.guideways.size());
  for (std::size_t i = 0; i < a.guideways.size(); ++i) {
    FUZZ_REQUIRE(a.guideways[i].name == b.guideways[i].name);
    FUZZ_REQUIRE(a.guideways[i].axis == b.guideways[i].axis);
    FUZZ_REQUIRE(same(a.guideways[i].positions_mm, b.guideways[i].positions_mm));
    FUZZ_REQUIRE(a.guideways[i].rows_um_per_K == b.guideways[i].rows_um_per_K);
  }
  FUZZ_REQUIRE(a.terms.size() == b.terms.size());
  for (std::size_t i = 0; i < a.terms.size(); ++i) {
    FUZZ_REQUIRE(a.terms[i].kind == b.terms[i].kind);
    FUZZ_REQUIRE(a.terms[i].subject == b.terms[i].subject);
    FUZZ_REQUIRE(a.terms[i].shared == b.terms[i].shared);
    FUZZ_REQUIRE(a.terms[i].per_output == b.terms[i].per_output);
    FUZZ_REQUIRE(a.terms[i].bank == b.terms[i].bank);
  }
}

void check_steps(const ThermalModel& model) {
  DisplacementModel displacement(model);
  std::optional<ModelDomain> domain;
  if (model.made_from) domain.emplace(model);
  const std::vector<double> reference(model.temperature_columns().size(), 20.0);
  std::vector<double> temps(reference);
  std::vector<double> signals(model.signal_columns().size(), 0.0);
  std::vector<double> result(model.outputs.size());
  nanoseconds now = std::chrono::hours(1);
  for (const double temp_degC : {20.0, 21.0, -273.15, 3000.0}) {
    std::fill(temps.begin(), temps.end(), temp_degC);
    std::fill(signals.begin(), signals.end(), 1e3 * temp_degC);
    displacement.step(now, temps, reference, signals, result);
    if (domain) domain->step(now, temps, reference, signals);
    now += std::chrono::milliseconds(10);
  }
  FUZZ_REQUIRE(displacement.plan_terms(displacement).size() == model.terms.size());
}

}  // namespace thermocomp::fuzz
