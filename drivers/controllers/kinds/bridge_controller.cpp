#include "drivers/controllers/kinds/bridge_controller.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// Only sets the gate's patience; the bridge determines the real period.
constexpr nanoseconds usual_period = std::chrono::milliseconds(50);

}  // namespace

BridgeController::BridgeController(const BridgeControllerConfig& config, Now now)
    : config_(config),
      silent_after_(from_seconds(config.silent_after_s)),
      now_(now),
      gate_(usual_period) {
  require(config.axes.size() <= axes_max, "axes", static_cast<double>(config.axes.size()),
          "a controller has at most 16 axes");
  require(config.signals.size() <= signals_max, "signals",
          static_cast<double>(config.signals.size()), "a controller has at most 48 signals");
  require(config.silent_after_s > 0.0 && std::isfinite(config.silent_after_s), "silent_after_s",
          config.silent_after_s, "must be finite and more than 0");
  health_.name = config_.name;
  health_.kind = "linuxcnc";
  health_.last_error =
      "no bridge has reported yet: LinuxCNC starts thermocomp-linuxcnc by its HAL file";
}

void BridgeController::newest(ControllerState& state) noexcept {
  states_.fresh();
  state = states_.front();
  if (!started_.load(std::memory_order_relaxed) || now_() - state.taken_at > silent_after_)
    state.online = false;
}

void BridgeController::offer(const OffsetCommand& command) noexcept {
  commands_.back() = {command, now_()};
  commands_.publish();
}

ControllerHealth BridgeController::health() const {
  const std::scoped_lock lock(health_mutex_);
  ControllerHealth health = health_;
  health.connected = session_ != 0 && !is_silent(now_());
  if (!health.connected && health.connects != 0 && health.last_error.empty())
    health.last_error = "the bridge does not report";
  return health;
}

std::optional<BridgeAnswer> BridgeController::report(const BridgeReport& report) {
  const nanoseconds now = now_();
  const std::scoped_lock lock(health_mutex_);
  const bool silent = session_ == 0 || is_silent(now);
  if (report.session != session_ && !silent) {
    ++health_.read_errors;
    health_.last_error = "two bridges report: the later one is refused";
    return std::nullopt;
  }
  ++health_.reads;
  health_.last_error.clear();
  if (report.session != session_) ++health_.connects;
  // An axis without a reported offset is not synchronised.
  const bool taking =
      report.taking &&
      std::all_of(report.applied_um.begin(),
                  report.applied_um.begin() + static_cast<std::ptrdiff_t>(config_.axes.size()),
                  [](double um) { return std::isfinite(um); });
  BridgeAnswer answer;
  if (commands_.fresh()) gate_.offered(commands_.front().command, commands_.front().computed_at);
  const bool moved = taking && taking_ && !gate_.check_read_back(report.applied_um);
  if (moved) health_.last_error = "the controller applies an offset that was not sent";
  if (silent || report.session != session_ || taking != taking_) gate_.lost();
  if (answered_ && taking && !silent && report.session == session_) {
    gate_.confirmed(now);
    health_.write.confirmed_at = now;
  }
  answered_ = false;
  if (moved || !gate_.in_sync()) begin_epoch(report, answer);
  session_ = report.session;
  taking_ = taking;
  publish(report, taking, now);
  answer.link_epoch = gate_.epoch();
  if (!taking) return answer;
  const SendVerdict verdict = gate_.verdict(now);
  if (verdict == SendVerdict::resynchronise) gate_.paused();
  if (verdict != SendVerdict::send) return answer;
  answer.offset_um = gate_.command().offset_um;
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis)
    answer.valid[axis] = gate_.command().valid[axis] && std::isfinite(answer.offset_um[axis]);
  gate_.sent(now);
  answered_ = true;
  ++health_.writes;
  return answer;
}

void BridgeController::begin_epoch(const BridgeReport& report, BridgeAnswer& answer) {
  const std::uint32_t before = gate_.epoch();
  answer.anew = !is_same_link(gate_.synchronised(report.applied_um), before);
}

void BridgeController::publish(const BridgeReport& report, bool taking, nanoseconds now) {
  state_.taken_at = now;
  state_.online = true;
  state_.written = gate_.written(now);
  state_.link_epoch = gate_.epoch();
  state_.read_back_number = gate_.read_back_number();
  state_.signals = report.signals;
  state_.applied_um = report.applied_um;
  if (!taking) state_.applied_um.fill(not_a_number);
  states_.back() = state_;
  states_.publish();
}

void BridgeController::refuse(const std::string& why) {
  const std::scoped_lock lock(health_mutex_);
  ++health_.read_errors;
  health_.last_error = why;
}

}  // namespace thermocomp
