/// A log of operators' corrections as displacements: each correction is a measured remainder with
/// its sign turned.
#pragma once

#include <string>

#include "config/runs/run_file.hpp"

namespace thermocomp::cli {

/// Whether an entry is added to those before, or is what stands at the controller from then on.
enum class CorrectionEntry { step, total };

/// displacement = -(sum of the steps until then), or -(total), in um, under the axis' name: an
/// operator who moves a tool by -12 um has found 12 um too much. Of columns called as an axis
/// (x, Y, z_mm, A_urad, ...); others stay.
/// @throws ConfigurationError where no column is an axis', or its unit is not said
[[nodiscard]] RunFile displacements_of(RunFile corrections, CorrectionEntry entry);

}  // namespace thermocomp::cli
