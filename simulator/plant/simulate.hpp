/// Simulates a run of a machine without its devices.
#pragma once

#include <cstdint>

#include "config/runs/run_file.hpp"
#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

/// Columns: time_s, operating signals and positions, thermocouples (*_degC, as measured),
/// displacements (*_um, with the output's noise_um of an indicator). One sample every
/// machine.pitch_s of plant time from 0 up to and including `duration_s`. The same machine and seed
/// give the same run, bit for bit. Events are not applied, since they act on devices.
/// @pre machine.plant has a value, duration_s >= 0 (checked)
[[nodiscard]] RunFile simulate(const MachineConfig& machine, double duration_s, std::uint64_t seed);

}  // namespace thermocomp
