/// What a history says about a stretch of a machine's life, for its owner.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/history/reading/history_reader.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "daemon/history/replay/thinned_history.hpp"

namespace thermocomp::cli {

/// Times of the wall clock, seconds since 1970, in all that follows.
struct WallSpan {
  double from_s{0.0};
  double to_s{0.0};
  [[nodiscard]] double length_s() const noexcept { return to_s > from_s ? to_s - from_s : 0.0; }
  [[nodiscard]] bool overlaps(const WallSpan& other) const noexcept {
    return from_s < other.to_s && other.from_s < to_s;
  }
  [[nodiscard]] WallSpan within(const WallSpan& other) const noexcept;
};

/// In the place of a mode where no daemon ran: it was stopped, or ended without that.
inline constexpr const char* daemon_stopped = "daemon_stopped";
inline constexpr const char* daemon_ended = "daemon_ended";

struct ModeSpell {
  WallSpan span;
  std::string mode;  ///< name of a mode: "compensating", "holding", ...; or one of the above
};

/// Faults of one subject.
struct Outages {
  struct Kind {
    std::size_t count{0};
    double lasted_s{0.0};
    bool lasts{false};
    bool operator==(const Kind&) const = default;
  };
  Subject subject;
  Event last;
  std::size_t count{0};
  double lasted_s{0.0};
  bool lasts{false};                  ///< at the end of the stretch
  std::map<std::string, Kind> kinds;  ///< the same, by code
};

struct OffsetRange {
  double low_um{std::numeric_limits<double>::quiet_NaN()};
  double high_um{std::numeric_limits<double>::quiet_NaN()};
  double mean_size_um{std::numeric_limits<double>::quiet_NaN()};  ///< of |offset|
  double at_bound_share{0.0};                                     ///< of the time with an offset
  [[nodiscard]] bool is_there() const noexcept { return low_um <= high_um; }
};

struct AxisWeek {
  std::string name;
  std::string unit;  ///< "um", "urad"
  double bound_um{0.0};
  OffsetRange sent;
  OffsetRange dry_run;  ///< computed and recorded, and not sent
};

struct ProbingWeek {
  double wall_s{0.0};
  std::string axis;
  double offset_um{std::numeric_limits<double>::quiet_NaN()};  ///< as sent
  double left_um{std::numeric_limits<double>::quiet_NaN()};    ///< at the tool, with the offset
  bool dry_run{false};  ///< the offset was not sent: both are what they would have been
};

/// A sensor beside the one that moved most like it.
struct SensorWeek {
  std::string name;
  std::string neighbour;  ///< empty: none moved alike
  double low_degC{std::numeric_limits<double>::quiet_NaN()};
  double high_degC{std::numeric_limits<double>::quiet_NaN()};
  double missing_share{0.0};                                    ///< of the recorded time
  double drift_K{std::numeric_limits<double>::quiet_NaN()};     ///< against the neighbour
  double drift_sd_K{std::numeric_limits<double>::quiet_NaN()};  ///< of that figure
};

struct MachineWeek {
  std::string machine;  ///< its name, in the title; empty: none
  std::string history;
  WallSpan span;
  double recorded_s{0.0};        ///< the daemon ran
  std::vector<ModeSpell> modes;  ///< within the span
  std::vector<Outages> outages;  ///< longest first
  std::vector<AxisWeek> axes;
  std::vector<ProbingWeek> probings;
  std::optional<CandidateStatus> candidate;  ///< its score at the last probing with one beside
  std::vector<SensorWeek> sensors;
  std::vector<RecordedEvent> commands;  ///< oldest first
  std::size_t starts{0};                ///< of the daemon
  std::vector<WallSpan> sent;           ///< recorded outside of dry runs; in order
  std::vector<WallSpan> dry_runs;       ///< recorded, and nothing sent; in order
  bool dry_run{false};                  ///< at the end
  std::vector<HistoryDamage> damage;
  ThinnedHistory course;

  [[nodiscard]] double mode_s(const std::string& mode) const;
  [[nodiscard]] double dry_run_s() const;
};

/// The same from the parts, for a test.
struct WeekEvents {
  std::vector<RecordedEvent> events;          ///< of the whole history, oldest first
  std::map<std::int64_t, double> run_ends_s;  ///< of each start of the daemon: its last record
};
[[nodiscard]] std::vector<ModeSpell> mode_spells(const WeekEvents& events, const WallSpan& span);
/// When no daemon ran. @param recorded  in any order
[[nodiscard]] std::vector<ModeSpell> daemon_pauses(const WeekEvents& events,
                                                   std::vector<WallSpan> recorded,
                                                   const WallSpan& span);
/// Faults after the daemon began to stop do not count: with the machine everything is switched off.
[[nodiscard]] std::vector<Outages> outages_of(const WeekEvents& events, const WallSpan& span);
[[nodiscard]] std::vector<SensorWeek> sensors_of(const ThinnedHistory& course);

/// Whether a point of a course lies in a dry run, or elsewhere; `both`: its mean is of both.
enum class PointPlace { sent, dry_run, both };
[[nodiscard]] std::vector<PointPlace> places_of(const ThinnedHistory& course,
                                                const std::vector<WallSpan>& sent,
                                                const std::vector<WallSpan>& dry_runs);

/// @throws HistoryError when nothing can be taken from the file
[[nodiscard]] MachineWeek machine_week(const std::filesystem::path& history, const WallSpan& span,
                                       const SetupParser& parser = parse_setup);

/// From the first to the last record. @throws HistoryError
[[nodiscard]] WallSpan recorded_span(const std::filesystem::path& history);

}  // namespace thermocomp::cli
