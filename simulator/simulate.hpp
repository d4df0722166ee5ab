/// A simulated machine's run, as columns of a run file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "simulator/machine_config.hpp"

namespace thermocomp {

/// Columns of equal length: time_s, operating signals and positions, thermocouples (*_degC, as
/// measured), displacements (*_um, as an indicator of the output's noise_um would show them).
struct SimulatedRun {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;  ///< shape (names, samples)
};

/// One sample every machine.pitch_s of plant time from 0 up to and including `duration_s`.
/// The same machine and seed give the same run, bit for bit. Events are not applied: they belong
/// to the devices.
/// @pre machine.plant is there, duration_s >= 0 (checked)
[[nodiscard]] SimulatedRun simulate(const MachineConfig& machine, double duration_s,
                                    std::uint64_t seed);

}  // namespace thermocomp
