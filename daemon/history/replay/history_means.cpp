#include "daemon/history/replay/history_means.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/history/replay/segment_export.hpp"
#include "daemon/history/replay/segment_walk.hpp"

namespace thermocomp {
namespace {

/// The mean being accumulated.
struct OpenMean {
  std::int64_t at_s{0};
  HistoryPosition begin;
  std::vector<double> sum;
  std::vector<int> count;
  std::vector<RecordedProbing> probings;

  void add(const std::vector<double>& row) {
    sum.resize(row.size());
    count.resize(row.size());
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (std::isnan(row[i])) continue;
      sum[i] += row[i];
      ++count[i];
    }
  }
};

/// A segment being read.
struct Walk {
  Walk(std::shared_ptr<const HistoryReader> from, SegmentInfo segment)
      : reader(std::move(from)),
        info(std::move(segment)),
        texts(reader->setup(info)),
        setup(parse_setup(texts)),
        places(export_places(setup, ExportContent::inputs, nullptr, columns)),
        walk(*reader, info, setup, places, damage),
        row(columns.names().size()) {}

  [[nodiscard]] HistoryPosition at(std::uint64_t cycle) const {
    return {info.id, info.wall_ns, cycle};
  }

  std::shared_ptr<const HistoryReader> reader;
  SegmentInfo info;
  SegmentSetup texts;
  ReplaySetup setup;
  RunColumns columns;
  ExportPlaces places;
  std::vector<HistoryDamage> damage;
  SegmentExport walk;
  std::vector<double> row;
};

}  // namespace

struct HistoryMeans::Parts {
  std::filesystem::path file;
  HistoryPosition from;  ///< earlier cycles are skipped
  bool continued{false};
  std::uint64_t damaged{0};
  std::unique_ptr<Walk> walk;
  std::int64_t walked{0};  ///< segments up to this ID are finished
  HistoryPosition end;     ///< of the rows taken
  std::optional<OpenMean> open;
  MeansBatch batch;

  void refresh();
  bool open_next();
  void take_row(std::uint64_t cycle);
  void close_mean();
  void begin_batch();
  std::shared_ptr<const HistoryReader> newest;
};

HistoryMeans::HistoryMeans(std::filesystem::path history, const HistoryPosition& from)
    : parts_(std::make_unique<Parts>()) {
  parts_->file = std::move(history);
  const HistoryReader reader(parts_->file);
  for (const SegmentInfo& segment : reader.segments())
    if (segment.id == from.segment && segment.wall_ns == from.wall_ns) parts_->continued = true;
  if (!parts_->continued) return;
  parts_->from = from;
  parts_->walked = from.segment - 1;
}
HistoryMeans::~HistoryMeans() = default;
HistoryMeans::HistoryMeans(HistoryMeans&&) noexcept = default;

bool HistoryMeans::is_continued() const noexcept {
  return parts_->continued;
}
std::uint64_t HistoryMeans::damaged() const noexcept {
  return parts_->damaged + (parts_->walk ? parts_->walk->damage.size() : 0);
}

/// Reads the list of segments again; of a replaced file all segments are read.
void HistoryMeans::Parts::refresh() {
  newest = std::make_shared<const HistoryReader>(file);
  if (!walk) return;
  bool is_other_file = newest->segments().empty() || newest->segments().back().id < walk->info.id;
  for (const SegmentInfo& segment : newest->segments()) {
    if (segment.id != walk->info.id) continue;
    is_other_file = segment.wall_ns != walk->info.wall_ns;
    if (is_other_file) break;
    if (segment.last_cycle > walk->info.last_cycle) walk->walk.extend(segment.last_cycle);
    walk->info.last_cycle = segment.last_cycle;
  }
  if (is_other_file) walked = 0;
}

/// @return false when there are no more segments
bool HistoryMeans::Parts::open_next() {
  for (const SegmentInfo& segment : newest->segments()) {
    if (segment.id <= walked) continue;
    walked = segment.id;
    try {
      auto following = std::make_unique<Walk>(newest, segment);
      damaged += walk ? walk->damage.size() : 0;
      walk = std::move(following);
      return true;
    } catch (const std::exception&) {
      ++damaged;  // skip the damaged segment
    }
  }
  return false;
}

void HistoryMeans::Parts::begin_batch() {
  batch = {};
  if (!walk) return;
  batch.setup = walk->texts;
  batch.program_version = walk->info.program_version;
  batch.columns = walk->columns.names();
}

void HistoryMeans::Parts::close_mean() {
  if (!open) return;
  MeanRow row{open->at_s, {}};
  for (std::size_t i = 0; i < open->sum.size(); ++i)
    row.mean.push_back(open->count[i] > 0 ? static_cast<float>(open->sum[i] / open->count[i])
                                          : std::numeric_limits<float>::quiet_NaN());
  batch.rows.push_back(std::move(row));
  for (RecordedProbing& probing : open->probings) {
    for (const RecordedProbing& before : batch.probings)
      if (before.output == probing.output && before.wall_ns == probing.wall_ns) ++probing.number;
    batch.probings.push_back(std::move(probing));
  }
  open.reset();
}

void HistoryMeans::Parts::take_row(std::uint64_t cycle) {
  if (cycle < from.cycle && walk->info.id == from.segment) return walk->walk.skip();
  constexpr std::int64_t ns_per_s = 1'000'000'000;
  // The reader has replaced impossible times.
  const std::int64_t at_s = walk->walk.wall_ns(cycle) / ns_per_s / mean_s * mean_s;
  if (open && open->at_s != at_s) close_mean();
  if (!open) open = OpenMean{at_s, walk->at(cycle), {}, {}, {}};
  std::fill(walk->row.begin(), walk->row.end(), not_a_number);
  walk->walk.fill(walk->row, cycle);
  open->add(walk->row);
  for (const ExportedProbing& probing : walk->walk.probings())
    open->probings.push_back({walk->setup.estimator.axes[probing.axis].output, 0, probing.wall_ns,
                              probing.measured_um, probing.displacement_um, probing.modelled_um,
                              probing.claimed_um, probing.sd_um,
                              std::string(to_string(probing.source))});
  walk->walk.skip();  // its texts are not used
}

std::optional<MeansBatch> HistoryMeans::next(std::size_t rows_max, std::int64_t wall_s,
                                             const std::function<void()>& rest) {
  Parts& parts = *parts_;
  parts.refresh();
  if (!parts.walk && !parts.open_next()) return std::nullopt;
  parts.begin_batch();
  std::uint64_t cycle = 0;
  for (;;) {
    while (parts.batch.rows.size() < rows_max && parts.walk->walk.next(cycle)) {
      parts.take_row(cycle);
      parts.end = parts.walk->at(cycle + 1);
      rest();
    }
    if (parts.batch.rows.size() >= rows_max) break;
    if (!parts.open_next()) {
      if (parts.open && wall_s - parts.open->at_s > settled_s) parts.close_mean();
      break;
    }
    // The texts, since in a replaced file the same ID may be another setup's.
    if (parts.walk->texts != parts.batch.setup ||
        parts.walk->info.program_version != parts.batch.program_version) {
      parts.close_mean();
      parts.end = parts.walk->at(parts.walk->info.first_cycle);
      if (!parts.batch.rows.empty()) break;  // the next call continues with this segment
      parts.begin_batch();
    }
  }
  if (parts.batch.rows.empty()) return std::nullopt;
  parts.batch.after = parts.open ? parts.open->begin : parts.end;
  return std::move(parts.batch);
}

}  // namespace thermocomp
