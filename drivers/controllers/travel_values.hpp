/// Offsets at the nodes of a travel <-> the values that the controller interpolates. Pure.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "drivers/controllers/controller_config.hpp"

namespace thermocomp {

/// @throws InvalidValue for impossible nodes
void check_shape(const TravelShape& shape);

/// @throws InvalidValue for a number of values that the set of the travel cannot have
void check_count(const TravelShape& shape, std::size_t values, const char* key);

/// Values of the set, in their units: K0, slope and P0, or the offsets themselves.
/// @param count      number of values written: P0 of a line may be missing
/// @param offset_um  shape (nodes)
[[nodiscard]] std::vector<double> travel_values(const TravelShape& shape, std::size_t count,
                                                std::span<const double> offset_um);

/// @param shown      values of a set
/// @param offset_um  shape (nodes); overwritten: applied offset, NaN: unknown
void offsets_shown(const TravelShape& shape, std::span<const double> shown,
                   std::span<double> offset_um) noexcept;

/// Change of a node's offset with one count of each value that shows it [um].
/// @param counts  of each value of the set, in its unit; none: 0
[[nodiscard]] double node_resolution_um(const TravelShape& shape, std::span<const double> counts,
                                        std::size_t node) noexcept;

}  // namespace thermocomp
