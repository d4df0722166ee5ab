/// What the daemon said last, as every part of the gateway reads it.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "status/status.hpp"

namespace thermocomp::gateway {

/// Never changed once it is handed on.
struct Snapshot {
  std::uint64_t number{0};  ///< rises by one each time
  double wall_s{0.0};       ///< when it was received
  bool is_here{false};      ///< the daemon answers
  double since_s{0.0};      ///< wall clock; since when it does, or does not
  std::string why;          ///< why it does not
  Status status;  ///< answers of the methods of these names; the last ones while it is away
  SensorsAnswer sensors;
  std::shared_ptr<const nlohmann::json> model{
      std::make_shared<nlohmann::json>()};  ///< null: not known yet
  /// The newest of the last week, by the history, and of the answer of `events`; oldest first.
  std::shared_ptr<const std::vector<Event>> events{std::make_shared<std::vector<Event>>()};
  std::map<std::string, double> trends;  ///< [K/h] by sensor; NaN where not known yet
};
using SnapshotPointer = std::shared_ptr<const Snapshot>;

/// How fast each temperature changes, by the straight line through its last minutes.
class TrendWatch {
 public:
  static constexpr double sample_every_s = 10.0;
  static constexpr double window_s = 900.0;
  static constexpr double known_after_s = 60.0;

  /// @param now_s  of a clock that does not go back; NaN values are passed over
  void add(const std::string& name, double now_s, double value);
  /// Least squares over the window, per hour; NaN while less than a minute is known.
  [[nodiscard]] double per_hour(const std::string& name) const;
  void forget() { samples_.clear(); }

 private:
  struct Sample {
    double at_s;
    double value;
  };
  std::map<std::string, std::deque<Sample>> samples_;
};

}  // namespace thermocomp::gateway
