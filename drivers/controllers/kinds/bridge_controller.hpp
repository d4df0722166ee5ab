/// A controller behind a bridge: a program beside the controller that calls the daemon, tells what
/// the controller does, and is answered with the offsets.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "drivers/bus_thread.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/controllers/write_gate.hpp"
#include "drivers/wait_free_slot.hpp"

namespace thermocomp {

/// What a bridge tells. NaN where it knows nothing.
struct BridgeReport {
  std::uint64_t session{0};  ///< of the bridge's choice, another one after each (re)start of it
  bool taking{false};        ///< the controller adds offsets to its positions (on, homed, ...)
  std::array<double, axes_max> applied_um{};
  std::array<double, signals_max> signals{};

  BridgeReport() noexcept {
    applied_um.fill(not_a_number);
    signals.fill(not_a_number);
  }
};

/// What it is answered.
struct BridgeAnswer {
  std::uint32_t link_epoch{0};
  bool anew{false};  ///< the link is new with this report: offsets go on from what it says
  std::array<double, axes_max> offset_um{};
  std::array<bool, axes_max> valid{};  ///< false: the bridge leaves this axis' offset as it is
};

/// Each report is an exchange of the rule in controller_link.hpp: what is applied is read back and
/// published, and what may be sent is the answer. A new link begins with the first report, with one
/// of another session, after a silence, and with the first report that takes offsets again; a new
/// epoch of the same link when an axis stands where nothing that was sent can have taken it.
///
/// The offsets of an answer count as written with the next report of the same session.
///
/// While the controller takes no offsets (off, not homed) it is online, its signals count, and
/// nothing is known to be applied: the axes are not in step, and no offset is answered.
///
/// No thread of its own: silence is seen by whoever asks for the newest state.
class BridgeController final : public ControllerLink {
 public:
  using Now = nanoseconds (*)() noexcept;

  /// @throws InvalidValue for more axes or signals than there can be, or silent_after_s <= 0
  explicit BridgeController(const BridgeControllerConfig& config, Now now = monotonic_now);

  void start() override { started_.store(true); }
  void stop() noexcept override { started_.store(false); }
  void newest(ControllerState& state) noexcept override;
  void offer(const OffsetCommand& command) noexcept override;
  [[nodiscard]] ControllerHealth health() const override;

  /// One ordinary thread, always the same. Not before start().
  /// @return nothing when another session has reported within silent_after_s: two bridges
  [[nodiscard]] std::optional<BridgeAnswer> report(const BridgeReport& report);
  /// A report that cannot be understood came: counted, and stands in the health.
  void refuse(const std::string& why);

 private:
  [[nodiscard]] bool is_silent(nanoseconds now) const noexcept {
    return now - state_.taken_at > silent_after_;
  }
  void begin_epoch(const BridgeReport& report, BridgeAnswer& answer);
  void publish(const BridgeReport& report, bool taking, nanoseconds now);

  const BridgeControllerConfig config_;
  const nanoseconds silent_after_;
  const Now now_;
  std::atomic<bool> started_{false};
  // the reporting thread's
  WriteGate gate_;
  ControllerState state_;
  std::uint64_t session_{0};
  bool taking_{false};
  bool answered_{false};  ///< offsets: the next report tells that they were taken
  mutable std::mutex health_mutex_;
  ControllerHealth health_;
  WaitFreeSlot<ControllerState> states_;
  WaitFreeSlot<OfferedCommand> commands_;
};

}  // namespace thermocomp
