/// Simulated J1939 node without I/O: address claim, single frames, broadcast packets.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "simulator/devices/field_nodes.hpp"

namespace thermocomp {

class J1939Sender final : public FieldNode {
 public:
  /// Powers the node up: claims its address.
  J1939Sender(const SimulatedJ1939Node& config, nanoseconds now);

  void take(const CanFrame& frame, nanoseconds now) override;
  void update(nanoseconds now, std::span<const double> temps_degC) override;
  [[nodiscard]] std::optional<CanFrame> next_frame() override;

 private:
  void claim();
  void send_group(std::uint32_t pgn, std::span<const std::uint8_t> bytes);
  void put(std::uint32_t pgn, std::span<const std::uint8_t> data);
  [[nodiscard]] bool is_now(const NodeEvent& event, nanoseconds now) const;
  [[nodiscard]] bool happens(NodeEventKind kind, nanoseconds now) const;
  [[nodiscard]] std::optional<std::uint64_t> code_of(std::size_t channel, nanoseconds now) const;

  const SimulatedJ1939Node config_;
  const nanoseconds switched_on_;
  nanoseconds groups_at_;
  std::map<std::uint32_t, std::vector<std::uint8_t>> groups_;
  std::deque<CanFrame> frames_;
};

}  // namespace thermocomp
