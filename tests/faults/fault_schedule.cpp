#include "fault_schedule.hpp"

#include <algorithm>

namespace thermocomp::faults {
namespace {

constexpr std::array<std::string_view, fault_kinds> names{"sensor_open",
                                                          "sensor_short",
                                                          "sensor_stuck",
                                                          "sensor_spiking",
                                                          "sensor_drifting",
                                                          "sensors_swapped",
                                                          "frames_lost",
                                                          "frames_doubled",
                                                          "frames_late",
                                                          "frames_reordered",
                                                          "frames_garbled",
                                                          "frames_truncated",
                                                          "unit_dead",
                                                          "unit_reboot",
                                                          "unit_busy",
                                                          "unit_in_fahrenheit",
                                                          "unit_tenfold_too_low",
                                                          "unit_not_ready",
                                                          "bus_down",
                                                          "controller_off",
                                                          "controller_rehomed",
                                                          "controller_rejecting",
                                                          "writes_unanswered",
                                                          "controller_slow",
                                                          "controller_applies_other",
                                                          "read_back_scaled",
                                                          "read_back_negated",
                                                          "read_back_shifted",
                                                          "read_back_drifting",
                                                          "read_back_jumped",
                                                          "read_back_frozen",
                                                          "controller_ignoring",
                                                          "second_writer",
                                                          "wall_clock_stepped",
                                                          "cycle_overrun",
                                                          "model_reload",
                                                          "daemon_killed",
                                                          "main_stands_still",
                                                          "history_disk_full",
                                                          "history_files_removed"};

/// Shortest and longest duration of a fault [s].
std::pair<double, double> duration_s(FaultKind kind) {
  switch (kind) {
    case FaultKind::cycle_overrun:
      return {1.0, 15.0};
    case FaultKind::controller_rehomed:
    case FaultKind::model_reload:
    case FaultKind::unit_reboot:
      return {3.0, 40.0};
    case FaultKind::daemon_killed:
      return {2.0, 60.0};
    // Beyond the watchdog's timeout it becomes a kill.
    case FaultKind::main_stands_still:
      return {0.5, 10.0};
    // Long enough for any band that widens with time to include the false value.
    case FaultKind::unit_in_fahrenheit:
    case FaultKind::unit_tenfold_too_low:
      return {60.0, 900.0};
    case FaultKind::unit_not_ready:
      return {10.0, 240.0};
    default:
      return {2.0, 150.0};
  }
}

std::pair<FaultKind, FaultKind> kinds_of_pair(std::size_t index) {
  for (std::size_t a = 0; a < fault_kinds; ++a) {
    const std::size_t row = fault_kinds - a;
    if (index < row) return {static_cast<FaultKind>(a), static_cast<FaultKind>(a + index)};
    index -= row;
  }
  return {};
}

}  // namespace

std::string_view name_of(FaultKind kind) noexcept {
  return names[static_cast<std::size_t>(kind)];
}

std::optional<FaultKind> kind_of(std::string_view name) noexcept {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return static_cast<FaultKind>(found - names.begin());
}

std::size_t pair_index(FaultKind a, FaultKind b) noexcept {
  const auto low = static_cast<std::size_t>(std::min(a, b));
  const auto high = static_cast<std::size_t>(std::max(a, b));
  return low * fault_kinds - low * (low + 1) / 2 + high;
}

FaultEvent FaultSchedule::draw(Chance& chance, FaultKind kind, nanoseconds begin, double scale) {
  const auto [low_s, high_s] = duration_s(kind);
  FaultEvent event;
  event.kind = kind;
  event.begin = begin;
  event.end = begin + from_s(scale * chance.between(low_s, high_s));
  event.subject = chance.below(64);
  event.strength = chance.fraction();
  event.number = ++numbers_;
  return event;
}

FaultSchedule::FaultSchedule(std::uint64_t seed, const ScheduleOptions& options)
    : start_(options.start) {
  Chance chance(seed, 7);
  const double scale = options.seconds_scale;
  const nanoseconds last = options.start + options.length;
  nanoseconds at = options.start + from_s(scale * chance.between(60.0, 120.0));
  for (std::size_t index = 0;; ++index) {
    Episode episode;
    episode.begin = at;
    const auto [first, second] = kinds_of_pair((options.directed_pair + index) % fault_pairs);
    const std::size_t count = 1 + chance.below(4);
    for (std::size_t i = 0; i < std::max<std::size_t>(count, 1); ++i) {
      FaultKind kind = i == 0   ? first
                       : i == 1 ? second
                                : static_cast<FaultKind>(chance.below(fault_kinds));
      kind = options.only.value_or(kind);
      const nanoseconds begin =
          i == 0 ? at
                 : at + nanoseconds{static_cast<nanoseconds::rep>(
                            1.2 * chance.fraction() *
                            static_cast<double>((episode.faults[0].end - at).count()))};
      episode.faults.push_back(draw(chance, kind, begin, scale));
      episode.end = std::max(episode.end, episode.faults.back().end);
    }
    if (episode.end >= last) break;
    at = episode.end + from_s(scale * chance.between(100.0, 200.0));
    episodes_.push_back(std::move(episode));
  }
}

const Episode* FaultSchedule::episode_at(nanoseconds time) const noexcept {
  while (cursor_ < episodes_.size() && episodes_[cursor_].end <= time) ++cursor_;
  while (cursor_ > 0 && time < episodes_[cursor_ - 1].end) --cursor_;
  return cursor_ < episodes_.size() ? &episodes_[cursor_] : nullptr;
}

const FaultEvent* FaultSchedule::find(FaultKind kind, nanoseconds time) const noexcept {
  const Episode* episode = episode_at(time);
  if (episode == nullptr || time < episode->begin) return nullptr;
  for (const FaultEvent& fault : episode->faults) {
    if (fault.kind == kind && fault.on_at(time)) return &fault;
  }
  return nullptr;
}

const FaultEvent* FaultSchedule::find(FaultKind kind, nanoseconds time, std::size_t subject,
                                      std::size_t subjects) const noexcept {
  const Episode* episode = episode_at(time);
  if (episode == nullptr || time < episode->begin) return nullptr;
  for (const FaultEvent& fault : episode->faults) {
    if (fault.kind == kind && fault.subject % subjects == subject && fault.on_at(time))
      return &fault;
  }
  return nullptr;
}

bool FaultSchedule::alone(FaultKind kind, nanoseconds time, nanoseconds since) const noexcept {
  const FaultEvent* fault = find(kind, time);
  if (fault == nullptr || fault->begin > time - since) return false;
  const auto& all = episode_at(time)->faults;
  return std::all_of(all.begin(), all.end(), [&](const FaultEvent& other) {
    return other.kind == kind || other.begin > time || other.end <= time - since;
  });
}

nanoseconds FaultSchedule::fault_free_since(nanoseconds time) const noexcept {
  static_cast<void>(episode_at(time));
  return cursor_ == 0 ? start_ : episodes_[cursor_ - 1].end;
}

std::bitset<fault_pairs> FaultSchedule::pairs() const {
  std::bitset<fault_pairs> met;
  for (const Episode& episode : episodes_) {
    for (std::size_t i = 0; i < episode.faults.size(); ++i) {
      for (std::size_t k = 0; k < i; ++k) {
        const FaultEvent& a = episode.faults[i];
        const FaultEvent& b = episode.faults[k];
        if (a.begin < b.end && b.begin < a.end) met.set(pair_index(a.kind, b.kind));
      }
    }
  }
  return met;
}

std::array<std::uint64_t, fault_kinds> FaultSchedule::counts() const {
  std::array<std::uint64_t, fault_kinds> counts{};
  for (const Episode& episode : episodes_) {
    for (const FaultEvent& fault : episode.faults) ++counts[static_cast<std::size_t>(fault.kind)];
  }
  return counts;
}

}  // namespace thermocomp::faults
