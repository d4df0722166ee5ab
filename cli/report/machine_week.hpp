/// Summary of a period of a machine's history, for its owner.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/history/reading/history_reader.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "daemon/history/replay/thinned_history.hpp"
#include "estimator/types.hpp"

namespace thermocomp::cli {

/// Wall-clock times, seconds since 1970, as everywhere below.
struct WallSpan {
  double from_s{0.0};
  double to_s{0.0};
  [[nodiscard]] double length_s() const noexcept { return to_s > from_s ? to_s - from_s : 0.0; }
  [[nodiscard]] bool overlaps(const WallSpan& other) const noexcept {
    return from_s < other.to_s && other.from_s < to_s;
  }
  [[nodiscard]] WallSpan within(const WallSpan& other) const noexcept {
    return {std::max(from_s, other.from_s), std::min(to_s, other.to_s)};
  }
};

/// Replaces a mode while nothing was recorded: the daemon was stopped, ended without a stop, or ran
/// on (disk full, clock set).
inline constexpr const char* daemon_stopped = "daemon_stopped";
inline constexpr const char* daemon_ended = "daemon_ended";
inline constexpr const char* not_recorded = "not_recorded";
/// Replaces `compensating` for a model of zeros.
inline constexpr const char* zero_model = "zero_model";

struct ModeSpell {
  WallSpan span;
  std::string mode;  ///< "compensating", "holding", ..., or one of the above
};

/// How often and how long a fault was there within the period.
struct OutageTimes {
  std::size_t count{0};
  double lasted_s{0.0};
  bool lasts{false};  ///< at the end of the period
};

/// Faults of one subject.
struct Outages : OutageTimes {
  Subject subject;
  Event last;
  std::map<std::string, OutageTimes> kinds;  ///< by fault code
};

struct OffsetRange {
  double low_um{not_a_number};
  double high_um{not_a_number};
  double mean_size_um{not_a_number};  ///< of |offset|
  double at_bound_share{0.0};         ///< share of the time with an offset
  [[nodiscard]] bool is_there() const noexcept { return low_um <= high_um; }
};

struct AxisWeek {
  std::string name;
  std::string unit;  ///< "um", "urad"
  double bound_um{0.0};
  OffsetRange sent;
  OffsetRange dry_run;  ///< computed and recorded, but not sent
};

struct ProbingWeek {
  double wall_s{0.0};
  std::string axis;
  double offset_um{not_a_number};  ///< as sent
  double left_um{not_a_number};    ///< remaining displacement at the tool
  bool dry_run{false};             ///< not sent: both values are hypothetical
};

/// A sensor and its most strongly correlated neighbour.
struct SensorWeek {
  std::string name;
  std::string neighbour;  ///< empty: correlation at most 0.8 with all
  double low_degC{not_a_number};
  double high_degC{not_a_number};
  double missing_share{0.0};        ///< share of the recorded time
  double drift_K{not_a_number};     ///< against the neighbour
  double drift_sd_K{not_a_number};  ///< standard error of drift_K
};

struct MachineWeek {
  std::string machine;  ///< title of the report; empty: none
  std::string history;
  WallSpan span;
  double recorded_s{0.0};        ///< time with a running daemon
  std::vector<ModeSpell> modes;  ///< clipped to the span
  std::vector<Outages> outages;  ///< longest first
  std::vector<AxisWeek> axes;
  std::vector<ProbingWeek> probings;
  std::optional<CandidateStatus> candidate;  ///< score at the last probing with a candidate
  std::vector<SensorWeek> sensors;
  std::vector<RecordedEvent> commands;  ///< oldest first
  std::size_t starts{0};                ///< starts of the daemon
  std::vector<WallSpan> sent;           ///< recorded without dry run, in order
  std::vector<WallSpan> dry_runs;       ///< recorded in a dry run, in order
  bool dry_run{false};                  ///< at the end
  std::vector<HistoryDamage> damage;
  ThinnedHistory course;

  [[nodiscard]] double mode_s(const std::string& mode) const;
  [[nodiscard]] double dry_run_s() const;
};

/// Parts of machine_week(), for tests.
struct WeekEvents {
  std::vector<RecordedEvent> events;          ///< whole history, oldest first
  std::map<std::int64_t, double> run_ends_s;  ///< time of the last record of each run of the daemon
};
[[nodiscard]] std::vector<ModeSpell> mode_spells(const WeekEvents& events, const WallSpan& span);
/// Times without a record. @param recorded in any order
[[nodiscard]] std::vector<ModeSpell> daemon_pauses(const WeekEvents& events,
                                                   std::vector<WallSpan> recorded,
                                                   const WallSpan& span);
/// Ignores faults after the daemon began to stop, when everything is switched off.
[[nodiscard]] std::vector<Outages> outages_of(const WeekEvents& events, const WallSpan& span);
[[nodiscard]] std::vector<SensorWeek> sensors_of(const ThinnedHistory& course);

/// Whether the samples of a thinned point are from a dry run, or not, or from both.
enum class PointPlace { sent, dry_run, both };
[[nodiscard]] std::vector<PointPlace> places_of(const ThinnedHistory& course,
                                                const std::vector<WallSpan>& sent,
                                                const std::vector<WallSpan>& dry_runs);

/// @throws HistoryError if nothing can be read from the file
[[nodiscard]] MachineWeek machine_week(const std::filesystem::path& history, const WallSpan& span,
                                       const SetupParser& parser = parse_setup);

/// From the first record to the last. @throws HistoryError
[[nodiscard]] WallSpan recorded_span(const std::filesystem::path& history);

}  // namespace thermocomp::cli
