/// Link to a machine controller that takes offsets and reports the applied ones, and the rule when
/// offsets may be sent.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "estimator/types.hpp"

namespace thermocomp {

/// Result of the writes to a controller.
struct WriteHealth {
  std::uint64_t refused{0};     ///< answered with an exception
  std::uint64_t unanswered{0};  ///< not answered, or (CAN) not sent by the interface
  std::uint64_t late{0};        ///< exchanges (reads and writes) longer than the link's period
  nanoseconds confirmed_at{};   ///< CLOCK_MONOTONIC of the newest confirmed write; 0: none
  std::string error;            ///< of the newest write; empty: it succeeded
  // Modbus, of the newest write if it failed; else 0
  int function{0};
  int address{0};
  int exception{0};
};

struct ControllerHealth {
  std::string name;
  std::string kind;  ///< "modbus_tcp", "modbus_rtu", "can", "linuxcnc", "dry_run"
  bool connected{false};
  std::uint64_t connects{0};
  std::uint64_t writes{0};  ///< offsets sent
  std::uint64_t write_errors{0};
  std::uint64_t reads{0};
  std::uint64_t read_errors{0};
  nanoseconds report_aged{};  ///< Modbus: age of the previous report when a new one arrives
  WriteHealth write;
  std::string last_error;  ///< empty if the last exchange and the last write were good
  /// CAN: "down", "active", "warning", "passive" or "bus_off"; else empty
  std::string state;
  nanoseconds state_since{};  ///< CLOCK_MONOTONIC of the change to `state`
  std::uint64_t bus_offs{0};  ///< CAN: number of times the interface left the bus
  /// Dry run with a controller that is read: offsets really applied [um]; NaN: unknown.
  std::optional<std::array<double, axes_max>> shown_um{};
};

/// Rule of the link: after every (re)connection and every failed write it reads back the applied
/// offsets, publishes them with a new epoch, and sends only offsets of that epoch. So the first
/// offset sent starts from the applied one.
class ControllerLink {
 public:
  ControllerLink() = default;
  ControllerLink(const ControllerLink&) = delete;
  ControllerLink& operator=(const ControllerLink&) = delete;
  virtual ~ControllerLink() = default;

  virtual void start() = 0;                                       ///< @throws DriverError
  virtual void stop() noexcept = 0;                               ///< within a second
  virtual void newest(ControllerState& state) noexcept = 0;       ///< wait-free; one reader
  virtual void offer(const OffsetCommand& command) noexcept = 0;  ///< wait-free; one writer
  [[nodiscard]] virtual ControllerHealth health() const = 0;
};

enum class SendVerdict {
  send,
  /// No command of this epoch, the cycle has stopped, or a read-back is missing: not even a
  /// heartbeat is sent.
  nothing_to_send,
  resynchronise  ///< write overdue, or axis moved since the command was computed: read back first
};

/// A command for the link's thread, with the time of its computation.
struct OfferedCommand {
  OffsetCommand command;
  nanoseconds computed_at{};
};

/// Decides when a link may send offsets: the rule of ControllerLink without I/O or clock.
class WriteGate {
 public:
  /// Maximum age of a command. An older one comes from a hung cycle, and the controller's watchdog
  /// must trip. The slowest cycle computes one per second.
  static constexpr nanoseconds renewal_max = std::chrono::seconds{2};

  /// Largest unexplained distance of an axis from all offsets sent lately, besides two steps of its
  /// register [um].
  static constexpr double unexplained_um = 1.0;

  /// Looks for the first command of an epoch: number per period, and total.
  static constexpr int first_looks = 4;

  /// @param period         of the link's writes
  /// @param resolution_um  one per axis: step of the read-back [um]; missing: 0
  explicit WriteGate(nanoseconds period, const std::vector<double>& resolution_um = {}) noexcept;

