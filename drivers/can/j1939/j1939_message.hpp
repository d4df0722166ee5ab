/// J1939 messages: identifiers, addresses, multi-packet transport. Pure.
#pragma once

#include <bitset>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

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
inline constexpr std::uint8_t address_null = 254;  ///< of a node without an address
inline constexpr int address_max = 253;
inline constexpr int j1939_bytes_max = 1785;  ///< of a multi-packet message

struct J1939Id {
  std::uint32_t pgn{0};
  std::uint8_t source{0};
  std::uint8_t destination{address_global};  ///< address_global unless the PGN is addressed
  int priority{6};                           ///< 0 (first) to 7
};

/// True if messages of this group are sent to one node: PDU format below 240.
[[nodiscard]] constexpr bool is_addressed(std::uint32_t pgn) noexcept {
  return ((pgn >> 8) & 0xFFu) < 240u;
}

[[nodiscard]] J1939Id read_identifier(std::uint32_t id) noexcept;
/// @pre an addressed PGN has 0 in its lowest byte
[[nodiscard]] CanId identifier(const J1939Id& id) noexcept;

/// @throws InvalidValue for an impossible place or PGN, with the keys of J1939Parameter
void check(const J1939Parameter& parameter);

/// Bits of the parameter; 0 beyond the end of the message. @pre check(parameter) passes
[[nodiscard]] std::uint64_t extract_raw(std::span<const std::uint8_t> message,
                                        const J1939Parameter& parameter) noexcept;

/// value = raw * scale + offset. The highest raw values are indicators (J1939-71, 5.1.4): for 8,
/// 16, 24 and 32 bits the highest byte 0xFE is an error, 0xFF not available, 0xFB to 0xFD reserved
/// (out_of_range); for other lengths all ones is not available and one less an error. A message
/// that is too short is bad_frame. @pre check(parameter) passes
[[nodiscard]] CanValue decode(std::span<const std::uint8_t> message,
                              const J1939Parameter& parameter) noexcept;

struct J1939Message {
  std::uint32_t pgn{0};
  std::uint8_t source{0};
  std::vector<std::uint8_t> bytes;
  nanoseconds received_at{};  ///< of the last packet
};

/// Receiver of J1939's transport protocol (J1939-21, 5.10): messages of 9 to 1785 bytes in packets,
/// broadcast (BAM) or sent to us (RTS/CTS). Pure: frames and times in, messages out.
class TransportReceiver {
 public:
  /// @param wanted  groups to assemble; others are ignored, or refused if sent to us
  explicit TransportReceiver(std::vector<std::uint32_t> wanted);

  /// Our address; nullopt: only broadcasts are received.
  void set_address(std::optional<std::uint8_t> address);
  /// Drops all transfers; nothing is sent to the senders.
  void forget();

  /// Groups pgn_transfer and pgn_transfer_data. @return the message that is complete now
  std::optional<J1939Message> take(const J1939Id& id, std::span<const std::uint8_t> data,
                                   nanoseconds at);
  /// Ends transfers with an overdue packet.
  void advance(nanoseconds now);
  [[nodiscard]] std::optional<CanFrame> next_frame();

  /// Transfers that ended without a message.
  [[nodiscard]] std::uint64_t failed() const noexcept { return failed_; }
  [[nodiscard]] std::size_t open_transfers() const noexcept { return transfers_.size(); }

 private:
  struct Transfer {
    std::uint32_t pgn{0};
    std::size_t size{0};
    int packets{0};
    int next{1};     ///< expected packet
    int granted{0};  ///< last packet that the sender may send (RTS/CTS)
    int granted_at_once{0};
    std::vector<std::uint8_t> bytes;
    nanoseconds deadline{};
  };
  struct Key {
    std::uint8_t source{0};
    bool broadcast{true};
    // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 sees a null pointer in every default <=>
    auto operator<=>(const Key&) const = default;
  };

  void begin(const J1939Id& id, std::span<const std::uint8_t> data, nanoseconds at);
  std::optional<J1939Message> take_packet(const J1939Id& id, std::span<const std::uint8_t> data,
                                          nanoseconds at);
  void grant(std::uint8_t source, Transfer& transfer, nanoseconds at);
  void control(std::uint8_t to, std::uint8_t kind, std::uint64_t middle, std::uint32_t pgn);
  void abort(std::uint8_t to, std::uint8_t reason, std::uint32_t pgn);
  [[nodiscard]] bool is_wanted(std::uint32_t pgn) const;

  std::vector<std::uint32_t> wanted_;
  std::optional<std::uint8_t> address_;
  std::map<Key, Transfer> transfers_;  ///< at most 2 x 256: one of each sort per sender
  std::deque<CanFrame> frames_;
  std::uint64_t failed_{0};
};

}  // namespace thermocomp
