#include "daemon/history/segment_walk.hpp"

#include <algorithm>
#include <cmath>

#include "config/number_text.hpp"
#include "daemon/history/chunk_codec.hpp"

namespace thermocomp {

void InputsInForce::apply(const Record& record) {
  const bool has_time = record.kind == RecordKind::reading || record.kind == RecordKind::link;
  if (has_time && !is_grid_time(record.time_ns)) throw HistoryError("damaged: an impossible time");
  const auto require_below = [&](std::size_t size) {
    if (record.index >= size) throw HistoryError("damaged: a record names what does not exist");
  };
  switch (record.kind) {
    case RecordKind::reading:
      require_below(readings.size());
      if (record.detail >= faults_count) throw HistoryError("damaged: unknown fault");
      readings[record.index] = {record.value, nanoseconds(record.time_ns),
                                static_cast<Fault>(record.detail)};
      break;
    case RecordKind::link:
      controller.taken_at = nanoseconds(record.time_ns);
      controller.link_epoch = record.index;
      controller.online = record.detail != 0;
      break;
    case RecordKind::applied:
      require_below(controller.applied_um.size());
      controller.applied_um[record.index] = record.value;
      break;
    case RecordKind::signal:
      require_below(controller.signals.size());
      controller.signals[record.index] = record.value;
      break;
    default:
      throw HistoryError("damaged: a record of this kind has no place here");
  }
}

HistoryClock::HistoryClock(const HistoryReader& reader) {
  try {
    place(reader.segments());
  } catch (const HistoryError& error) {
    throw HistoryError(reader.file().string() + ": " + error.what());
  }
}

void HistoryClock::place(const std::vector<SegmentInfo>& segments) {
  constexpr std::int64_t end_ns_max = std::int64_t{1} << 62;  // no sum of two overflows
  std::int64_t end_ns = 0;  // of the segments so far, in the history's time
  for (const SegmentInfo& segment : segments) {
    const std::int64_t begin_ns = segment.grid.time_of(segment.first_cycle).count();
    if (grid_to_history_ns_.count(segment.run) == 0) {
      const std::int64_t by_wall_ns = segment.wall_ns - segments.front().wall_ns;
      grid_to_history_ns_[segment.run] = std::max(by_wall_ns, end_ns) - begin_ns;
    }
    if (begin_ns + grid_to_history_ns_[segment.run] < end_ns) {
      throw HistoryError("damaged: segment " + std::to_string(segment.id) +
                         " begins before the one in front of it ends");
    }
    const auto next_cycle = static_cast<std::uint64_t>(segment.last_cycle + 1);
    end_ns = segment.grid.time_of(next_cycle).count() + grid_to_history_ns_[segment.run];
    if (end_ns > end_ns_max) throw HistoryError("damaged: the times of its segments cannot be");
  }
}

double HistoryClock::seconds_at(const SegmentInfo& segment, std::uint64_t cycle) const {
  const std::int64_t time_ns =
      segment.grid.time_of(cycle).count() + grid_to_history_ns_.at(segment.run);
  return static_cast<double>(time_ns) * 1e-9;
}

ParsedSetups::ParsedSetups(const HistoryReader& reader, const SetupParser& parser) {
  for (const SegmentInfo& segment : reader.segments()) {
    if (setups_.count(segment.setup) != 0) continue;
    setups_.emplace(segment.setup, parser(reader.setup(segment)));
  }
}

const ReplaySetup& ParsedSetups::of(const SegmentInfo& segment) const {
  return setups_.at(segment.setup);
}

std::size_t RunColumns::column(const std::string& name) {
  const auto [place, is_new] = indices_.emplace(name, names_.size());
  if (is_new) names_.push_back(name);
  return place->second;
}

void append_row(std::string& text, const std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) text += ',';
    if (!std::isnan(values[i])) append_number(text, values[i]);
  }
  text += '\n';
}

void append_header(std::string& text, const std::vector<std::string>& names) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += ',';
    text += names[i];
  }
  text += '\n';
}

}  // namespace thermocomp
