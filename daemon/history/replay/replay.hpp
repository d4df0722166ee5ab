/// Replay, export and check of a history. The file is never modified.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/history/format/history_time.hpp"
#include "daemon/history/reading/history_reader.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp {

/// Offsets at a cycle whose offsets the daemon recorded.
struct ReplayedOffsets {
  double time_s{0.0};  ///< since the history's first cycle
  std::uint64_t cycle{0};
  const EstimatorConfig* config{nullptr};  ///< names and order of the axes
  std::span<const double> offset_um;       ///< replayed
  std::span<const double> recorded_um;     ///< by the daemon
};

struct ReplaySummary {
  std::uint64_t segments{0};
  std::uint64_t gaps{0};       ///< segments preceded by a loss
  std::uint64_t cycles{0};     ///< steps
  std::uint64_t compared{0};   ///< offsets, one per axis and recorded cycle
  std::uint64_t different{0};  ///< ... that differ in any bit, or in validity or epoch
  double largest_difference_um{0.0};
  std::optional<std::uint64_t> first_different_cycle;
  std::optional<double> first_different_time_s;
  std::vector<HistoryDamage> damage;  ///< parts that could not be replayed
};

using OffsetSink = std::function<void(const ReplayedOffsets&)>;
/// Called from time to time with the fraction done, 0..1.
using Progress = std::function<void(double)>;

/// Replays every segment from its own start state, with exactly the cycles that were stepped. After
/// damage, continues with the next segment.
/// @throws HistoryError when the file cannot be read at all
ReplaySummary replay(const std::filesystem::path& history, const OffsetSink& sink,
                     const Progress& progress = {}, const SetupParser& parser = parse_setup);

/// Writes the replay as a run file: time_s, then `<axis>_offset_um` and `<axis>_recorded_um` of
/// every axis; damage becomes a comment line.
ReplaySummary replay_to_csv(const std::filesystem::path& history, std::ostream& out,
                            const Progress& progress = {}, const SetupParser& parser = parse_setup);

struct ExportSummary {
  std::uint64_t rows{0};
  std::uint64_t gaps{0};  ///< between rows of the file, each with a comment line
  std::vector<std::string> columns;
  std::vector<HistoryDamage>
      damage;  ///< parts that could not be exported, each with a comment line
};
/// The column of a run file that holds a sensor's readings: `<sensor>_degC`.
[[nodiscard]] std::string sensor_column(const std::string& sensor);

/// Temperatures in an export.
enum class ExportContent {
  inputs,  ///< the model's inputs, by name, as used by the daemon
  sensors  ///< raw readings of every sensor, `<sensor>_degC`, instead of the inputs
};

/// Writes a run file with a row at every cycle with recorded offsets and from <= time < to.
/// Columns: time_s (since the first row); the temperatures (missing if no sensor of the block was
/// good; sensors without a block by their own names, raw); the controller's signals; probed
/// outputs, in the first row after the command (without the offset in effect, according to
/// `[correction] measured`); `<axis>_offset_um`, `<axis>_applied_um` and `<axis>_measured_um` (as
/// entered). Comment lines give the wall time of the first row, of one row per hour and after each
/// gap or clock step; gaps between rows; begin and end of sensor faults; commands; changes of the
/// model. The inputs come from stepping the estimator again; after damage they are means of the
/// readings until the next segment. Rows of a damaged chunk and unreadable segments are left out.
/// Segments outside `from` and `to` are not read.
/// @throws HistoryError when the file cannot be read at all
ExportSummary export_run(const std::filesystem::path& history,
                         const std::optional<HistoryTime>& from,
                         const std::optional<HistoryTime>& to, std::ostream& out,
                         const Progress& progress = {}, const SetupParser& parser = parse_setup,
                         ExportContent content = ExportContent::inputs);

struct SegmentCheck {
  SegmentInfo segment;
  std::uint64_t records{0};           ///< number of readable records
  std::vector<HistoryDamage> damage;  ///< empty: sound
};

struct HistoryCheck {
  std::vector<SegmentCheck> segments;  ///< at least partly readable, oldest first
  std::vector<HistoryDamage> damage;   ///< of the file, and of unreadable segments
  [[nodiscard]] bool is_sound() const noexcept;
};

/// Checks every row, chunk and record: checksums, order of records, start state and inputs of each
/// segment, its configuration.
/// @throws HistoryError when the file cannot be read at all
[[nodiscard]] HistoryCheck check_history(const std::filesystem::path& history,
                                         const Progress& progress = {},
                                         const SetupParser& parser = parse_setup);

}  // namespace thermocomp
