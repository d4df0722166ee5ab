#include "drivers/controllers/can_controller.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "drivers/monotonic_clock.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

CanId id_of(const CanSignal& signal) {
  return {signal.id, signal.extended_id};
}

std::vector<const CanSignal*> sent_signals(const CanControllerConfig& config) {
  std::vector<const CanSignal*> signals;
  for (const CanAxis& axis : config.axes) signals.push_back(&axis.offset);
  if (config.valid_bits) signals.push_back(&*config.valid_bits);
  if (config.heartbeat) signals.push_back(&*config.heartbeat);
  return signals;
}

std::vector<const CanSignal*> received_signals(const CanControllerConfig& config) {
  std::vector<const CanSignal*> signals;
  for (const CanAxis& axis : config.axes) {
    if (axis.applied) signals.push_back(&*axis.applied);
  }
  for (const CanControllerSignal& signal : config.signals) signals.push_back(&signal.value);
  return signals;
}

std::vector<CanId> received_ids(const CanControllerConfig& config) {
  std::vector<CanId> ids;
  for (const CanSignal* signal : received_signals(config)) ids.push_back(id_of(*signal));
  return ids;
}

void check_signals(const CanControllerConfig& config) {
  std::map<CanId, CanBits> used;
  for (const CanSignal* signal : sent_signals(config)) {
    check(*signal);
    CanBits& bits = used[id_of(*signal)];
    require((bits & bits_of(*signal)).none(), "start_bit", signal->start_bit,
            "signals of a frame that is sent must not overlap");
    bits |= bits_of(*signal);
  }
  for (const CanSignal* signal : received_signals(config)) {
    check(*signal);
    require(!used.contains(id_of(*signal)), "id", signal->id,
            "a frame that is sent cannot be one the controller sends");
  }
}

void check_config(const CanControllerConfig& config) {
  require(config.period_s > 0.0 && std::isfinite(config.period_s), "period_s", config.period_s,
          "must be finite and more than 0");
  require(config.silent_after_s > 0.0, "silent_after_s", config.silent_after_s,
          "must be more than 0");
  require(config.axes.size() <= axes_max, "axes", static_cast<double>(config.axes.size()),
          "a controller has at most 16 axes");
  for (const CanControllerSignal& signal : config.signals) {
    require(signal.signal < signals_max, "signal", static_cast<double>(signal.signal),
            "a controller has at most 48 signals");
  }
  check_signals(config);
  if (config.valid_bits) {
    require(static_cast<std::size_t>(config.valid_bits->length_bits) >= config.axes.size() &&
                !config.valid_bits->is_float,
            "valid_bits", config.valid_bits->length_bits, "needs a bit for each axis");
  }
  if (config.heartbeat) {
    require(!config.heartbeat->is_float, "heartbeat", config.heartbeat->length_bits,
            "must be a whole number, not a float");
  }
}

std::vector<double> applied_resolution_um(const CanControllerConfig& config) {
  std::vector<double> steps_um;
  for (const CanAxis& axis : config.axes)
    steps_um.push_back(axis.applied ? std::abs(axis.applied->scale) : 0.0);
  return steps_um;
}

}  // namespace

CanController::CanController(CanControllerConfig config)
    : config_((check_config(config), std::move(config))),
      socket_(config_.interface, received_ids(config_)),
      gate_(from_seconds(config_.period_s), applied_resolution_um(config_)) {
  plan_outgoing();
  plan_incoming();
  held_um_.fill(not_a_number);
  health_.name = config_.name;
  health_.kind = "can";
  health_.state = to_string(socket_.state());
  health_.state_since = socket_.state_since();
}

CanController::~CanController() {
  stop();
}

CanController::Outgoing& CanController::outgoing(const CanSignal& signal) {
  const CanId id = id_of(signal);
  const auto known = std::find_if(outgoing_.begin(), outgoing_.end(),
                                  [&](const Outgoing& other) { return other.frame.id == id; });
  Outgoing& found = known != outgoing_.end() ? *known : outgoing_.emplace_back();
  found.frame.id = id;
  found.frame.size = std::max(found.frame.size, bytes_needed(signal));
  return found;
}

void CanController::plan_outgoing() {
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    outgoing(config_.axes[axis].offset).axes.push_back(axis);
  }
  if (config_.valid_bits) outgoing(*config_.valid_bits).has_valid_bits = true;
  if (config_.heartbeat) outgoing(*config_.heartbeat).has_heartbeat = true;
  // The controller shall have all offsets before it is told that they are good and fresh.
  std::stable_sort(outgoing_.begin(), outgoing_.end(), [](const Outgoing& a, const Outgoing& b) {
    return std::pair(a.has_heartbeat, a.has_valid_bits) <
           std::pair(b.has_heartbeat, b.has_valid_bits);
  });
}

