// The texts of a node's health.
#include <algorithm>

#include "drivers/can/canopen/canopen_node.hpp"

namespace thermocomp {

/// "the node stays pre-operational in spite of NMT start", with its emergency if there is one.
std::string CanopenNode::state_text() const {
  constexpr std::uint8_t state_stopped = 0x04;
  std::string text = "the node ";
  text += left_ ? "was put into the state " : "stays in the state ";
  text += state_ == state_stopped ? "stopped" : "pre-operational";
  if (left_) {
    text += " by another master: its set-up is repeated when it is operational again";
  } else {
    text += starts_ ? " in spite of NMT start: see its manual for what it waits for"
                    : ": no master starts it (start_nodes = false)";
  }
  return emergency_text_.empty() ? text : text + "; " + emergency_text_;
}

std::string CanopenNode::trouble(nanoseconds now) const {
  if (!conflict_.empty()) return conflict_;
  if (heartbeats_.too_often() || second_answer_until_ != nanoseconds{0}) {
    return "two nodes answer as node " + std::to_string(config_.node);
  }
  for (const Watched& each : watched_) {
    if (!each.rate.too_often()) continue;
    return "COB-ID " + to_string(CanId{each.cob_id, false}) +
           " is received too often: two nodes send it, or pdo_period_s is wrong";
  }
  if (phase_ == Phase::closed) return {};
  if (lost_) return "no heartbeat";
  const auto missing = std::find_if(watched_.begin(), watched_.end(), [&](const Watched& each) {
    return phase_ == Phase::running && each.cob_id != 0 && now >= each.due_by;
  });
  const bool is_missing = missing != watched_.end();
  if (left_ || (is_missing && state_ && state_ != state_operational)) return state_text();
  if (!setup_error_.empty()) return setup_error_;
  if (!emergency_text_.empty()) return emergency_text_;
  if (!is_missing) return poll_error_;
  return "COB-ID " + to_string(CanId{missing->cob_id, false}) +
         " is not received, though the node is alive: a TPDO on change needs an event timer "
         "(object 1800 and following, sub 5) or pdo_on_change";
}

UnitHealth CanopenNode::health(nanoseconds now) const {
  UnitHealth health = counters_;
  health.answering =
      phase_ != Phase::closed && good_at_ != nanoseconds{0} && now - good_at_ < silent_after;
  health.last_error = trouble(now);
  return health;
}

}  // namespace thermocomp
