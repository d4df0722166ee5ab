/// The offsets at the nodes of a travel and the values that a controller interpolates by: pure, and
/// the same on every bus.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "drivers/controllers/controller_config.hpp"

namespace thermocomp {

/// @throws InvalidValue for nodes that cannot be
void check_shape(const TravelShape& shape);

/// @throws InvalidValue when a set of the travel cannot have so many values
void check_count(const TravelShape& shape, std::size_t values, const char* key);

/// The values of the set, in their units: K0, slope and P0, or the offsets themselves.
/// @param count      how many of them are written: a line's P0 may be left out
/// @param offset_um  shape (nodes)
[[nodiscard]] std::vector<double> travel_values(const TravelShape& shape, std::size_t count,
                                                std::span<const double> offset_um);

/// @param shown      values of a set
/// @param offset_um  shape (nodes); overwritten: what is applied there, NaN where it is not known
void offsets_shown(const TravelShape& shape, std::span<const double> shown,
                   std::span<double> offset_um) noexcept;

/// How far a node's offset moves with one count of everything that it is shown by [um].
/// @param counts  of each value of the set, in its unit; none: 0
[[nodiscard]] double node_resolution_um(const TravelShape& shape, std::span<const double> counts,
                                        std::size_t node) noexcept;

}  // namespace thermocomp
