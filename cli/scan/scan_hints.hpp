/// What registers that decode to nothing plausible may be instead. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp::cli {

/// Temperatures that a sensor may have, from its [screening].
struct PlausibleRange {
  double min_degC{-30.0};
  double max_degC{200.0};
};

/// Whether a decoded temperature may be true: in the range, and not a float so near 0 that only
/// the bytes of another number in a wrong order make it.
[[nodiscard]] bool is_plausible(const ModbusChannel& channel, double temp_degC,
                                const PlausibleRange& range);

/// The raw value, where it is one that most modules send for a broken wire: an end of the encoding.
[[nodiscard]] std::optional<std::int64_t> likely_open_code(const ModbusChannel& channel,
                                                           std::span<const std::uint16_t> words);

/// For registers of which the temperature is not plausible: the word orders, scales and codes with
/// which they would be, each a sentence. @param words  of the channel's value
[[nodiscard]] std::vector<std::string> hints_for_words(const ModbusChannel& channel,
                                                       std::span<const std::uint16_t> words,
                                                       const PlausibleRange& range);

/// For an address that the device refuses (exception 2 or 3), from the address alone.
[[nodiscard]] std::vector<std::string> hints_for_address(const ModbusChannel& channel);

}  // namespace thermocomp::cli
