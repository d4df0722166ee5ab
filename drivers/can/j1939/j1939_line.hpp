/// One J1939 bus: parameter groups, multi-packet messages, address claims. Pure.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "drivers/can/can_protocol.hpp"
#include "drivers/can/j1939/j1939_message.hpp"

namespace thermocomp {

/// A device is identified by its source address or, if its NAME is configured, by the address that
/// the NAME claims (J1939-81). If another NAME claims that address, the readings are no_answer
/// until the device's NAME is received again. Two NAMEs that claim one address within a short time
/// are two senders, and its readings device_error, until one of them claims another address.
class J1939Line final : public CanProtocol {
 public:
  /// @throws InvalidValue for impossible parameters and addresses
  explicit J1939Line(J1939BusConfig config);

  [[nodiscard]] std::vector<CanFilter> wanted() const override;
  [[nodiscard]] std::vector<std::size_t> sensors() const override;
  void opened(nanoseconds now) override;
  void closed(nanoseconds now) override;
  void take(const CanFrame& frame) override;
  void advance(nanoseconds now) override;
  [[nodiscard]] std::optional<CanFrame> next_frame() override;
  [[nodiscard]] std::span<const Reading> readings() const override { return readings_; }
  [[nodiscard]] std::vector<RawReading> raw() const override { return raw_; }
  [[nodiscard]] std::vector<UnitHealth> health(nanoseconds now) const override;

  /// Our address; nullopt if another node has claimed it.
  [[nodiscard]] std::optional<std::uint8_t> own_address() const noexcept { return own_address_; }
  /// Present address of the device.
  [[nodiscard]] std::optional<std::uint8_t> address_of(std::size_t node) const;

 private:
  struct Claim {
    std::uint64_t name{0};
    nanoseconds at{};
  };
  /// Two devices at one address.
  struct Rivals {
    std::uint8_t address{0};
    std::array<std::uint64_t, 2> names{};
    nanoseconds heard_at{};
  };
  struct Node {
    std::optional<std::uint8_t> address;
    std::optional<Rivals> rivals{};
    std::size_t first{0};  ///< index of its first channel in the readings
    UnitHealth counters;
    std::string note;  ///< problem with its address
    nanoseconds good_at{};
  };

  void take_group(std::uint32_t pgn, std::uint8_t source, std::span<const std::uint8_t> bytes,
                  nanoseconds at);
  void take_claim(std::uint8_t source, std::span<const std::uint8_t> data, nanoseconds at);
  void take_claim_of_ours(std::uint64_t name);
  void move_node(std::size_t node, std::uint8_t source, std::uint64_t name, nanoseconds at);
  void note_rivals(std::size_t node, std::uint8_t source, std::uint64_t name, nanoseconds at);
  void claim(std::uint8_t from);
  void ask_for_names();
  void lose(std::size_t node, nanoseconds at, Fault fault = Fault::no_answer);

  const J1939BusConfig config_;
  std::vector<Node> nodes_;
  std::vector<Reading> readings_;  ///< those of the nodes, one after the other
  std::vector<RawReading> raw_;
  TransportReceiver transport_;
  std::optional<std::uint8_t> own_address_;
  std::string own_error_;
  std::array<std::optional<Claim>, 256> claims_{};  ///< the last one of each address
  bool open_{false};
  std::deque<CanFrame> frames_;
};

}  // namespace thermocomp
