/// What happened: one record each, and its text for people.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace thermocomp {

enum class EventKind : std::uint8_t { fault, recovery, mode, command, daemon };

/// What an event is about; `nothing` where its kind is enough.
enum class SubjectKind : std::uint8_t {
  nothing,
  reason,
  sensor,
  suspected_sensor,
  input,  ///< a temperature column of the model
  axis,
  estimate,  ///< of an axis, from inputs that are estimated themselves
  bus,
  bus_errors,  ///< of a CAN interface that is connected
  device,
  controller,
  controller_errors,
  controller_writes,
  history,
  log  ///< of the daemon itself
};

struct Subject {
  SubjectKind kind{SubjectKind::nothing};
  std::string name;  ///< of an event of kind `mode`: the mode before, empty for the first one

  Subject() = default;
  Subject(SubjectKind of_kind, std::string named) : kind(of_kind), name(std::move(named)) {}

  auto operator<=>(const Subject&) const = default;
};

/// Of the probings, what each model alone left.
struct ContestRms {
  double model{std::numeric_limits<double>::quiet_NaN()};
  double candidate{std::numeric_limits<double>::quiet_NaN()};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("model", self.model);
    visit("candidate", self.candidate);
  }
};

/// The model that runs beside the one in use.
struct CandidateStatus {
  std::string file{};
  std::string problem{};  ///< why it does not run; empty: it does
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
  std::uint64_t number{0};  ///< counts up from 1 in a run of the daemon
  double wall_s{0.0};       ///< since 1970
  EventKind kind{EventKind::daemon};
  Subject subject{};
  /// Name of the reason, fault, mode, command or CAN state; else one word that programs compare:
  /// "suspected", "mismatch_latched", "not_connected", "not_written", "estimated", "lost",
  /// "uncertain", "not_taken"; of the daemon "started", "stopping", "history".
  std::string code{};
  std::string detail{};  ///< in the words of a device, driver or signal; may be empty
  /// suspected: error of the sensor [K]; commands `measured` and `prove`: [um]; NaN: none
  double value{std::numeric_limits<double>::quiet_NaN()};
  /// recovery: how long the fault lasted; mode: how long the one before it did [s]. NaN: neither
  double duration_s{std::numeric_limits<double>::quiet_NaN()};
  bool comes_and_goes{false};  ///< fault: one that returned soon after its end
  std::int64_t user{-1};       ///< command: who gave it, by the kernel; -1: nobody, or SIGHUP
  /// command `measured`: the score of a model that ran beside, this probing included
  std::optional<CandidateStatus> candidate{};
};

/// An event of a history, with the run of the daemon that it belongs to.
struct RecordedEvent : Event {
  std::int64_t run{0};  ///< one number for each start of the daemon; set by the history
};

[[nodiscard]] std::string_view to_string(EventKind kind) noexcept;
[[nodiscard]] std::string_view to_string(SubjectKind kind) noexcept;
/// An unknown name is `daemon`.
[[nodiscard]] EventKind event_kind_named(std::string_view name) noexcept;
/// An unknown name is `nothing`.
[[nodiscard]] SubjectKind subject_kind_named(std::string_view name) noexcept;

/// "sensor bed_front", "reason at_bound", "bus cabinet, errors"; of a mode the one before.
[[nodiscard]] std::string subject_text(const Subject& subject);
/// Without its subject: "stale", "measured z 1.5 um", "off by +2.0 K against its neighbours".
[[nodiscard]] std::string what_text(const Event& event);
/// A line for people, without time and kind: "sensor bed_front: not renewed in time: over, lasted
/// 28.1 s".
[[nodiscard]] std::string event_text(const Event& event);
/// One line an event: local time, kind, text.
/// @param events  oldest first
[[nodiscard]] std::string events_text(const std::vector<Event>& events);

}  // namespace thermocomp
