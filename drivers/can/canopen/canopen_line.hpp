/// One CANopen bus: its nodes, SYNC, our heartbeat. Pure.
#pragma once

#include <map>
#include <vector>

#include "drivers/can/can_protocol.hpp"
#include "drivers/can/canopen/canopen_node.hpp"

namespace thermocomp {

class CanopenLine final : public CanProtocol {
 public:
  /// @throws InvalidValue for impossible or repeated node numbers, and for impossible signals
  explicit CanopenLine(CanopenBusConfig config);

  [[nodiscard]] std::vector<CanFilter> wanted() const override;
  [[nodiscard]] std::vector<std::size_t> sensors() const override;
  void opened(nanoseconds now) override;
  void closed(nanoseconds now) override;
  void take(const CanFrame& frame) override;
  void advance(nanoseconds now) override;
  [[nodiscard]] std::optional<CanFrame> next_frame() override;
  [[nodiscard]] std::span<const Reading> readings() const override { return readings_; }
  [[nodiscard]] std::vector<RawReading> raw() const override;
  [[nodiscard]] std::vector<UnitHealth> health(nanoseconds now) const override;

 private:
  void send_cyclic(nanoseconds now);
  void look_for_conflicts(nanoseconds now);
  void collect();

  const CanopenBusConfig config_;
  std::vector<CanopenNode> nodes_;
  std::map<int, std::size_t> node_of_number_;
  std::vector<Reading> readings_;  ///< those of the nodes, one after the other
  bool open_{false};
  nanoseconds sync_at_{};
  nanoseconds heartbeat_at_{};
  std::deque<CanFrame> frames_;
};

}  // namespace thermocomp
