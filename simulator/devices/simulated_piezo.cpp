#include "simulator/devices/simulated_piezo.hpp"

#include <algorithm>

#include "estimator/checks.hpp"

namespace thermocomp {

SimulatedPiezo::SimulatedPiezo(const SimulatedPiezoConfig& config) : config_(config) {
  THERMOCOMP_ENSURE(config.curve_V.size() >= 2 && config.curve_V.size() == config.curve_um.size());
}

double SimulatedPiezo::step(double volt) noexcept {
  felt_V_ = std::max(felt_V_, volt - config_.dead_band_V);
  felt_V_ = std::min(felt_V_, std::max(volt, 0.0));
  return displacement_um();
}

double SimulatedPiezo::displacement_um() const noexcept {
  const auto& [dead_band_V, at_V, um] = config_;
  const auto above = std::upper_bound(at_V.begin(), at_V.end(), felt_V_);
  if (above == at_V.begin()) return um.front();
  if (above == at_V.end()) return um.back();
  const auto next = static_cast<std::size_t>(above - at_V.begin());
  const double share = (felt_V_ - at_V[next - 1]) / (at_V[next] - at_V[next - 1]);
  return um[next - 1] + share * (um[next] - um[next - 1]);
}

}  // namespace thermocomp
