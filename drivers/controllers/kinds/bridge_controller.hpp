/// Link through a bridge: a program at the controller that calls the daemon, reports the
/// controller's state, and gets the offsets as the answer.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"

namespace thermocomp {

/// Report of a bridge; NaN: unknown.
struct BridgeReport {
  std::uint64_t session{0};  ///< chosen by the bridge, a new one after each of its (re)starts
  bool taking{false};        ///< the controller adds offsets to its positions (on, homed, ...)
  std::array<double, axes_max> applied_um{};
  std::array<double, signals_max> signals{};

  BridgeReport() noexcept {
    applied_um.fill(not_a_number);
    signals.fill(not_a_number);
  }
};

/// Answer to a report.
struct BridgeAnswer {
  std::uint32_t link_epoch{0};
  bool anew{false};  ///< this report begins a new link: offsets start from its values
  std::array<double, axes_max> offset_um{};
  std::array<bool, axes_max> valid{};  ///< false: the bridge keeps the offset of this axis
};

/// Each report is an exchange by the rule in controller_link.hpp: the applied offsets are read back
/// and published, and the answer carries the offsets to send. A new link begins with the first
/// report, with a report of another session, after a silence, and with the first report that takes
/// offsets again. A new epoch of the same link begins when no offset sent explains an axis' applied
/// one.
///
/// Offsets of an answer count as written when the next report of the same session arrives.
///
/// While the controller takes no offsets (off, not homed) it is online and its signals are valid,
/// but no applied offset is known: the axes are not synchronised, and the answer carries no offset.
///
/// Has no thread: newest() and health() detect silence.
class BridgeController final : public ControllerLink {
 public:
  using Now = nanoseconds (*)() noexcept;

  /// @throws InvalidValue for too many axes or signals, or silent_after_s <= 0
  explicit BridgeController(const BridgeControllerConfig& config, Now now = monotonic_now);

  void start() override { started_.store(true); }
  void stop() noexcept override { started_.store(false); }
  void newest(ControllerState& state) noexcept override;
  void offer(const OffsetCommand& command) noexcept override;
  [[nodiscard]] ControllerHealth health() const override;

  /// For one ordinary thread, always the same, after start().
  /// @return nullopt if another session has reported within silent_after_s (two bridges)
  [[nodiscard]] std::optional<BridgeAnswer> report(const BridgeReport& report);
  /// Counts an invalid report; the health shows the reason.
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
  // of the reporting thread
  WriteGate gate_;
  ControllerState state_;
  std::uint64_t session_{0};
  bool taking_{false};
  bool answered_{false};  ///< the answer had offsets: the next report confirms them
  mutable std::mutex health_mutex_;
  ControllerHealth health_;
  WaitFreeSlot<ControllerState> states_;
  WaitFreeSlot<OfferedCommand> commands_;
};

}  // namespace thermocomp
