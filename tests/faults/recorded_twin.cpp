#include "recorded_twin.hpp"

#include <array>
#include <limits>

#include "daemon/history/format/segments.hpp"

namespace thermocomp::faults {
namespace {

constexpr std::size_t cycles_a_chunk = 128;
/// Several cycles, so that per-cycle records need no special case at an end.
constexpr std::chrono::seconds offsets_period{5};

bool same_command(const OffsetCommand& a, const OffsetCommand& b) {
  if (a.link_epoch != b.link_epoch) return false;
  for (std::size_t axis = 0; axis < axes_max; ++axis)
    if (!same_bits(a.offset_um[axis], b.offset_um[axis]) || a.valid[axis] != b.valid[axis])
      return false;
  return true;
}

}  // namespace

std::unique_ptr<CycleRecorder> RecordedTwin::make_recorder(const Estimator& estimator) {
  auto recording = std::make_shared<RecordingSession>();
  recording->id = next_session_++;
  sessions_[recording->id] = {recording, estimator.config(), estimator.model()};
  return std::make_unique<CycleRecorder>(ring_, recording, grid_, offsets_period, estimator);
}

std::optional<std::uint64_t> RecordedTwin::stepped(std::uint64_t cycle,
                                                   const OffsetCommand& command) {
  expected_.push_back({cycle, command});
  return expected_.size() >= cycles_a_chunk ? drain() : std::nullopt;
}

std::optional<std::uint64_t> RecordedTwin::finish() {
  const auto different = drain();
  return different ? different : out_of_order_;
}

std::optional<std::uint64_t> RecordedTwin::drain() {
  std::array<Record, 512> batch{};
  while (const std::size_t count = ring_.pop(batch)) {
    for (std::size_t i = 0; i < count; ++i) {
      if (batch[i].kind == RecordKind::cycle_done) continue;  // nor does the writer keep it
      if (batch[i].kind != RecordKind::segment_begin) {
        if (!order_.admits(batch[i]) && !out_of_order_) out_of_order_ = batch[i].cycle;
        encoder_.add(batch[i]);
        continue;
      }
      if (const auto different = replay(batch[i].cycle)) return different;
      begin(batch[i]);
    }
  }
  return replay(std::numeric_limits<std::uint64_t>::max());
}

void RecordedTwin::begin(const Record& record) {
  const Session& session = sessions_.at(record.session);
  Snapshot& snapshot = session.recording->snapshots[record.index];
  twin_ = std::make_unique<Estimator>(session.config, session.model);
  twin_->load_state(snapshot.estimator_state);
  decode_inputs(encode_inputs(snapshot.readings, snapshot.controller), inputs_.readings,
                inputs_.controller);
  snapshot.taken.store(false);
  order_ = RecordOrder(record.cycle);
}

/// Replays the cycles expected before `before` from the records encoded so far.
std::optional<std::uint64_t> RecordedTwin::replay(std::uint64_t before) {
  const std::uint64_t count = encoder_.count();
  ChunkDecoder decoder(encoder_.take(), count);
  Record record;
  bool has_record = decoder.next(record);
  std::size_t done = 0;
  OffsetCommand command;
  for (; done < expected_.size() && expected_[done].cycle < before; ++done) {
    const std::uint64_t cycle = expected_[done].cycle;
    if (!twin_) return cycle;
    for (; has_record && record.cycle <= cycle; has_record = decoder.next(record)) {
      if (record.kind == RecordKind::command)
        twin_->apply({static_cast<CommandKind>(record.detail), record.index, record.value});
      else if (record.kind == RecordKind::reading || record.kind == RecordKind::link ||
               record.kind == RecordKind::applied || record.kind == RecordKind::signal)
        inputs_.apply(record);
    }
    twin_->step(grid_.time_of(cycle), inputs_.readings, inputs_.controller, command);
    ++replayed_;
    if (!same_command(command, expected_[done].command)) return cycle;
  }
  expected_.erase(expected_.begin(), expected_.begin() + static_cast<std::ptrdiff_t>(done));
  return std::nullopt;
}

}  // namespace thermocomp::faults
