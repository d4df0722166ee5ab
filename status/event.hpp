/// Events of the daemon, and their texts.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace thermocomp {

enum class EventKind : std::uint8_t { fault, recovery, mode, command, daemon };

/// Subject of an event; `nothing` if its kind suffices.
enum class SubjectKind : std::uint8_t {
  nothing,
  reason,
  sensor,
  suspected_sensor,
  input,  ///< a temperature column of the model
  axis,
  estimate,  ///< of an axis, from estimated inputs
  bus,
  bus_errors,  ///< of a connected CAN interface
  device,
  controller,
  controller_errors,
  controller_writes,
  history,
  log  ///< the daemon's log
};

struct Subject {
  SubjectKind kind{SubjectKind::nothing};
  std::string name;  ///< kind `mode`: the previous mode, empty for the first one

  Subject() = default;
  Subject(SubjectKind of_kind, std::string named) : kind(of_kind), name(std::move(named)) {}

  auto operator<=>(const Subject&) const = default;
};

/// RMS error of each model alone over the probings.
struct ContestRms {
  double model{std::numeric_limits<double>::quiet_NaN()};
  double candidate{std::numeric_limits<double>::quiet_NaN()};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("model", self.model);
    visit("candidate", self.candidate);
  }
};

/// The candidate model.
struct CandidateStatus {
  std::string file{};
  std::string problem{};  ///< why it does not run; empty if it does
  std::uint64_t probings{0};
  std::map<std::string, ContestRms> rms_um{};  ///< by axis
  double better_probability{std::numeric_limits<double>::quiet_NaN()};
  double worse_probability{std::numeric_limits<double>::quiet_NaN()};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("file", self.file);
    visit("problem", self.problem);
    visit("probings", self.probings);
    visit("rms_um", self.rms_um);
    visit("better_probability", self.better_probability);
    visit("worse_probability", self.worse_probability);
  }
};

struct Event {
  std::uint64_t number{0};  ///< counted from 1 in each run of the daemon
  double wall_s{0.0};       ///< since 1970
  EventKind kind{EventKind::daemon};
  Subject subject{};
  /// Name of the reason, fault, mode, command or CAN state, or a fixed word: "suspected",
  /// "mismatch_latched", "not_connected", "frozen", "not_written", "estimated", "lost",
  /// "uncertain", "not_taken"; of the daemon "started", "stopping", "history", "offset".
  std::string code{};
  std::string detail{};  ///< text of a device, driver or signal; of a reload; may be empty
  /// suspected: error of the sensor [K]; recovery of a sensor: change over the fault if larger than
  /// rate_allowance_K [K]; commands `measured` and `prove`: [um]; NaN: none
  double value{std::numeric_limits<double>::quiet_NaN()};
  /// recovery: duration of the fault [s]; mode: duration of the previous one [s]; "started", from a
  /// history: time without a daemon before it [s]; else NaN
  double duration_s{std::numeric_limits<double>::quiet_NaN()};
  bool comes_and_goes{false};  ///< fault: intermittent, returned soon after its end
  std::int64_t user{-1};       ///< command: user ID from the kernel; -1: none, or SIGHUP
  std::string asked_for{};     ///< command: the person that this user named; empty: none
  /// command `measured`: the candidate's score, including this probing
  std::optional<CandidateStatus> candidate{};
};

/// An event in a history, with its run of the daemon.
struct RecordedEvent : Event {
  std::int64_t run{0};  ///< number of the daemon's start; set by the history
};

/// Mode of a run while it compensates and an axis is latched, hence not driven.
inline constexpr std::string_view not_driven = "not_driven";

/// Mode of the offsets, from the events of a run in their order.
class RecordedMode {
 public:
  void take(const Event& event);
  /// A mode's name, or `not_driven`; empty before the first one.
  [[nodiscard]] std::string name() const;

 private:
  std::string mode_;
  std::set<std::string> latched_axes_;
};

[[nodiscard]] std::string_view to_string(EventKind kind) noexcept;
[[nodiscard]] std::string_view to_string(SubjectKind kind) noexcept;
/// `daemon` for an unknown name.
[[nodiscard]] EventKind event_kind_named(std::string_view name) noexcept;
/// `nothing` for an unknown name.
[[nodiscard]] SubjectKind subject_kind_named(std::string_view name) noexcept;

/// "sensor bed_front", "reason at_bound", "bus cabinet, errors"; for a mode the previous one.
[[nodiscard]] std::string subject_text(const Subject& subject);
/// Text without subject: "stale", "measured z 1.5 um", "off by +2.0 K against its neighbours".
[[nodiscard]] std::string what_text(const Event& event);
/// A line without time and kind: "sensor bed_front: not renewed in time: over, lasted 28.1 s".
[[nodiscard]] std::string event_text(const Event& event);
/// One line per event: local time, kind, text.
/// @param events  oldest first
[[nodiscard]] std::string events_text(const std::vector<Event>& events);

}  // namespace thermocomp
