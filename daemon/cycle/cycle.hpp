/// The fixed-rate cycle on an absolute time grid (newest readings -> estimator -> offsets), its
/// command queue and its timing.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "daemon/cycle/candidate.hpp"
#include "daemon/recording/cycle_recorder.hpp"
#include "daemon/recording/last_sent.hpp"
#include "daemon/recording/record.hpp"
#include "drivers/bus.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Histogram with 64 buckets per factor of two, 1 ns to 18 minutes: percentiles within 1.6 %.
/// One writer, any number of readers. Wait-free, no allocation.
class DurationHistogram {
 public:
  /// Negative durations are recorded as 0.
  void record(std::chrono::nanoseconds duration) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept;
  /// @param fraction  0..1, e.g. 0.999 for the 99.9th percentile
  /// @return upper edge of that percentile's bucket; 0 while empty
  [[nodiscard]] std::chrono::nanoseconds percentile(double fraction) const noexcept;
  [[nodiscard]] std::chrono::nanoseconds max() const noexcept {
    return std::chrono::nanoseconds(max_ns_.load(std::memory_order_relaxed));
  }
  /// Resets the counts; a concurrent reader may see mixed values.
  void clear() noexcept;

 private:
  static constexpr unsigned sub_bits = 6;
  static constexpr std::size_t subs = std::size_t{1} << sub_bits;
  static constexpr std::size_t octaves = 35;

  [[nodiscard]] static std::size_t bucket_of(std::uint64_t ns) noexcept;
  [[nodiscard]] static std::uint64_t upper_edge_ns(std::size_t bucket) noexcept;

  std::array<std::atomic<std::uint32_t>, subs * octaves> buckets_{};
  std::atomic<std::int64_t> max_ns_{0};
};

/// Single producer, single consumer, wait-free. Commands can be withdrawn until they are taken.
class CommandQueue {
 public:
  static constexpr std::size_t capacity = 64;

  /// Producer. @return the command's number, counted from 0; none if the queue is full
  std::optional<std::uint64_t> try_push(const Command& command) noexcept;
  /// Producer. @param number  of a command that is not known to be done
  /// @return false if the consumer has taken it
  [[nodiscard]] bool withdraw(std::uint64_t number) noexcept;
  /// Consumer; skips withdrawn commands.
  [[nodiscard]] bool try_pop(Command& command) noexcept;
  /// Consumer: all commands before this number were taken or withdrawn.
  [[nodiscard]] std::uint64_t taken() const noexcept {
    return tail_.load(std::memory_order_relaxed);
  }

 private:
  enum class State : std::uint8_t { waiting, taken, withdrawn };
  struct Place {
    Command command;
    std::atomic<State> state{State::taken};
  };

  std::array<Place, capacity> places_{};
  std::atomic<std::uint64_t> head_{0};
  std::atomic<std::uint64_t> tail_{0};
};

/// The configuration-dependent part of the cycle; a reload replaces it as a whole.
struct CycleParts {
  explicit CycleParts(Estimator made)
      : estimator(std::move(made)), reports(estimator.make_report()) {}
  Estimator estimator;
  std::unique_ptr<Candidate> candidate;     ///< none: no candidate model runs
  bool promotes{false};                     ///< the model is that of the previous parts' candidate
  std::unique_ptr<CycleRecorder> recorder;  ///< none: no history
  WaitFreeSlot<Report> reports;             ///< cycle -> main
};

/// Counters; written by the cycle, read by any thread.
struct CycleTiming {
  DurationHistogram lateness;  ///< wake-up after the grid time
  DurationHistogram work;      ///< from wake-up to the end of the step
  std::atomic<std::uint64_t> cycles{0};
  std::atomic<std::uint64_t> missed{0};
  std::atomic<std::uint64_t> failed_sleeps{0};  ///< clock_nanosleep() failed
};

