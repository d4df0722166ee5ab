/// A second estimator fed with the recorder's output through the chunk codec: its offsets must
/// equal those of the first in every cycle, bit for bit.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/history/format/chunk_codec.hpp"
#include "daemon/history/format/segments.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "daemon/recording/cycle_recorder.hpp"
#include "daemon/recording/record.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp::faults {

class RecordedTwin {
 public:
  explicit RecordedTwin(const Grid& grid) : grid_(grid) {}

  /// A recorder for an estimator about to be used.
  [[nodiscard]] std::unique_ptr<CycleRecorder> make_recorder(const Estimator& estimator);
  /// Called after each cycle with the first estimator's command.
  /// @return the first cycle that differs, if any
  std::optional<std::uint64_t> stepped(std::uint64_t cycle, const OffsetCommand& command);
  /// Replays the rest and checks the order of the records.
  /// @return the first cycle that differs or of the first record out of order, if any
  std::optional<std::uint64_t> finish();
  [[nodiscard]] std::uint64_t replayed() const noexcept { return replayed_; }

 private:
  struct Expected {
    std::uint64_t cycle{0};
    OffsetCommand command;
  };
  struct Session {
    std::shared_ptr<RecordingSession> recording;
    EstimatorConfig config;
    ThermalModel model;
  };
  std::optional<std::uint64_t> drain();
  std::optional<std::uint64_t> replay(std::uint64_t before);
  void begin(const Record& record);

  Grid grid_;
  RecordRing ring_{8192};
  std::map<std::uint16_t, Session> sessions_;
  std::uint16_t next_session_{1};
  ChunkEncoder encoder_;
  std::vector<Expected> expected_;
  std::unique_ptr<Estimator> twin_;
  InputsInForce inputs_;
  RecordOrder order_;
  std::optional<std::uint64_t> out_of_order_;  ///< cycle of the first such record
  std::uint64_t replayed_{0};
};

}  // namespace thermocomp::faults
