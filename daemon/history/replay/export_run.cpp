#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <ostream>
#include <stdexcept>

#include "config/text/printable_text.hpp"
#include "daemon/history/replay/replay.hpp"
#include "daemon/history/replay/segment_export.hpp"
#include "daemon/history/replay/segment_walk.hpp"

namespace thermocomp {
namespace {

/// Comment line for a gap between two segments; empty if they are contiguous.
std::string gap_line(const HistoryReader& reader, const SegmentInfo& before,
                     const SegmentInfo& after, double first_s) {
  const double from_s =
      reader.seconds_at(before, static_cast<std::uint64_t>(before.last_cycle + 1)) - first_s;
  const double to_s = reader.seconds_at(after, after.first_cycle) - first_s;
  const double period_s = std::chrono::duration<double>(after.grid.period).count();
  if (!(to_s - from_s > 0.5 * period_s)) return {};
  return fmt::format(
      "# nothing is recorded from {:.3f} s to {:.3f} s: {}\n", from_s, to_s,
      after.reason == SegmentReason::gap ? "lost" : "the daemon ended and began again");
}

/// True if the whole segment is outside [from, to), as far as seconds show.
bool is_outside(const HistoryReader& reader, const SegmentInfo& segment,
                const std::optional<HistoryTime>& from, const std::optional<HistoryTime>& to) {
  const auto end = static_cast<std::uint64_t>(segment.last_cycle + 1);
  const bool is_before_it =
      from && from->seconds && reader.seconds_at(segment, end) < *from->seconds;
  return is_before_it ||
         (to && to->seconds && reader.seconds_at(segment, segment.first_cycle) >= *to->seconds);
}

/// "# 12.500 s: what\n"
std::string comment_at(double time_s, const std::string& what) {
  // a damaged file may contain any text
  return fmt::format("# {:.3f} s: {}\n", time_s, printable_text(what));
}

/// Selects rows for a wall-time comment: the first, one per hour, and after a clock step.
class WallComments {
 public:
  /// @return empty: no comment
  std::string at(double time_s, std::int64_t wall_ns) {
    constexpr double every_s = 3600.0;
    constexpr double off_s_max = 0.5;
    const double expected_s = 1e-9 * static_cast<double>(wall_ns - written_wall_ns_);
    const double passed_s = time_s - written_s_;
    const bool follows = std::abs(expected_s - passed_s) <= off_s_max;
    if (is_written_ && follows && passed_s < every_s) return {};
    is_written_ = true;
    written_s_ = time_s;
    written_wall_ns_ = wall_ns;
    return comment_at(time_s, "wall time " + utc_text(wall_ns));
  }

 private:
  bool is_written_{false};
  double written_s_{0.0};
  std::int64_t written_wall_ns_{0};
};

/// Writes the segments' rows, with comment lines between them.
class RunExport {
 public:
  RunExport(const HistoryReader& reader, const SetupParser& parser, ExportContent content,
            const std::optional<HistoryTime>& from, const std::optional<HistoryTime>& to,
            std::ostream& out)
      : reader_(reader), setups_(reader, parser), from_(from), to_(to), out_(out) {
    columns_.column("time_s");
    std::map<std::int64_t, std::vector<bool>> probed = find_probed();
    for (const auto& [id, setup] : setups_.all())
      places_[id] = export_places(setup, content, &probed[id], columns_);
    summary_.columns = columns_.names();
    append_header(text_, columns_.names());
    row_.resize(columns_.names().size());
    summary_.damage = reader.damage();
    report_damage();
  }

  ExportSummary run(const Progress& progress) {
    std::size_t done = 0;
    for (const SegmentInfo& segment : reader_.segments()) {
      if (!is_outside(reader_, segment, from_, to_)) take(segment);
      ++done;
      if (progress) {
        progress(static_cast<double>(done) / static_cast<double>(reader_.segments().size()));
      }
    }
    out_ << text_;
    return std::move(summary_);
  }

