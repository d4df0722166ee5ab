/// CANopen emergency messages (CiA 301, 7.2.7). Pure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "drivers/can/canopen/canopen_config.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

struct Emergency {
  std::uint16_t code{0};  ///< 0x00xx: error reset or no error
  std::uint8_t error_register{0};
  std::array<std::uint8_t, 5> more{};  ///< manufacturer's, bytes 4 to 8 of the message
  [[nodiscard]] bool is_reset() const noexcept { return code < 0x0100; }
};

/// nullopt: wrong length for an emergency message.
[[nodiscard]] std::optional<Emergency> read_emergency(std::span<const std::uint8_t> data) noexcept;

/// "0x5030 device hardware (register 0x01)"
[[nodiscard]] std::string to_string(const Emergency& emergency);

/// Effect of an emergency message on one channel. nullopt: none; Fault::none: its error is over. A
/// reset without errors left in the register ends the errors of all channels. JUMO CANtrans T (data
/// sheet B 902910, emergency): byte 4 is the channel; byte 5 is 01 for a sensor break and binary 10
/// for a short circuit (hexadecimal 10 is accepted too).
[[nodiscard]] std::optional<Fault> emergency_fault(const Emergency& emergency, EmergencyForm form,
                                                   const CanopenChannel& channel) noexcept;

}  // namespace thermocomp