void CanController::plan_incoming() {
  const auto add = [this](const CanSignal& signal, double* target) {
    const CanId id = id_of(signal);
    const auto known = std::find_if(incoming_.begin(), incoming_.end(),
                                    [&](const Incoming& other) { return other.id == id; });
    Incoming& found = known != incoming_.end() ? *known : incoming_.emplace_back();
    found.id = id;
    found.values.emplace_back(signal, target);
  };
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    const CanAxis& place = config_.axes[axis];
    if (place.applied) add(*place.applied, &state_.applied_um[axis]);
  }
  for (const CanControllerSignal& signal : config_.signals) {
    add(signal.value, &state_.signals[signal.signal]);
  }
}

void CanController::start() {
  if (const std::string reason = can_unavailable(); !reason.empty()) {
    throw DriverError(config_.name + ": this system has no CAN sockets: " + reason);
  }
  thread_.start(config_.name, [this] { run(); });
}

void CanController::stop() noexcept {
  stopping_.store(true);
  wake_.signal();
  thread_.join();
}

void CanController::newest(ControllerState& state) noexcept {
  states_.fresh();
  state = states_.front();
}

void CanController::offer(const OffsetCommand& command) noexcept {
  commands_.back() = command;
  commands_.publish();
}

ControllerHealth CanController::health() const {
  const std::scoped_lock lock(health_mutex_);
  return health_;
}

void CanController::run() {
  next_send_ = monotonic_now();
  while (!stopping_.load()) {
    if (!socket_.is_open()) {
      open_or_pause();
      continue;
    }
    wake_.wait_until(next_send_, socket_.descriptor());
    receive();
    const nanoseconds now = monotonic_now();
    supervise(now);
    note_bus_state();
    if (now < next_send_) continue;
    send_command(now);
    next_send_ = std::max(next_send_ + gate_.next_pause(), now);
  }
  const nanoseconds now = monotonic_now();
  if (socket_.is_open()) send_command(now);
  socket_.close();
}

void CanController::open_or_pause() {
  const bool opened = socket_.open();
  {
    const std::scoped_lock lock(health_mutex_);
    health_.last_error = socket_.error();
    if (opened) ++health_.connects;
  }
  note_bus_state();
  if (!opened) wake_.wait_until(monotonic_now() + from_seconds(config_.reconnect_s));
}

void CanController::receive() {
  const std::span<const CanFrame> frames = socket_.receive();
  for (const CanFrame& frame : frames) take(frame);
  if (frames.empty()) return;
  {
    const std::scoped_lock lock(health_mutex_);
    health_.reads += frames.size();
  }
  tell_error();
  if (!gate_.in_sync()) return;
  if (gate_.explains(state_.applied_um))
    publish(true, monotonic_now());
  else
    synchronise();  // re-homed or overridden: nothing computed before is sent any more
}

void CanController::take(const CanFrame& frame) {
  const auto found = std::find_if(incoming_.begin(), incoming_.end(),
                                  [&](const Incoming& other) { return other.id == frame.id; });
  if (found == incoming_.end()) return;
  bool whole = true;
  for (const auto& [signal, target] : found->values) {
    const CanValue decoded = decode(frame.payload(), signal);
    whole = whole && decoded.fault != Fault::bad_frame;
    *target = decoded.value;
  }
  if (whole) {
    found->received_at = frame.received_at;
    found->seen = true;
    return;
  }
  const std::scoped_lock lock(health_mutex_);
  ++health_.read_errors;
}

/// In sync or not, from what has arrived and how long ago. A bus-off counts even where it was over
/// before we looked: what waited to be sent then is lost.
void CanController::supervise(nanoseconds now) {
  const bool was_off = socket_.errors().bus_off != bus_offs_;
  bus_offs_ = socket_.errors().bus_off;
  if (!socket_.is_open() || socket_.bus_off() || was_off) {
    if (gate_.in_sync()) lose();
    for (Incoming& frame : incoming_) frame.seen = false;
    silent_ = false;
    return tell_error();
  }
  const nanoseconds limit = from_seconds(config_.silent_after_s);
  for (Incoming& frame : incoming_) {
    if (now - frame.received_at > limit) frame.seen = false;
  }
  const bool all_seen = std::all_of(incoming_.begin(), incoming_.end(),
                                    [](const Incoming& frame) { return frame.seen; });
  if (gate_.in_sync() && !all_seen) {
    lose();
    silent_ = true;
    tell_error();
  } else if (!gate_.in_sync() && all_seen) {
    synchronise();
  }
}

