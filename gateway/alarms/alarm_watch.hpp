/// Alarms, raised `raise_after_s` after a condition begins and cleared `clear_after_s` after it
/// ends. Pure; time is an argument.
#pragma once

#include <deque>
#include <map>
#include <string>
#include <vector>

#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

struct AlarmCondition {
  std::string name;  ///< "compensation", "sensor/bed_front", "suspected/bed_front", "bound/z",
                     ///< "domain", "bus/cabinet", "unit/bed", "frozen/bed", "daemon"
  std::string text;
  std::string remedy;  ///< empty: unknown
};

/// Conditions present in a snapshot. While the daemon is away: only that one.
[[nodiscard]] std::vector<AlarmCondition> active_conditions(const Snapshot& snapshot);

/// False while the daemon is away or starts: the state of a raised alarm is then unknown.
[[nodiscard]] bool is_judged(const Snapshot& snapshot);

struct Alarm {
  AlarmCondition condition;
  double since_s{0.0};  ///< on the clock of update()
};
struct AlarmChange {
  bool is_raised{false};
  Alarm alarm;
};

class AlarmWatch {
 public:
  AlarmWatch(double raise_after_s, double clear_after_s)
      : raise_after_s_(raise_after_s), clear_after_s_(clear_after_s) {}

  /// @param is_known  false: conditions that are not listed keep their state, except "daemon"
  /// @return alarms that this call raised or cleared
  std::vector<AlarmChange> update(double now_s, const std::vector<AlarmCondition>& wrong,
                                  bool is_known);
  [[nodiscard]] std::vector<Alarm> active() const;

 private:
  struct Place {
    Alarm alarm;
    bool is_wrong{false};
    bool is_raised{false};
    double turned_s{0.0};  ///< last change of is_wrong
  };
  double raise_after_s_;
  double clear_after_s_;
  std::map<std::string, Place> places_;  ///< by name; erased once neither wrong nor raised
};

/// Limits alarm commands to `per_hour_max` in any hour. Pure.
class HookLimit {
 public:
  explicit HookLimit(unsigned per_hour_max) : per_hour_max_(per_hour_max) {}
  /// Returns true, and counts the command, if it may start now.
  [[nodiscard]] bool take(double now_s) {
    constexpr double hour_s = 3600.0;
    while (!begun_s_.empty() && now_s - begun_s_.front() >= hour_s) begun_s_.pop_front();
    if (begun_s_.size() >= per_hour_max_) return false;
    begun_s_.push_back(now_s);
    return true;
  }

 private:
  unsigned per_hour_max_;
  std::deque<double> begun_s_;
};

}  // namespace thermocomp::gateway
