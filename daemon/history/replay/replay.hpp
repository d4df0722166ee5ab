/// The daemon's own estimator over what was recorded, the record as a run file, and which parts of
/// a history are sound. Only looks: nothing is repaired in place.
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

/// The offsets of one cycle at which the daemon noted its own.
struct ReplayedOffsets {
  double time_s{0.0};  ///< since the history's first cycle
  std::uint64_t cycle{0};
  const EstimatorConfig* config{nullptr};  ///< names and order of the axes
  std::span<const double> offset_um;       ///< replayed
  std::span<const double> recorded_um;     ///< by the daemon
};

struct ReplaySummary {
  std::uint64_t segments{0};
  std::uint64_t gaps{0};       ///< segments before which something was lost
  std::uint64_t cycles{0};     ///< steps
  std::uint64_t compared{0};   ///< offsets, one per axis and noted cycle
  std::uint64_t different{0};  ///< ... that differ in any bit, or in their valid mark or epoch
  double largest_difference_um{0.0};
  std::optional<std::uint64_t> first_different_cycle;
  std::optional<double> first_different_time_s;
  std::vector<HistoryDamage> damage;  ///< what could not be replayed
};

using OffsetSink = std::function<void(const ReplayedOffsets&)>;
/// Called now and then with the fraction done, 0..1.
using Progress = std::function<void(double)>;

/// Runs every segment from its own start state over every cycle that was stepped. Where a segment
/// is damaged its replay ends, and the next one begins.
/// @throws HistoryError when nothing can be taken from the file
ReplaySummary replay(const std::filesystem::path& history, const OffsetSink& sink,
                     const Progress& progress = {}, const SetupParser& parser = parse_setup);

/// As a run file, with a comment line where something is damaged: time_s, then `<axis>_offset_um`
/// and `<axis>_recorded_um` of every axis.
ReplaySummary replay_to_csv(const std::filesystem::path& history, std::ostream& out,
                            const Progress& progress = {}, const SetupParser& parser = parse_setup);

struct ExportSummary {
  std::uint64_t rows{0};
  std::uint64_t gaps{0};  ///< between rows of the file, each named by a comment line
  std::vector<std::string> columns;
  std::vector<HistoryDamage> damage;  ///< what could not be taken, each named by a comment line
};
/// The column of a run file that holds a sensor's readings: `<sensor>_degC`.
[[nodiscard]] std::string sensor_column(const std::string& sensor);

/// What the temperatures of an export are.
enum class ExportContent {
  inputs,  ///< the model's inputs, by its names, as the daemon computed with them
  sensors  ///< every sensor as the driver gave it, `<sensor>_degC`; then no inputs beside them
};

/// A run file with a row at every cycle whose offsets were noted and from <= time < to: time_s
/// (since the first row); the temperatures (missing where no sensor of the block was good; sensors
/// of no block by their own names, as read); the controller's signals; the outputs of which
/// something was probed, in the first row after an operator gave it (without the offset in effect,
/// as `[correction] measured` says what he gave); `<axis>_offset_um`, `<axis>_applied_um` and
/// `<axis>_measured_um`, which is what the operator said.
/// Comment lines tell the wall time of the first row, of one row per hour and of each that follows
/// a gap or a clock that was set; what is missing between two rows; faults of sensors as they begin
/// and end, commands and changes of the model.
/// The inputs come from stepping the estimator again. Where a segment is damaged that ends, and
/// they are means of what was read until the next segment. A chunk that is damaged costs its own
/// rows, and a segment that cannot be read at all is left out. Segments outside `from` and `to` are
/// not read.
/// @throws HistoryError when nothing can be taken from the file
ExportSummary export_run(const std::filesystem::path& history,
                         const std::optional<HistoryTime>& from,
                         const std::optional<HistoryTime>& to, std::ostream& out,
                         const Progress& progress = {}, const SetupParser& parser = parse_setup,
                         ExportContent content = ExportContent::inputs);

struct SegmentCheck {
  SegmentInfo segment;
  std::uint64_t records{0};           ///< that can be read
  std::vector<HistoryDamage> damage;  ///< none: it is sound
};

struct HistoryCheck {
  std::vector<SegmentCheck> segments;  ///< those that can be read in part at least, oldest first
  std::vector<HistoryDamage> damage;   ///< of the file, and segments that cannot be read at all
  [[nodiscard]] bool is_sound() const noexcept;
};

/// Every row, chunk and record: checksums, the order of
/// records, the state and inputs at the start of each segment, its configuration.
/// @throws HistoryError when nothing can be taken from the file
[[nodiscard]] HistoryCheck check_history(const std::filesystem::path& history,
                                         const Progress& progress = {},
                                         const SetupParser& parser = parse_setup);

}  // namespace thermocomp
