/// What the daemon said last, as every part of the gateway reads it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <nlohmann/json.hpp>

namespace thermocomp::gateway {

/// Never changed once it is handed on.
struct Snapshot {
  std::uint64_t number{0};  ///< rises by one each time
  double wall_s{0.0};       ///< when it was received
  bool is_here{false};      ///< the daemon answers
  double since_s{0.0};      ///< wall clock; since when it does, or does not
  std::string why;          ///< why it does not
  nlohmann::json status;  ///< results of the methods of these names; the last ones while it is away
  nlohmann::json sensors;
  std::shared_ptr<const nlohmann::json> model{std::make_shared<nlohmann::json>()};
  /// The newest of the list of `events`, oldest first.
  std::shared_ptr<const nlohmann::json> events{std::make_shared<nlohmann::json>()};
  nlohmann::json trends;  ///< {sensor: K/h}; null where not known yet
};
using SnapshotPointer = std::shared_ptr<const Snapshot>;

}  // namespace thermocomp::gateway
