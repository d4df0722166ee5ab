/// The estimator of a segment, stepped again through what was recorded. Only for the .cpp files of
/// this folder.
#pragma once

#include <cstdint>

#include "daemon/history/replay/replay_setup.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

/// Stands before the step of a cycle; step() takes that step and moves on, passing skipped cycles.
class SegmentSteps {
 public:
  /// @throws HistoryError, std::runtime_error when the state at its start cannot be loaded
  SegmentSteps(const HistoryReader& reader, const SegmentInfo& segment, const ReplaySetup& setup);

  /// @return false after the last cycle that is recorded whole. @throws HistoryError
  [[nodiscard]] bool step();
  /// Of the last step: its cycle, and what came out of it.
  [[nodiscard]] bool has_stepped() const noexcept { return stepped_; }
  [[nodiscard]] std::uint64_t cycle() const noexcept { return cycle_; }
  [[nodiscard]] const OffsetCommand& command() const noexcept { return command_; }
  [[nodiscard]] const Estimator& estimator() const noexcept { return estimator_; }

  /// The next offset that the daemon noted at that cycle. @return none: no more. @throws
  /// HistoryError
  [[nodiscard]] const Record* noted_offset() const noexcept {
    const bool is_one =
        stepped_ && has_record_ && record_.cycle == cycle_ && record_.kind == RecordKind::offset;
    return is_one ? &record_ : nullptr;
  }
  void next() { has_record_ = cursor_.next(record_); }
  /// The segment has grown.
  void extend(std::int64_t last_cycle) {
    segment_.last_cycle = last_cycle;
    cursor_.extend(last_cycle);
    if (!has_record_) next();
  }

 private:
  [[nodiscard]] std::uint64_t take_inputs(std::uint64_t cycle);

  SegmentInfo segment_;
  Estimator estimator_;
  RecordCursor cursor_;
  InputsInForce inputs_;
  OffsetCommand command_;
  std::uint64_t next_cycle_;
  std::uint64_t cycle_{0};
  bool stepped_{false};
  Record record_;
  bool has_record_{false};
};

}  // namespace thermocomp