  /// Call when everything has been read back: commands of the new epoch may now be sent. The epoch
  /// begins a new link if lost() was called since the last one, else it ends a pause.
  /// @param applied_um  read back [um]; a change before the first command is written is unexplained
  /// @return the new epoch, never 0
  std::uint32_t synchronised(const std::array<double, axes_max>& applied_um) noexcept;
  std::uint32_t synchronised() noexcept;  ///< without read-back
  /// The link is lost: nothing is sent until synchronised(), and the controller may have restarted.
  void lost() noexcept {
    in_sync_ = false;
    link_is_new_ = true;
    confirmed_at_.reset();
  }
  /// Pauses the link: nothing may be sent until synchronised(), but offsets sent still count.
  void paused() noexcept { in_sync_ = false; }
  [[nodiscard]] bool in_sync() const noexcept { return in_sync_; }
  /// True if synchronised() will begin another link.
  [[nodiscard]] bool link_is_new() const noexcept { return link_is_new_; }
  /// The newest epoch; 0: never synchronised.
  [[nodiscard]] std::uint32_t epoch() const noexcept { return epoch_; }
  /// Number of the last read-back: counts synchronised() and check_read_back().
  [[nodiscard]] std::uint64_t read_back_number() const noexcept { return read_back_number_; }

  /// Takes the command that the cycle offers, possibly the same again.
  void offered(const OffsetCommand& command, nanoseconds computed_at) noexcept;
  [[nodiscard]] const OffsetCommand& command() const noexcept { return command_; }

  [[nodiscard]] SendVerdict verdict(nanoseconds now) const noexcept;
  /// Call when the command was sent in full.
  void sent(nanoseconds now) noexcept;
  /// Call when the command has reached the controller.
  void confirmed(nanoseconds now) noexcept { confirmed_at_ = now; }
  void unconfirmed() noexcept { confirmed_at_.reset(); }
  /// True if a write was confirmed on this link within patience().
  [[nodiscard]] bool written(nanoseconds now) const noexcept {
    return confirmed_at_ && now - *confirmed_at_ <= patience();
  }
  /// Notes the duration of the link's last exchange, so that patience() fits a slow controller.
  void note_exchange_time(nanoseconds took) noexcept { turn_ = took; }
  /// Longest time between two writes: five periods, a second, or twice the last
  /// note_exchange_time().
  [[nodiscard]] nanoseconds patience() const noexcept { return std::max(patience_min_, 2 * turn_); }

  /// Pause before the link's next exchange; call once per exchange. A period, but at first a
  /// quarter of it while nothing has been sent in the epoch: the cycle moves away from the applied
  /// offset as soon as it sees the epoch, and the first step should be small.
  [[nodiscard]] nanoseconds next_pause() noexcept;

  /// @param applied_um  just read [um]; NaN: unknown. An axis without read-back that had one may
  /// have moved: nothing is sent while such an axis is driven.
  /// @return false if no offset sent explains that of a driven axis (re-homed, overridden): an
  /// offset already computed would be a jump, so synchronised() must precede the next send
  [[nodiscard]] bool check_read_back(const std::array<double, axes_max>& applied_um) noexcept;

 private:
  [[nodiscard]] bool moved_since_command(std::size_t axis) const noexcept;

  nanoseconds period_;
  nanoseconds patience_min_;
  nanoseconds turn_{};
  bool in_sync_{false};
  bool link_is_new_{true};
  std::uint32_t epoch_{0};
  std::uint64_t read_back_number_{0};
  OffsetCommand command_{};
  nanoseconds computed_at_{};
  std::optional<nanoseconds> last_sent_;     ///< in this epoch
  std::optional<nanoseconds> confirmed_at_;  ///< on this link
  int looks_{0};                             ///< for the first command of this epoch

  /// Latest offsets of one axis in this epoch, a ring: a controller with a ramp or a delay may
  /// still approach any of them.
  struct SentLately {
    static constexpr std::size_t length = 16;
    std::array<double, length> offset_um{};
    std::size_t count{0};
  };
  std::array<SentLately, axes_max> sent_{};
  std::array<double, axes_max> applied_um_{};  ///< last read-back with a number
  std::array<bool, axes_max> unseen_{};        ///< was read back and is not now
  /// read_back_number() at which that of an axis last jumped.
  std::array<std::uint64_t, axes_max> unchanged_since_{};
  std::array<double, axes_max> slack_um_{};
};

}  // namespace thermocomp
