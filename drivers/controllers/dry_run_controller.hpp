/// A controller that is none: it applies at once what it is offered, and shows it.
#pragma once

#include <atomic>
#include <cstdint>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/wait_free_slot.hpp"

namespace thermocomp {

/// Online from start() to stop(), always of epoch 1; its axes start at 0 um. An invalid axis keeps
/// what it had. It reports no signals. No thread.
class DryRunController final : public ControllerLink {
 public:
  /// @throws InvalidValue for more axes than axes_max
  explicit DryRunController(DryRunControllerConfig config);

  void start() override { started_.store(true); }
  void stop() noexcept override { started_.store(false); }
  void newest(ControllerState& state) noexcept override;
  void offer(const OffsetCommand& command) noexcept override;
  [[nodiscard]] ControllerHealth health() const override;

 private:
  const DryRunControllerConfig config_;
  std::atomic<bool> started_{false};
  std::atomic<std::uint64_t> writes_{0};
  ControllerState applied_;  ///< the reader's
  WaitFreeSlot<OffsetCommand> commands_;
};

}  // namespace thermocomp
