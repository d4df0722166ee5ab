/// The fixed-rate cycle: newest readings -> estimator -> offsets, on an absolute grid of time; with
/// the commands on their way to it and how long it takes.
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
#include "drivers/controllers/controller_link.hpp"
#include "drivers/sensors/sensor_source.hpp"
#include "drivers/wait_free_slot.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// How long something took, over millions of times: percentiles to 1.6 % without keeping samples.
/// One writer counts, any thread reads. Buckets: 64 per factor of two, from 1 ns to 18 minutes.
/// Wait-free, no allocation.
class DurationHistogram {
 public:
  /// Negative durations count as 0.
  void record(std::chrono::nanoseconds duration) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept;
  /// @param fraction  0..1, e.g. 0.999 for the 99.9th percentile
  /// @return upper edge of the bucket in which it lies; 0 while empty
  [[nodiscard]] std::chrono::nanoseconds percentile(double fraction) const noexcept;
  [[nodiscard]] std::chrono::nanoseconds max() const noexcept {
    return std::chrono::nanoseconds(max_ns_.load(std::memory_order_relaxed));
  }
  /// Starts anew; readers may see a mixture for a moment.
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

/// One producer, one consumer, wait-free. What has not been taken yet can be withdrawn: either the
/// consumer gets it or the producer has it back, never both.
class CommandQueue {
 public:
  static constexpr std::size_t capacity = 64;

  /// Producer. @return the command's number, counted from 0; none: 64 wait already
  std::optional<std::uint64_t> try_push(const Command& command) noexcept;
  /// Producer. @param number  of a command that was pushed and is not known to be done
  /// @return false: the consumer has it
  [[nodiscard]] bool withdraw(std::uint64_t number) noexcept;
  /// Consumer; leaves out what was withdrawn.
  [[nodiscard]] bool try_pop(Command& command) noexcept;
  /// Consumer: all before this number were taken or withdrawn.
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

/// What a configuration gives the cycle and a reload replaces as a whole.
struct CycleParts {
  explicit CycleParts(Estimator made)
      : estimator(std::move(made)), reports(estimator.make_report()) {}
  Estimator estimator;
  std::unique_ptr<Candidate> candidate;  ///< none: no model runs beside
  bool promotes{false};  ///< the model is that of the candidate that the cycle has until now
  std::unique_ptr<CycleRecorder> recorder;  ///< none: no history
  WaitFreeSlot<Report> reports;             ///< cycle -> main
};

/// Counters of the cycle; written by it, read by anyone.
struct CycleTiming {
  DurationHistogram lateness;  ///< woken up after the grid's time
  DurationHistogram work;      ///< from waking up to being done
  std::atomic<std::uint64_t> cycles{0};
  std::atomic<std::uint64_t> missed{0};
  std::atomic<std::uint64_t> failed_sleeps{0};  ///< the system refused to sleep until a time
};

/// On the thread that calls run(): no allocation, no lock, no log call, no exception and no system
/// call but the sleep and the clock.
class Cycle {
 public:
  /// @param sources, link, last_sent  outlive the cycle
  /// @param sensors    number of configured sensors
  /// @param last_sent  none: what is sent is not recorded
  Cycle(const Grid& grid, std::vector<SensorSource*> sources, ControllerLink& link,
        std::size_t sensors, std::unique_ptr<CycleParts> parts, LastSent* last_sent = nullptr);

  /// Until stop(); the first cycle is the grid's newest.
  void run() noexcept;
  /// What run() does by the system's clock, for callers with a time of their own: begin() once,
  /// then step() and next_after() in turn.
  /// @return the first cycle to step
  [[nodiscard]] std::uint64_t begin(nanoseconds now) noexcept;
  void step(std::uint64_t cycle) noexcept;
  /// @param now  when the step of `cycle` was done
  /// @return the next cycle to step; those between are counted as missed
  [[nodiscard]] std::uint64_t next_after(std::uint64_t cycle, nanoseconds now) noexcept;
  void stop() noexcept { stop_.store(true, std::memory_order_relaxed); }

  // Main's side, which daemon/cycle/cycle_handle.hpp makes safe to use.

  /// @return the command's number; none: 64 wait already
  std::optional<std::uint64_t> send(const Command& command) noexcept {
    return commands_.try_push(command);
  }
  /// @return whether the command with this number never reaches the cycle
  [[nodiscard]] bool withdraw(std::uint64_t number) noexcept { return commands_.withdraw(number); }
  /// All commands before this number were carried out (or withdrawn), and report() says what they
  /// did; when new parts were handed over in the same step, once these have been taken back.
  [[nodiscard]] std::uint64_t commands_done() const noexcept {
    return commands_done_.load(std::memory_order_acquire);
  }
  /// The cycle goes over to `next` at its next step. take_retired() then gives the parts it had
  /// until then. @pre the last one handed over has been taken back or withdrawn
  void hand_over(std::unique_ptr<CycleParts> next) noexcept;
  [[nodiscard]] std::unique_ptr<CycleParts> take_retired() noexcept;
  /// The parts that were handed over, which the cycle then never sees; none: it has them already.
  [[nodiscard]] std::unique_ptr<CycleParts> withdraw_parts() noexcept;
  /// The newest report of the parts in use, as of take_retired().
  [[nodiscard]] const Report& report() noexcept;
  /// Newest controller state seen by the cycle.
  [[nodiscard]] const ControllerState& controller() noexcept;

  [[nodiscard]] const CycleTiming& timing() const noexcept { return timing_; }
  /// Forgets lateness and work so far: starting up is not running.
  void clear_timing() noexcept;
  /// After run() has returned: records where it ended, with the offsets of the last step.
  /// @return the cycle of that step; none: there was none
  std::optional<std::uint64_t> finish_recording() noexcept;
  /// Main's side: the parts in use, as of take_retired().
  [[nodiscard]] CycleParts& parts() noexcept { return *observed_; }

 private:
  void take_over(std::uint64_t cycle) noexcept;
  void publish(bool at_once) noexcept;
  [[nodiscard]] std::uint64_t newest_due(nanoseconds now) const noexcept;

  Grid grid_;
  std::vector<SensorSource*> sources_;
  ControllerLink& link_;
  LastSent* last_sent_;
  std::unique_ptr<CycleParts> parts_;  ///< the cycle's
  CycleParts* retiring_{nullptr};      ///< the cycle's: to be given back after this step
  CycleParts* observed_;               ///< main's: whose reports it reads
  CycleParts* handed_over_{nullptr};   ///< main's: whose they will be
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
  std::uint64_t cycle_{0};     ///< stepped last
  std::uint64_t expected_{0};  ///< the one after; what lies before the next step was skipped
  bool has_stepped_{false};
  std::uint64_t report_every_;
  std::uint64_t next_report_{0};
};

}  // namespace thermocomp
