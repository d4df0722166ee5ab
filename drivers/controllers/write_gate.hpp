/// Decides when a link may send offsets: the rule of controller_link.hpp without I/O or clock.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "estimator/types.hpp"

namespace thermocomp {

enum class SendVerdict {
  send,
  nothing_to_send,  ///< no command of this epoch, or the cycle has stopped: not even a heartbeat
  resynchronise     ///< write overdue, or axis moved since the command was computed: read back
};

/// A command for the link's thread, with the time of its computation.
struct OfferedCommand {
  OffsetCommand command;
  nanoseconds computed_at{};
};

class WriteGate {
 public:
  /// An older command is that of a hung cycle, and the controller's watchdog must trip. The slowest
  /// cycle computes one per second.
  static constexpr nanoseconds renewal_max = std::chrono::seconds{2};

  /// Largest unexplained distance of an axis from all offsets sent lately, in addition to two steps
  /// of its register [um].
  static constexpr double unexplained_um = 1.0;

  /// Fraction of a period between looks for the first command of an epoch, and their number.
  static constexpr int first_looks = 4;

  /// @param period         of the link's writes
  /// @param resolution_um  one per axis: step of the read-back [um]; missing: 0
  explicit WriteGate(nanoseconds period, const std::vector<double>& resolution_um = {}) noexcept;

  /// Everything has been read back: from here on commands of the new epoch may be sent. The epoch
  /// begins another link if lost() was called since the last one, else it ends a pause.
  /// @param applied_um  read back [um]; leaving it before the first command is written is
  ///                    unexplained
  /// @return the new epoch, never 0
  std::uint32_t synchronised(const std::array<double, axes_max>& applied_um) noexcept;
  std::uint32_t synchronised() noexcept;  ///< without read-back
  /// The link is lost: nothing is sent until synchronised(), and the controller may have restarted.
  void lost() noexcept {
    in_sync_ = false;
    link_is_new_ = true;
    confirmed_at_.reset();
  }
  /// The link pauses: nothing may be sent until synchronised(), but offsets sent still count.
  void paused() noexcept { in_sync_ = false; }
  [[nodiscard]] bool in_sync() const noexcept { return in_sync_; }
  /// True if synchronised() will begin another link.
  [[nodiscard]] bool link_is_new() const noexcept { return link_is_new_; }
  /// The newest epoch; 0: never synchronised.
  [[nodiscard]] std::uint32_t epoch() const noexcept { return epoch_; }
  /// Number of the last read-back: counts synchronised() and explains().
  [[nodiscard]] std::uint64_t look() const noexcept { return look_; }

  /// The cycle has offered a command, possibly the same again.
  void offered(const OffsetCommand& command, nanoseconds computed_at) noexcept;
  [[nodiscard]] const OffsetCommand& command() const noexcept { return command_; }

  [[nodiscard]] SendVerdict verdict(nanoseconds now) const noexcept;
  /// The command was sent in full.
  void sent(nanoseconds now) noexcept;
  /// The command has reached the controller.
  void confirmed(nanoseconds now) noexcept { confirmed_at_ = now; }
  /// True if a write was confirmed on this link within patience().
  [[nodiscard]] bool written(nanoseconds now) const noexcept {
    return confirmed_at_ && now - *confirmed_at_ <= patience();
  }
  /// Duration of the link's last exchange, so that a slow controller is waited for.
  void turned(nanoseconds took) noexcept { turn_ = took; }
  /// Longest time between two writes: five periods, a second, or twice the last turned().
  [[nodiscard]] nanoseconds patience() const noexcept { return std::max(patience_min_, 2 * turn_); }

  /// Pause before the link's next exchange; called once per exchange. A period, but a quarter of it
  /// at first while nothing has been sent in the epoch: the cycle has been moving away from the
  /// applied offset since it saw the epoch, and the first step should be small.
  [[nodiscard]] nanoseconds next_pause() noexcept;

  /// @param applied_um  just read [um]; NaN: unknown
  /// @return false: no offset sent explains that of a driven axis (re-homed, overridden). An offset
  ///         under way would be a jump from there: synchronised() must come before the next send.
  [[nodiscard]] bool explains(const std::array<double, axes_max>& applied_um) noexcept;

 private:
  [[nodiscard]] bool starts_elsewhere(std::size_t axis) const noexcept;

  nanoseconds period_;
  nanoseconds patience_min_;
  nanoseconds turn_{};
  bool in_sync_{false};
  bool link_is_new_{true};
  std::uint32_t epoch_{0};
  std::uint64_t look_{0};
  OffsetCommand command_{};
  nanoseconds computed_at_{};
  std::optional<nanoseconds> last_sent_;     ///< in this epoch
  std::optional<nanoseconds> confirmed_at_;  ///< on this link
  int looks_{0};                             ///< for the first command of this epoch

  /// Latest offsets of one axis in this epoch, a ring: a controller with a ramp or a delay may be
  /// on its way to any of them.
  struct SentLately {
    static constexpr std::size_t length = 16;
    std::array<double, length> offset_um{};
    std::size_t count{0};
  };
  std::array<SentLately, axes_max> sent_{};
  std::array<double, axes_max> applied_um_{};  ///< last read-back
  /// look() at which the read-back of an axis last jumped.
  std::array<std::uint64_t, axes_max> unchanged_since_{};
  std::array<double, axes_max> slack_um_{};
};

}  // namespace thermocomp