 private:
  /// Axes probed in the exported segments, by setup.
  [[nodiscard]] std::map<std::int64_t, std::vector<bool>> find_probed() const {
    std::map<std::int64_t, std::vector<bool>> probed;
    for (const SegmentInfo& segment : reader_.segments()) {
      const ReplaySetup* setup = setups_.find(segment);
      if (setup == nullptr || is_outside(reader_, segment, from_, to_)) continue;
      std::vector<bool>& all = probed[segment.setup];
      all.resize(setup->estimator.axes.size(), false);
      note_probed(reader_, segment, all);
    }
    return probed;
  }

  void take(const SegmentInfo& segment) {
    try {
      SegmentExport walk(reader_, segment, setups_.of(segment), places_.at(segment.setup),
                         summary_.damage);
      std::uint64_t cycle = 0;
      while (walk.next(cycle)) {
        report_damage();
        const double time_s = reader_.seconds_at(segment, cycle);
        const std::int64_t wall_ns = walk.wall_ns(cycle);
        if (is_within(time_s, wall_ns, from_, to_))
          write(segment, cycle, time_s, wall_ns, walk);
        else
          walk.skip();
      }
    } catch (const std::exception& error) {
      summary_.damage.push_back({segment.id, error.what()});
    }
    report_damage();
  }

  void write(const SegmentInfo& segment, std::uint64_t cycle, double time_s, std::int64_t wall_ns,
             SegmentExport& walk) {
    if (!first_s_) first_s_ = time_s;
    std::fill(row_.begin(), row_.end(), not_a_number);
    walk.fill(row_, cycle);
    row_[0] = time_s - *first_s_;
    if (last_written_ != nullptr && last_written_ != &segment) {
      const std::string gap = gap_line(reader_, *last_written_, segment, *first_s_);
      text_ += gap;
      if (!gap.empty()) ++summary_.gaps;
    }
    write_setup(segment);
    last_written_ = &segment;
    text_ += wall_.at(row_[0], wall_ns);
    for (const std::string& what : walk.happened()) text_ += comment_at(row_[0], what);
    append_row(text_, row_);
    for (const std::string& reference : walk.references_after_row())
      text_ += comment_at(row_[0], reference);
    out_ << text_;
    text_.clear();
    ++summary_.rows;
  }

  void write_setup(const SegmentInfo& segment) {
    if (last_written_ != nullptr && last_written_->setup == segment.setup) return;
    const std::string checksum = reader_.setup(segment).model_checksum;
    text_ += comment_at(row_[0], (last_written_ == nullptr ? "model SHA-256 "
                                                           : "reloaded or restarted with another "
                                                             "configuration, model SHA-256 ") +
                                     checksum);
  }

  void report_damage() {
    for (; reported_ < summary_.damage.size(); ++reported_)
      text_ += damage_line(summary_.damage[reported_]);
  }

  const HistoryReader& reader_;
  ParsedSetups setups_;
  const std::optional<HistoryTime>& from_;
  const std::optional<HistoryTime>& to_;
  std::ostream& out_;
  RunColumns columns_;
  std::map<std::int64_t, ExportPlaces> places_;
  ExportSummary summary_;
  std::size_t reported_{0};  ///< number of damage entries reported
  std::string text_;
  std::vector<double> row_;
  std::optional<double> first_s_;
  WallComments wall_;
  const SegmentInfo* last_written_{nullptr};
};

}  // namespace

ExportSummary export_run(const std::filesystem::path& history,
                         const std::optional<HistoryTime>& from,
                         const std::optional<HistoryTime>& to, std::ostream& out,
                         const Progress& progress, const SetupParser& parser,
                         ExportContent content) {
  const HistoryReader reader(history);
  return RunExport(reader, parser, content, from, to, out).run(progress);
}

}  // namespace thermocomp