/// run() does not allocate, lock, log or throw; its only system calls are the sleep and the clock.
class Cycle {
 public:
  /// @param sources, link, last_sent  outlive the cycle
  /// @param sensors    number of configured sensors
  /// @param last_sent  null: sent offsets are not recorded
  Cycle(const Grid& grid, std::vector<SensorSource*> sources, ControllerLink& link,
        std::size_t sensors, std::unique_ptr<CycleParts> parts, LastSent* last_sent = nullptr);

  /// Runs until stop(); begins with the newest cycle of the grid.
  void run() noexcept;
  /// Parts of run() for callers with their own clock: begin() once, then step() and next_after()
  /// alternately.
  /// @return the first cycle to step
  [[nodiscard]] std::uint64_t begin(nanoseconds now) noexcept;
  void step(std::uint64_t cycle) noexcept;
  /// @param now  when the step of `cycle` was done
  /// @return the next cycle to step; those between are counted as missed
  [[nodiscard]] std::uint64_t next_after(std::uint64_t cycle, nanoseconds now) noexcept;
  void stop() noexcept { stop_.store(true, std::memory_order_relaxed); }

  // Called by main, through CycleHandle.

  /// @return the command's number; none if the queue is full
  std::optional<std::uint64_t> send(const Command& command) noexcept {
    return commands_.try_push(command);
  }
  /// @return false if the cycle has taken the command
  [[nodiscard]] bool withdraw(std::uint64_t number) noexcept { return commands_.withdraw(number); }
  /// All commands before this number were carried out or withdrawn, and report() includes their
  /// effect; if new parts were handed over in the same step, only after take_retired().
  [[nodiscard]] std::uint64_t commands_done() const noexcept {
    return commands_done_.load(std::memory_order_acquire);
  }
  /// The cycle uses `next` from its next step on; take_retired() then returns the previous parts.
  /// @pre the last parts handed over have been taken back or withdrawn
  void hand_over(std::unique_ptr<CycleParts> next) noexcept;
  [[nodiscard]] std::unique_ptr<CycleParts> take_retired() noexcept;
  /// Takes back the parts handed over; null if the cycle already has them.
  [[nodiscard]] std::unique_ptr<CycleParts> withdraw_parts() noexcept;
  /// The newest report of the parts in use, as of the last take_retired().
  [[nodiscard]] const Report& report() noexcept;
  [[nodiscard]] const ControllerState& controller() noexcept;

  [[nodiscard]] const CycleTiming& timing() const noexcept { return timing_; }
  /// Discards the timing of the start-up.
  void clear_timing() noexcept;
  /// Call after run() has returned. Records the offsets of the last step.
  /// @return the cycle of that step; none if there was no step
  std::optional<std::uint64_t> finish_recording() noexcept;
  /// The parts in use, as of the last take_retired().
  [[nodiscard]] CycleParts& parts() noexcept { return *observed_; }

 private:
  void take_over(std::uint64_t cycle) noexcept;
  void publish(bool at_once) noexcept;
  [[nodiscard]] std::uint64_t newest_due(nanoseconds now) const noexcept;

  Grid grid_;
  std::vector<SensorSource*> sources_;
  ControllerLink& link_;
  LastSent* last_sent_;
  std::unique_ptr<CycleParts> parts_;  ///< owned by the cycle
  CycleParts* retiring_{nullptr};      ///< owned by the cycle: returned after this step
  CycleParts* observed_;               ///< owned by main: the parts whose reports it reads
  CycleParts* handed_over_{nullptr};   ///< owned by main: the next observed_
  CommandQueue commands_;
  std::atomic<std::uint64_t> commands_done_{0};
  std::atomic<CycleParts*> incoming_{nullptr};
  std::atomic<CycleParts*> retired_{nullptr};
  std::atomic<bool> stop_{false};
  CycleTiming timing_;
  WaitFreeSlot<ControllerState> controller_slot_;

  std::vector<Reading> readings_;
  ControllerState controller_;
  OffsetCommand offsets_;
  std::uint64_t cycle_{0};     ///< of the last step
  std::uint64_t expected_{0};  ///< the next cycle; those from here to the next step were skipped
  bool has_stepped_{false};
  std::uint64_t report_every_;
  std::uint64_t next_report_{0};
};

}  // namespace thermocomp
