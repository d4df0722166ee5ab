/// Simulated CANopen node without I/O: NMT, heartbeat, TPDO, SDO server, emergency messages.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "drivers/can/canopen/canopen_config.hpp"
#include "simulator/devices/field_nodes.hpp"

namespace thermocomp {

class CanopenSlave final : public FieldNode {
 public:
  /// Powers the node up: boot-up message, then pre-operational.
  CanopenSlave(const SimulatedCanopenNode& config, nanoseconds now);

  void take(const CanFrame& frame, nanoseconds now) override;
  void update(nanoseconds now, std::span<const double> temps_degC) override;
  [[nodiscard]] std::optional<CanFrame> next_frame() override;

 private:
  using Key = std::pair<std::uint16_t, std::uint8_t>;
  struct Shown {
    std::optional<ChannelFault> fault;
    std::optional<std::int64_t> code;
  };

  void boot(nanoseconds now);
  void take_command(std::uint8_t command, nanoseconds now);
  void take_request(std::span<const std::uint8_t> data);
  void answer_read(ObjectAddress object);
  void answer_write(ObjectAddress object, std::span<const std::uint8_t> data);
  void answer_segment(bool toggle);
  void abort(ObjectAddress object, std::uint32_t code);
  void answer(std::uint8_t command, ObjectAddress object, std::uint64_t data);
  /// Sends with a COB-ID of this node; `function` is the COB-ID without the node's number.
  void put(std::uint32_t function, std::span<const std::uint8_t> data);
  void send(std::uint32_t id, std::span<const std::uint8_t> data);
  void show_value(std::size_t channel, double temp_degC, std::span<std::uint8_t> payload) const;
  [[nodiscard]] Shown shown_of(std::size_t channel) const;
  [[nodiscard]] std::optional<std::int64_t> status_of(std::size_t channel) const;
  void measure(std::span<const double> temps_degC);
  void send_emergencies();
  void send_values();
  [[nodiscard]] bool is_now(const NodeEvent& event) const;
  [[nodiscard]] bool happens(NodeEventKind kind) const;
  /// Event active on a channel; nullptr: none.
  [[nodiscard]] const NodeEvent* fault_of(std::size_t channel) const;
  [[nodiscard]] std::uint64_t number_at(ObjectAddress object) const;

  const SimulatedCanopenNode config_;
  const nanoseconds switched_on_;
  nanoseconds now_;
  std::uint8_t state_{0};
  std::map<Key, std::vector<std::uint8_t>> objects_;
  std::vector<std::uint8_t> segments_;                        ///< remainder of a segmented read
  std::vector<CanopenChannel> places_;                        ///< by channel
  std::map<std::uint32_t, std::vector<std::uint8_t>> tpdos_;  ///< by COB-ID
  std::vector<std::uint8_t> emergencies_;  ///< by channel: byte 5 of the message sent, or 0
  nanoseconds pdo_at_{};
  nanoseconds heartbeat_at_{};
  nanoseconds emergency_at_{};
  bool synced_{false};
  std::deque<CanFrame> frames_;
};

}  // namespace thermocomp
