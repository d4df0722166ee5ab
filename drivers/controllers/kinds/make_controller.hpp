/// Factory of controller links, and the link that writes nothing.
#pragma once

#include <atomic>
#include <memory>

#include "drivers/bus.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"

namespace thermocomp {

/// With a link: its state (online, epoch, times, signals) is passed on, and it is never offered a
/// command, without which no link writes. The axes appear as those of a controller that starts at 0
/// um and applies an offered offset by its next read-back; the offsets really applied are in the
/// health (`shown_um`).
///
/// Without a link: the same, online from start() to stop(), always with epoch 1 and without
/// signals. Has no thread. An axis that is not valid keeps its offset.
class DryRunController final : public ControllerLink {
 public:
  /// @param read  link to the controller; nullptr: there is none
  /// @throws InvalidValue for more axes than axes_max
  explicit DryRunController(DryRunControllerConfig config,
                            std::unique_ptr<ControllerLink> read = nullptr);

  void start() override;
  void stop() noexcept override;
  void newest(ControllerState& state) noexcept override;
  void offer(const OffsetCommand& command) noexcept override;
  [[nodiscard]] ControllerHealth health() const override;

  /// Link that is only read, for other callers such as a bridge; do not offer it commands. nullptr:
  /// no controller.
  [[nodiscard]] ControllerLink* read() const noexcept { return read_.get(); }

 private:
  void read_state(ControllerState& state) noexcept;
  void apply_offered(std::uint32_t link_epoch) noexcept;

  const DryRunControllerConfig config_;
  const std::unique_ptr<ControllerLink> read_;
  std::atomic<bool> started_{false};
  // of the reader
  std::array<double, axes_max> applied_um_{};
  nanoseconds read_at_{};  ///< time of the newest read-back
  WaitFreeSlot<OffsetCommand> commands_;
  mutable WaitFreeSlot<std::array<double, axes_max>> shown_um_;  ///< read by health()
};

/// @param dry_run  nothing may be written: the link is wrapped in a DryRunController
/// @throws InvalidValue or DriverError for a configuration that cannot work
[[nodiscard]] std::unique_ptr<ControllerLink> make_controller(const ControllerConfig& config,
                                                              bool dry_run = false);

}  // namespace thermocomp
