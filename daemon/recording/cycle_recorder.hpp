/// The real-time side of the history: records only changes since the last cycle.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "daemon/recording/record.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Start point of a replay: the estimator's exact state and the last inputs.
/// Hand-over: the cycle fills it while `taken` is false, sets `taken` and sends a `segment_begin`;
/// the writer copies it and clears `taken`.
struct Snapshot {
  std::vector<std::byte> estimator_state;
  std::vector<Reading> readings;
  ControllerState controller;
  std::atomic<bool> taken{false};
};

/// State that a configuration's recorder shares with the writer.
struct RecordingSession {
  std::uint16_t id{0};
  std::array<Snapshot, 2> snapshots;
  /// Set by the writer to request a snapshot at the next cycle: 0, or SegmentReason + 1.
  std::atomic<std::uint8_t> requested{0};
};

/// One per configuration: made on an ordinary thread (HistoryWriter::make_recorder), then used by
/// the cycle alone. After construction it does not wait, allocate, throw or make system calls.
///
/// Order of calls: begin() once before the first cycle (or, after a reload, by the cycle itself
/// between two steps, after Estimator::adopt()); then for each cycle: skipped() if cycles before it
/// were left out, command()*, step, record(); finish() once after the last cycle.
class CycleRecorder {
 public:
  /// @param grid            the daemon's grid
  /// @param offsets_period  period of recording the offsets
  CycleRecorder(RecordRing& ring, std::shared_ptr<RecordingSession> session, const Grid& grid,
                nanoseconds offsets_period, const Estimator& estimator);

  /// Begins a segment with the estimator's state before the step of `first_cycle`.
  /// @param previous  the recorder in use until now; null at the start of the daemon
  void begin(std::uint64_t first_cycle, const Estimator& estimator, SegmentReason reason,
             const CycleRecorder* previous = nullptr) noexcept;
  /// Records a command given to Estimator::apply() before the step of `cycle`.
  void command(std::uint64_t cycle, const Command& command) noexcept;
  /// Cycles `from`..`to` (both included) were not stepped.
  void skipped(std::uint64_t from, std::uint64_t to) noexcept;
  /// Call after the step of `cycle`, with its inputs and offsets.
  void record(std::uint64_t cycle, std::span<const Reading> readings,
              const ControllerState& controller, const OffsetCommand& command,
              const Estimator& estimator) noexcept;
  /// Call after the last cycle has ended; any thread.
  void finish(std::uint64_t last_cycle, const OffsetCommand& command) noexcept;

 private:
  void push(const Record& record) noexcept;
  void push_readings(std::uint64_t cycle, std::span<const Reading> readings) noexcept;
  void push_controller(std::uint64_t cycle, const ControllerState& controller) noexcept;
  void push_values(std::uint64_t cycle, RecordKind kind, std::span<const double> now,
                   std::span<double> last) noexcept;
  void push_offsets(std::uint64_t cycle, const OffsetCommand& command) noexcept;
  void push_done(std::uint64_t cycle) noexcept;
  void lose() noexcept;
  bool snapshot(std::uint64_t first_cycle, const Estimator& estimator,
                SegmentReason reason) noexcept;

  RecordRing& ring_;
  std::shared_ptr<RecordingSession> session_;
  std::uint64_t offsets_every_;  ///< cycles
  std::uint64_t done_every_;     ///< cycles
  std::uint32_t axes_;
  std::vector<Reading> readings_;  ///< as last recorded
  ControllerState controller_;     ///< as last recorded
  std::uint64_t next_offsets_{0};
  std::int64_t noted_cycle_{-1};  ///< last cycle with recorded offsets
  std::uint64_t next_done_{0};
  std::int64_t last_whole_cycle_{-1};
  bool broken_{true};  ///< nothing is recorded until a snapshot succeeds
  SegmentReason broken_reason_{SegmentReason::start};
};

}  // namespace thermocomp
