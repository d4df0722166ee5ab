/// What is worth waking somebody for, with hysteresis: raised when it has been wrong for a while,
/// cleared when it has been right for a while. Pure; time is an argument.
#pragma once

#include <deque>
#include <map>
#include <string>
#include <vector>

#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// One thing that may be wrong now.
struct AlarmCondition {
  std::string name;    ///< "compensation", "sensor/bed_front", "suspected/bed_front", "bound/z",
                       ///< "domain", "bus/cabinet", "daemon"
  std::string text;    ///< what is wrong
  std::string remedy;  ///< what to do; empty: nothing that is known
};

/// What is wrong in a snapshot. While the daemon is away nothing is known of the rest.
[[nodiscard]] std::vector<AlarmCondition> wrong_now(const Snapshot& snapshot);

struct Alarm {
  AlarmCondition condition;
  double since_s{0.0};  ///< of the clock of update()
};
struct AlarmChange {
  bool is_raised{false};
  Alarm alarm;
};

class AlarmWatch {
 public:
  AlarmWatch(double raise_after_s, double clear_after_s)
      : raise_after_s_(raise_after_s), clear_after_s_(clear_after_s) {}

  /// @param is_known  false: only what is listed is known; the rest stays as it is
  /// @return what was raised or cleared by this
  std::vector<AlarmChange> update(double now_s, const std::vector<AlarmCondition>& wrong,
                                  bool is_known);
  [[nodiscard]] std::vector<Alarm> active() const;

 private:
  struct Place {
    Alarm alarm;
    bool is_wrong{false};
    bool is_raised{false};
    double turned_s{0.0};  ///< when is_wrong changed last
  };
  double raise_after_s_;
  double clear_after_s_;
  std::map<std::string, Place> places_;  ///< by name; those that are right and cleared are dropped
};

/// Not more than so many an hour, whatever happens. Pure.
class HookLimit {
 public:
  explicit HookLimit(unsigned per_hour_max) : per_hour_max_(per_hour_max) {}
  /// Whether one more may begin now; if so it is counted.
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
