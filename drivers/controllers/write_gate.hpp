/// When a link may send offsets: the rule of controller_link.hpp as plain logic without I/O or
/// clock.
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
  nothing_to_send,  ///< no command of this epoch, or the cycle stands still: not even a heartbeat
  resynchronise     ///< too long since the last write, or the command was computed before the axis
                    ///< went elsewhere: what is applied must be read back first
};

/// A command and when the cycle computed it, as it is left for a link's thread.
struct OfferedCommand {
  OffsetCommand command;
  nanoseconds computed_at{};
};

class WriteGate {
 public:
  /// A command computed longer ago is a hung cycle's: the controller's watchdog shall see it. The
  /// slowest cycle computes one a second.
  static constexpr nanoseconds renewal_max = std::chrono::seconds{2};

  /// How far from all that was sent lately an axis may stand and still be explained, beside two
  /// steps of its register [um].
  static constexpr double unexplained_um = 1.0;

  /// Of a period: how soon the first command of an epoch is looked for, and how often.
  static constexpr int first_looks = 4;

  /// @param period         of the link's writes
  /// @param resolution_um  an axis' step of the read-back [um]; axes beyond it: 0
  explicit WriteGate(nanoseconds period, const std::vector<double>& resolution_um = {}) noexcept;

  /// Everything has been read back: from here on commands of the new epoch may be sent. The epoch
  /// is of another link where it was lost() since the last one, else a pause of the same.
  /// @param applied_um  what was read back with it [um]; a controller that has left it before the
  ///                    first command is written is not explained either
  /// @return the new epoch, never 0
  std::uint32_t synchronised(const std::array<double, axes_max>& applied_um) noexcept;
  std::uint32_t synchronised() noexcept;  ///< nothing was read back
  /// The link was lost: nothing may be sent until synchronised(), and the controller may have
  /// restarted meanwhile.
  void lost() noexcept {
    in_sync_ = false;
    link_is_new_ = true;
    confirmed_at_.reset();
  }
  /// The same of a link that is still the same one: what was sent still counts.
  void paused() noexcept { in_sync_ = false; }
  [[nodiscard]] bool in_sync() const noexcept { return in_sync_; }
  /// Whether synchronised() will begin another link.
  [[nodiscard]] bool link_is_new() const noexcept { return link_is_new_; }
  /// The newest epoch; 0: never synchronised.
  [[nodiscard]] std::uint32_t epoch() const noexcept { return epoch_; }
  /// Counts synchronised() and explains(): the number of what was read back last.
  [[nodiscard]] std::uint64_t look() const noexcept { return look_; }

  /// The cycle has left a command (again), computed at that time.
  void offered(const OffsetCommand& command, nanoseconds computed_at) noexcept;
  [[nodiscard]] const OffsetCommand& command() const noexcept { return command_; }

  [[nodiscard]] SendVerdict verdict(nanoseconds now) const noexcept;
  /// The command was sent in full.
  void sent(nanoseconds now) noexcept;
  /// What was sent is known to have reached the controller.
  void confirmed(nanoseconds now) noexcept { confirmed_at_ = now; }
  /// Whether something was confirmed lately: on this link, within its patience().
  [[nodiscard]] bool written(nanoseconds now) const noexcept {
    return confirmed_at_ && now - *confirmed_at_ <= patience();
  }
  /// How long the link's newest turn took, reads and writes: a slow controller is waited for.
  void turned(nanoseconds took) noexcept { turn_ = took; }
  /// So long a link may go without a write: five periods, a second, or two turns of a controller
  /// that takes longer than that.
  [[nodiscard]] nanoseconds patience() const noexcept { return std::max(patience_min_, 2 * turn_); }

  /// How long to wait until the link's next turn; asked once a turn. A period, but a quarter of it
  /// in the first turns of an epoch in which nothing has been sent: the cycle has been moving away
  /// from what is applied since it saw the epoch, and the first step shall be a small one.
  [[nodiscard]] nanoseconds next_pause() noexcept;

  /// What the controller applies, just read [um], NaN: not known.
  /// @return false: a driven axis stands where nothing that was sent can have taken it (re-homed,
  ///         overridden). What is still under way would be a leap from there: synchronised() must
  ///         come before anything is sent.
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

  /// Offsets of one axis in this epoch, newest in a ring: a controller with a ramp or a delay of
  /// its own may be on its way to any of them.
  struct SentLately {
    static constexpr std::size_t length = 16;
    std::array<double, length> offset_um{};
    std::size_t count{0};
  };
  std::array<SentLately, axes_max> sent_{};
  std::array<double, axes_max> applied_um_{};  ///< as read last
  /// The look that showed an axis far from where the one before did.
  std::array<std::uint64_t, axes_max> stands_since_{};
  std::array<double, axes_max> slack_um_{};
};

}  // namespace thermocomp
