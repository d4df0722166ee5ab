/// The daemon's last answers, shared by all parts of the gateway.
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

/// Immutable once published.
struct Snapshot {
  std::uint64_t number{0};  ///< increases by one per snapshot
  double wall_s{0.0};       ///< time of reception
  bool is_here{false};      ///< the daemon answers
  double since_s{0.0};      ///< wall clock of the last change of is_here
  std::string why;          ///< reason if it does not answer
  Status status;            ///< last answers of the methods of these names
  SensorsAnswer sensors;
  std::shared_ptr<const nlohmann::json> model{
      std::make_shared<nlohmann::json>()};  ///< null: unknown
  /// Newest events of the last week, from the history and the answer of `events`; oldest first.
  std::shared_ptr<const std::vector<Event>> events{std::make_shared<std::vector<Event>>()};
  std::map<std::string, double> trends;  ///< [K/h] by sensor; NaN: unknown
};
using SnapshotPointer = std::shared_ptr<const Snapshot>;

/// Rate of change of each temperature: slope of the regression line over the last 15 min.
class TrendWatch {
 public:
  static constexpr double sample_every_s = 10.0;
  static constexpr double window_s = 900.0;
  static constexpr double known_after_s = 60.0;

  /// @param now_s  monotonic; NaN values are ignored
  void add(const std::string& name, double now_s, double value);
  /// Least-squares slope over the window, per hour; NaN with less than a minute of samples.
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
