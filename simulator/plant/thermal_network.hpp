/// Exact integration of heat flow between lumps.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace thermocomp {

/// C dT/dt = -K T + q with diagonal C [J/K] and symmetric K [W/K] (n x n). For constant q the
/// solution in the modes of C^-1/2 K C^-1/2 is exact for any time step.
class ThermalNetwork {
 public:
  /// @param conductance_W_per_K  n x n by row, symmetric, positive semidefinite (checked: size)
  ThermalNetwork(std::span<const double> capacity_J_per_K,
                 std::span<const double> conductance_W_per_K);
  ~ThermalNetwork();
  ThermalNetwork(ThermalNetwork&&) noexcept;
  ThermalNetwork& operator=(ThermalNetwork&&) noexcept;

  /// @param temps_degC  n; overwritten by the temperatures dt_s later
  /// @param heat_W      n; q, constant meanwhile
  void advance(double dt_s, std::span<const double> heat_W, std::span<double> temps_degC) const;

 private:
  struct Modes;
  std::unique_ptr<Modes> modes_;
};

}  // namespace thermocomp
