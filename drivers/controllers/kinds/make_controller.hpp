/// From a controller's configuration to its link, and the link that writes nothing.
#pragma once

#include <atomic>
#include <memory>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/wait_free_slot.hpp"

namespace thermocomp {

/// With a link: all that it reads (online, epoch, times, signals) is passed on, and it is never
/// offered a command, without which no link writes. The axes are shown as a controller would that
/// starts at 0 um and applies by its next read-back what it was offered; what the controller really
/// applies is in the health (`shown_um`).
///
/// Without one: the same for a controller that is none, online from start() to stop(), always of
/// epoch 1, without signals. No thread of its own. An axis that is not valid keeps what it had.
class DryRunController final : public ControllerLink {
 public:
  /// @param read  the controller's own link; nullptr: there is no controller
  /// @throws InvalidValue for more axes than axes_max
  explicit DryRunController(DryRunControllerConfig config,
                            std::unique_ptr<ControllerLink> read = nullptr);

  void start() override;
  void stop() noexcept override;
  void newest(ControllerState& state) noexcept override;
  void offer(const OffsetCommand& command) noexcept override;
  [[nodiscard]] ControllerHealth health() const override;

  /// nullptr: there is no controller. For what else calls it, such as a bridge; offer it nothing.
  [[nodiscard]] ControllerLink* read() const noexcept { return read_.get(); }

 private:
  void read_state(ControllerState& state) noexcept;
  void apply_offered(std::uint32_t link_epoch) noexcept;

  const DryRunControllerConfig config_;
  const std::unique_ptr<ControllerLink> read_;
  std::atomic<bool> started_{false};
  // the reader's
  std::array<double, axes_max> applied_um_{};
  nanoseconds read_at_{};  ///< the newest read-back that was seen
  WaitFreeSlot<OffsetCommand> commands_;
  mutable WaitFreeSlot<std::array<double, axes_max>> shown_um_;  ///< health() reads it
};

/// @param dry_run  nothing is to be written: the link is a DryRunController around it
/// @throws InvalidValue or DriverError for a configuration that cannot work
[[nodiscard]] std::unique_ptr<ControllerLink> make_controller(const ControllerConfig& config,
                                                              bool dry_run = false);

}  // namespace thermocomp
