/// What the recorder hands over, through the chunk codec and back, into a second estimator: it must
/// give the first one's offsets to the last bit in every cycle.
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

  /// A recorder for an estimator that is about to be used.
  [[nodiscard]] std::unique_ptr<CycleRecorder> make_recorder(const Estimator& estimator);
  /// After each cycle: what the first estimator sent.
  /// @return the cycle that came out different, if one did
  std::optional<std::uint64_t> stepped(std::uint64_t cycle, const OffsetCommand& command);
  /// What is left, and whether what was recorded has the order of a history.
  /// @return the cycle that came out different or of the record out of order, if there is one
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
  std::optional<std::uint64_t> out_of_order_;  ///< cycle of the first record that is
  std::uint64_t replayed_{0};
};

}  // namespace thermocomp::faults
