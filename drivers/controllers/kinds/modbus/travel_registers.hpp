/// The set of a travel (travel_values.hpp) in the registers of a controller that interpolates
/// (ModbusTravel): pure.
#pragma once

#include <cstdint>
#include <span>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"

namespace thermocomp {

/// @throws InvalidValue for nodes or registers that cannot be
void check_travel(const ModbusTravel& travel);

/// begin, values and end in one field, so that one request carries them: number, what the offsets
/// at the nodes come to, number.
/// @param number  of the set; an earlier one must not stand in `end` [0, travel_numbers)
[[nodiscard]] WriteField travel_field(const ModbusTravel& travel, std::uint64_t number,
                                      std::span<const double> offset_um);

/// How many numbers a set can have before they begin anew.
[[nodiscard]] std::uint64_t travel_numbers(const ModbusTravel& travel) noexcept;

/// How far a node's offset moves with one count of everything that it is shown by [um].
[[nodiscard]] double shown_resolution_um(const ModbusTravel& travel, std::size_t node);

}  // namespace thermocomp
