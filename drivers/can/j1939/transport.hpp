/// The receiving side of J1939's transport protocol (J1939-21, 5.10): messages of 9 to 1785 bytes
/// in packets, broadcast (BAM) or sent to us (RTS/CTS). Pure: frames and times in, messages out.
#pragma once

#include <bitset>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "drivers/can/can_socket.hpp"
#include "drivers/can/j1939/j1939_message.hpp"

namespace thermocomp {

struct J1939Message {
  std::uint32_t pgn{0};
  std::uint8_t source{0};
  std::vector<std::uint8_t> bytes;
  nanoseconds received_at{};  ///< of the last packet
};

class TransportReceiver {
 public:
  /// @param wanted  groups to be put together; others are passed over, or refused if sent to us
  explicit TransportReceiver(std::vector<std::uint32_t> wanted);

  /// Our address; nullopt: only broadcasts are taken.
  void set_address(std::optional<std::uint8_t> address);
  /// Drops all transfers; the senders are not told.
  void forget();

  /// Groups pgn_transfer and pgn_transfer_data. @return a message that is whole now
  std::optional<J1939Message> take(const J1939Id& id, std::span<const std::uint8_t> data,
                                   nanoseconds at);
  /// Ends transfers whose next packet is overdue.
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
    int next{1};     ///< packet that must come
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
  std::map<Key, Transfer> transfers_;  ///< one of each sort per sender: at most 2 x 256
  std::deque<CanFrame> frames_;
  std::uint64_t failed_{0};
};

}  // namespace thermocomp
