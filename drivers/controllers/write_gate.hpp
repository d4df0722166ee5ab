/// When a link may send offsets: the rule of controller_link.hpp as plain logic without I/O or
/// clock.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "estimator/types.hpp"

namespace thermocomp {

enum class SendVerdict {
  send,
  nothing_to_send,  ///< no command of this epoch, or the cycle stands still: not even a heartbeat
  resynchronise     ///< too long since the last write: what is applied must be read back first
};

class WriteGate {
 public:
  /// A command not renewed for longer is a hung cycle's: the controller's watchdog shall see it.
  static constexpr nanoseconds renewal_max = std::chrono::seconds{1};

  /// @param period  of the link's writes
  explicit WriteGate(nanoseconds period) noexcept;

  /// Everything has been read back: from here on commands of the new epoch may be sent.
  /// @return the new epoch, never 0
  std::uint32_t synchronised() noexcept;
  /// The link was lost or a write failed: nothing may be sent until synchronised().
  void lost() noexcept { in_sync_ = false; }
  [[nodiscard]] bool in_sync() const noexcept { return in_sync_; }
  /// The newest epoch; 0: never synchronised.
  [[nodiscard]] std::uint32_t epoch() const noexcept { return epoch_; }

  /// The cycle has left a command (again).
  void offered(const OffsetCommand& command, nanoseconds now) noexcept;
  [[nodiscard]] const OffsetCommand& command() const noexcept { return command_; }

  [[nodiscard]] SendVerdict verdict(nanoseconds now) const noexcept;
  /// The command was sent in full.
  void sent(nanoseconds now) noexcept { last_sent_ = now; }

 private:
  nanoseconds stall_max_;
  bool in_sync_{false};
  std::uint32_t epoch_{0};
  OffsetCommand command_{};
  nanoseconds offered_at_{};
  std::optional<nanoseconds> last_sent_;  ///< in this epoch
};

}  // namespace thermocomp