/// What the interface suffers from says more than that nothing came over it.
void CanController::tell_error() {
  const std::scoped_lock lock(health_mutex_);
  health_.last_error = socket_.error();
  if (silent_ && health_.last_error.empty()) health_.last_error = "the controller is silent";
}

void CanController::note_bus_state() {
  const std::scoped_lock lock(health_mutex_);
  if (health_.state_since == socket_.state_since()) return;
  health_.state = to_string(socket_.state());
  health_.state_since = socket_.state_since();
  health_.bus_offs = socket_.errors().bus_off;
}

void CanController::synchronise() {
  const std::uint32_t before = gate_.epoch();
  hold_what_is_applied(!is_same_link(gate_.synchronised(state_.applied_um), before));
  const nanoseconds now = monotonic_now();
  next_send_ = now + gate_.next_pause();
  publish(true, now);
  silent_ = false;
  tell_error();
  const std::scoped_lock lock(health_mutex_);
  health_.connected = true;
}

/// What a frame carries of an axis that is not driven. A read-back is what was sent last, nothing,
/// or between; any other is not to be sent back to where it came from, and then neither is known.
void CanController::hold_what_is_applied(bool link_is_new) {
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    const double applied_um = state_.applied_um[axis];
    double& held_um = held_um_[axis];
    if (!link_is_new && !std::isnan(held_um)) continue;
    const double slack_um =
        WriteGate::unexplained_um + 2.0 * std::abs(config_.axes[axis].offset.scale);
    const bool believed = std::isnan(held_um) || std::isnan(applied_um) ||
                          (applied_um >= std::min(0.0, held_um) - slack_um &&
                           applied_um <= std::max(0.0, held_um) + slack_um);
    held_um = believed ? applied_um : not_a_number;
  }
}

void CanController::send_command(nanoseconds now) {
  if (commands_.fresh()) gate_.offered(commands_.front(), now);
  const SendVerdict verdict = gate_.verdict(now);
  if (verdict == SendVerdict::resynchronise) return lose(true);
  // Without frames of the controller nothing else would renew the published time.
  if (incoming_.empty() && gate_.in_sync()) publish(true, now);
  if (verdict == SendVerdict::nothing_to_send) return;
  const OffsetCommand& command = gate_.command();
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    const double offset_um = command.offset_um[axis];
    if (command.valid[axis] && std::isfinite(offset_um)) held_um_[axis] = offset_um;
  }
  ++heartbeat_;
  const bool sent = std::all_of(outgoing_.begin(), outgoing_.end(),
                                [this](Outgoing& frame) { return compose_and_send(frame); });
  if (!sent) lose();
  if (sent) gate_.sent(now);
  const std::scoped_lock lock(health_mutex_);
  ++(sent ? health_.writes : health_.write_errors);
  if (!sent) health_.last_error = socket_.error();
}

bool CanController::compose_and_send(Outgoing& outgoing) {
  const std::span<std::uint8_t> data(outgoing.frame.data.data(), outgoing.frame.size);
  for (const std::size_t axis : outgoing.axes) {
    const bool known = !std::isnan(held_um_[axis]);
    if (!known && !outgoing.has_valid_bits) return true;  // held back, see the class
    encode(known ? held_um_[axis] : 0.0, data, config_.axes[axis].offset);
  }
  if (outgoing.has_valid_bits) {
    const OffsetCommand& command = gate_.command();
    std::uint64_t bits = 0;
    for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
      const bool valid = command.valid[axis] && std::isfinite(command.offset_um[axis]);
      bits |= std::uint64_t{valid ? 1u : 0u} << axis;
    }
    insert_raw(data, *config_.valid_bits, bits);
  }
  if (outgoing.has_heartbeat) insert_raw(data, *config_.heartbeat, heartbeat_);
  return socket_.send(outgoing.frame);
}

void CanController::publish(bool online, nanoseconds now) {
  state_.online = online;
  state_.link_epoch = gate_.epoch();
  state_.look = gate_.look();
  if (incoming_.empty()) {
    state_.taken_at = now;
  } else {
    state_.taken_at = std::min_element(incoming_.begin(), incoming_.end(),
                                       [](const Incoming& a, const Incoming& b) {
                                         return a.received_at < b.received_at;
                                       })
                          ->received_at;
  }
  states_.back() = state_;
  states_.publish();
}

/// Everything has to come anew before the next epoch.
void CanController::lose(bool same_link) {
  if (same_link)
    gate_.paused();
  else
    gate_.lost();
  for (Incoming& frame : incoming_) frame.seen = false;
  publish(false, monotonic_now());
  const std::scoped_lock lock(health_mutex_);
  health_.connected = false;
}

}  // namespace thermocomp
