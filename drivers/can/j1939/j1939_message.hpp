/// J1939 identifiers and parameters (SAE J1939-21 and -71). Pure.
#pragma once

#include <cstdint>
#include <span>

#include "drivers/can/can_socket.hpp"
#include "drivers/can/j1939/j1939_config.hpp"
#include "drivers/can/signal_codec.hpp"

namespace thermocomp {

inline constexpr std::uint32_t pgn_max = 0x3FFFF;
inline constexpr std::uint32_t pgn_request = 0x0EA00;
inline constexpr std::uint32_t pgn_transfer_data = 0x0EB00;
inline constexpr std::uint32_t pgn_transfer = 0x0EC00;  ///< connection management
inline constexpr std::uint32_t pgn_address_claimed = 0x0EE00;
inline constexpr std::uint8_t address_global = 255;
inline constexpr std::uint8_t address_null = 254;  ///< of a node that could not claim one
inline constexpr int address_max = 253;
inline constexpr int j1939_bytes_max = 1785;  ///< of a multi-packet message

struct J1939Id {
  std::uint32_t pgn{0};
  std::uint8_t source{0};
  std::uint8_t destination{address_global};  ///< address_global unless the PGN names one node
  int priority{6};                           ///< 0 (first) to 7
};

/// Whether messages of this group are sent to one node: PDU format below 240.
[[nodiscard]] constexpr bool is_addressed(std::uint32_t pgn) noexcept {
  return ((pgn >> 8) & 0xFFu) < 240u;
}

[[nodiscard]] J1939Id read_identifier(std::uint32_t id) noexcept;
/// @pre an addressed PGN has 0 in its lowest byte
[[nodiscard]] CanId identifier(const J1939Id& id) noexcept;

/// @throws InvalidValue for an impossible place or PGN; the keys are those of J1939Parameter
void check(const J1939Parameter& parameter);

/// The parameter's bits; those beyond the message's end are 0. @pre check(parameter) passes
[[nodiscard]] std::uint64_t extract_raw(std::span<const std::uint8_t> message,
                                        const J1939Parameter& parameter) noexcept;

/// value = raw * scale + offset. Raw values at the top are no values (J1939-71, 5.1.4): of 8, 16,
/// 24 and 32 bits the highest byte 0xFE is an error, 0xFF not available, 0xFB to 0xFD reserved
/// (out_of_range); of other lengths all ones is not available and one less an error. A message too
/// short is bad_frame. @pre check(parameter) passes
[[nodiscard]] CanValue decode(std::span<const std::uint8_t> message,
                              const J1939Parameter& parameter) noexcept;

}  // namespace thermocomp
