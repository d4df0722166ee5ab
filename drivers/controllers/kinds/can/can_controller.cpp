#include "drivers/controllers/kinds/can/can_controller.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "drivers/bus_thread.hpp"
#include "drivers/can/signal_codec.hpp"
#include "drivers/controllers/travel_values.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

std::vector<const CanSignal*> signals_of(const CanSet& set) {
  std::vector<const CanSignal*> signals;
  for (const CanSignal& value : set.values) signals.push_back(&value);
  for (const CanSignal& number : set.numbers) signals.push_back(&number);
  return signals;
}

std::vector<const CanSignal*> sent_signals(const CanAxis& axis) {
  if (axis.travel) return signals_of(axis.travel->sent);
  return {&axis.offset};
}

std::vector<const CanSignal*> shown_signals(const CanAxis& axis) {
  if (axis.travel) return signals_of(axis.travel->applied);
  if (axis.applied) return {&*axis.applied};
  return {};
}

std::vector<const CanSignal*> sent_signals(const CanControllerConfig& config) {
  std::vector<const CanSignal*> signals;
  for (const CanAxis& axis : config.axes)
    for (const CanSignal* signal : sent_signals(axis)) signals.push_back(signal);
  if (config.valid_bits) signals.push_back(&*config.valid_bits);
  if (config.heartbeat) signals.push_back(&*config.heartbeat);
  return signals;
}

std::vector<const CanSignal*> received_signals(const CanControllerConfig& config) {
  std::vector<const CanSignal*> signals;
  for (const CanAxis& axis : config.axes)
    for (const CanSignal* signal : shown_signals(axis)) signals.push_back(signal);
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

void check_travels(const CanControllerConfig& config) {
  for (const CanAxis& axis : config.axes) {
    if (!axis.travel) continue;
    check_travel(*axis.travel);
    if (!axis.reads_back()) continue;
    std::map<CanId, CanBits> shown;
    for (const CanSignal* signal : signals_of(axis.travel->applied)) {
      CanBits& bits = shown[id_of(*signal)];
      require((bits & bits_of(*signal)).none(), "start_bit", signal->start_bit,
              "signals of a set must not overlap");
      bits |= bits_of(*signal);
    }
    const double round_s = static_cast<double>(set_numbers(axis.travel->sent)) * config.period_s;
    require(round_s > config.silent_after_s, "silent_after_s", config.silent_after_s,
            "must be less than the time in which the set numbers repeat");
  }
}

void check_config(const CanControllerConfig& config) {
  require(config.period_s > 0.0 && std::isfinite(config.period_s), "period_s", config.period_s,
          "must be finite and more than 0");
  require(config.silent_after_s > 0.0, "silent_after_s", config.silent_after_s,
          "must be more than 0");
  require(config.offsets() <= axes_max, "axes", static_cast<double>(config.offsets()),
          "a controller has at most 16 axes, nodes of travels counted");
  for (const CanControllerSignal& signal : config.signals) {
    require(signal.signal < signals_max, "signal", static_cast<double>(signal.signal),
            "a controller has at most 48 signals");
  }
  check_travels(config);
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
  for (const CanAxis& axis : config.axes) {
    for (std::size_t node = 0; node < axis.offsets(); ++node) {
      if (axis.travel)
        steps_um.push_back(resolution_um(*axis.travel, axis.travel->applied, node));
      else
        steps_um.push_back(axis.applied ? std::abs(axis.applied->scale) : 0.0);
    }
  }
  return steps_um;
}

double sent_resolution_um(const CanAxis& axis, std::size_t node) {
  if (axis.travel) return resolution_um(*axis.travel, axis.travel->sent, node);
  return std::abs(axis.offset.scale);
}

}  // namespace

CanController::CanController(CanControllerConfig config)
    : config_((check_config(config), std::move(config))),
      socket_(config_.interface, received_ids(config_)),
      gate_(from_seconds(config_.period_s), applied_resolution_um(config_)) {
  std::size_t offsets = 0;
  for (const CanAxis& axis : config_.axes) {
    first_.push_back(offsets);
    offsets += axis.offsets();
  }
  set_numbers_.assign(config_.axes.size(), 0);
  plan_outgoing();
  plan_incoming();
  std::vector<CanId> own;
  for (const Outgoing& frame : outgoing_) own.push_back(frame.frame.id);
  socket_.watch_own(own);
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

CanController::Incoming& CanController::incoming(const CanSignal& signal, const std::string& what) {
  const CanId id = id_of(signal);
  const auto known = std::find_if(incoming_.begin(), incoming_.end(),
                                  [&](const Incoming& other) { return other.id == id; });
  Incoming& found = known != incoming_.end() ? *known : incoming_.emplace_back();
  found.id = id;
  if (!found.what.ends_with(what)) found.what += (found.what.empty() ? "" : ", ") + what;
  return found;
}

void CanController::plan_outgoing() {
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    for (const CanSignal* signal : sent_signals(config_.axes[axis])) {
      std::vector<std::size_t>& axes = outgoing(*signal).axes;
      if (axes.empty() || axes.back() != axis) axes.push_back(axis);
    }
  }
  if (config_.valid_bits) outgoing(*config_.valid_bits).has_valid_bits = true;
  if (config_.heartbeat) outgoing(*config_.heartbeat).has_heartbeat = true;
  // All offsets come before the frame that declares them valid and fresh.
  std::stable_sort(outgoing_.begin(), outgoing_.end(), [](const Outgoing& a, const Outgoing& b) {
    return std::pair(a.has_heartbeat, a.has_valid_bits) <
           std::pair(b.has_heartbeat, b.has_valid_bits);
  });
}

void CanController::plan_incoming() {
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    const CanAxis& place = config_.axes[axis];
    const std::string what = "applied of axis " + place.name;
    if (place.travel && place.reads_back()) {
      for (const CanSignal* signal : shown_signals(place)) incoming(*signal, what);
      shown_sets_.push_back({{}, axis, CanSetReader(place.travel->applied)});
    } else if (place.applied) {
      incoming(*place.applied, what)
          .values.emplace_back(*place.applied, &state_.applied_um[first_[axis]]);
    }
  }
  for (const CanControllerSignal& signal : config_.signals)
    incoming(signal.value, signal.name)
        .values.emplace_back(signal.value, &state_.signals[signal.signal]);
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
  commands_.back() = {command, monotonic_now()};
  commands_.publish();
}

ControllerHealth CanController::health() const {
  const std::scoped_lock lock(health_mutex_);
  return health_;
}

void CanController::run() {
  next_send_ = monotonic_now();
  const bool sends_sets = std::any_of(config_.axes.begin(), config_.axes.end(),
                                      [](const CanAxis& axis) { return axis.travel.has_value(); });
  if (sends_sets)
    no_sending_before_ = next_send_ + from_seconds(CanTravel::forgotten_after_s(config_.period_s));
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
  handed_ = written_ = 0;
  opened_at_ = monotonic_now();
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
  note_written(monotonic_now());
  if (frames.empty()) return;
  {
    const std::scoped_lock lock(health_mutex_);
    health_.reads += frames.size();
  }
  report_error();
  if (!gate_.in_sync()) return;
  if (gate_.check_read_back(state_.applied_um))
    publish(true, monotonic_now());
  else
    synchronise();  // re-homed or overridden: earlier commands are no longer valid
}

/// Confirms the write once all queued frames are on the bus.
void CanController::note_written(nanoseconds now) {
  if (handed_ == written_ || socket_.sent_out() < handed_) return;
  written_ = handed_;
  gate_.confirmed(now);
  if (gate_.in_sync()) publish(true, now);
  const std::scoped_lock lock(health_mutex_);
  health_.write.confirmed_at = now;
  health_.write.error.clear();
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
  whole = take_sets(frame) && whole;
  found->is_short = !whole;
  found->short_bytes = frame.size;
  if (whole) {
    found->received_at = frame.received_at;
    found->seen = true;
    return;
  }
  const std::scoped_lock lock(health_mutex_);
  ++health_.read_errors;
}

/// @return false if the frame is too short for the set
bool CanController::take_sets(const CanFrame& frame) {
  bool whole = true;
  for (ShownSet& shown : shown_sets_) {
    const CanSetReader::Taken taken = shown.reader.take(frame);
    whole = whole && taken != CanSetReader::Taken::too_short;
    if (taken != CanSetReader::Taken::whole) continue;
    shown.received_at = shown.reader.received_at();
    shown.seen = true;
    const CanTravel& travel = *config_.axes[shown.axis].travel;
    offsets_shown(travel, shown.reader.values(),
                  std::span(state_.applied_um).subspan(first_[shown.axis], travel.nodes_mm.size()));
  }
  return whole;
}

bool CanController::all_frames_seen() const noexcept {
  return std::all_of(incoming_.begin(), incoming_.end(),
                     [](const Awaited& frame) { return frame.seen; });
}

bool CanController::all_sets_seen() const noexcept {
  return std::all_of(shown_sets_.begin(), shown_sets_.end(),
                     [](const Awaited& set) { return set.seen; });
}

void CanController::await_all() noexcept {
  for (Incoming& frame : incoming_) frame.seen = false;
  for (ShownSet& set : shown_sets_) {
    set.seen = false;
    set.reader.forget();
  }
}

void CanController::await_what_is_older(nanoseconds than) noexcept {
  for (Incoming& frame : incoming_) frame.seen = frame.seen && frame.received_at >= than;
  for (ShownSet& set : shown_sets_) {
    set.seen = set.seen && set.received_at >= than;
    set.reader.forget_before(than);
  }
}

/// Enters or leaves synchronisation by the age of the received frames. A bus-off counts even after
/// its end: the frames queued at that time are lost.
void CanController::supervise(nanoseconds now) {
  const bool was_off = socket_.errors().bus_off != bus_offs_;
  bus_offs_ = socket_.errors().bus_off;
  if (!socket_.is_open() || socket_.bus_off() || was_off) {
    if (gate_.in_sync()) lose();
    await_all();
    silent_ = false;
    return report_error();
  }
  await_what_is_older(now - from_seconds(config_.silent_after_s));
  const bool all_seen = all_frames_seen() && all_sets_seen();
  if (!all_seen && (gate_.in_sync() || now - opened_at_ > from_seconds(config_.silent_after_s))) {
    if (gate_.in_sync()) lose();
    silent_ = true;
    report_error();
  } else if (!gate_.in_sync() && all_seen && now >= no_sending_before_) {
    synchronise();
  }
}

/// The interface's error takes precedence over missing frames.
void CanController::report_error() {
  const std::scoped_lock lock(health_mutex_);
  health_.last_error = socket_.error();
  if (health_.last_error.empty()) health_.last_error = health_.write.error;
  if (!health_.last_error.empty() || gate_.in_sync()) return;
  if (all_frames_seen() && !all_sets_seen())
    health_.last_error = "the read-back frames along a travel belong to two sets";
  else if (silent_)
    health_.last_error = missing_text(monotonic_now());
}

/// Names the frames that are missing or too short, with their values.
std::string CanController::missing_text(nanoseconds now) const {
  std::string text;
  bool is_silent = true;
  for (const Incoming& frame : incoming_) {
    const bool is_missing = now - frame.received_at > from_seconds(config_.silent_after_s);
    is_silent = is_silent && is_missing && !frame.is_short;
    if (!is_missing) continue;
    text += (text.empty() ? "frame " : "; frame ") + to_string(frame.id) + " (" + frame.what + ")";
    text += frame.is_short ? " has too few bytes: " + std::to_string(frame.short_bytes)
                           : " is not received";
  }
  return is_silent ? "the controller is silent" : text;
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
  hold_applied(!is_same_link(gate_.synchronised(state_.applied_um), before));
  number_sets();
  const nanoseconds now = monotonic_now();
  next_send_ = now + gate_.next_pause();
  publish(true, now);
  silent_ = false;
  report_error();
  const std::scoped_lock lock(health_mutex_);
  health_.connected = true;
}

/// Sets the value sent for an axis that is not driven. A plausible read-back is the offset sent
/// last, 0, or a value between; any other must not be sent back, and then the value is unknown.
void CanController::hold_applied(bool link_is_new) {
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    for (std::size_t node = 0; node < config_.axes[axis].offsets(); ++node) {
      const double applied_um = state_.applied_um[first_[axis] + node];
      double& held_um = held_um_[first_[axis] + node];
      if (!link_is_new && !std::isnan(held_um)) continue;
      const double slack_um =
          WriteGate::unexplained_um + 2.0 * sent_resolution_um(config_.axes[axis], node);
      const bool is_plausible = std::isnan(held_um) || std::isnan(applied_um) ||
                                (applied_um >= std::min(0.0, held_um) - slack_um &&
                                 applied_um <= std::max(0.0, held_um) + slack_um);
      held_um = is_plausible ? applied_um : not_a_number;
    }
  }
}

/// Renumbers the sets, since the held content may have changed.
void CanController::number_sets() {
  if (!numbered_) {
    const auto periods =
        static_cast<std::uint64_t>(monotonic_now() / from_seconds(config_.period_s));
    std::fill(set_numbers_.begin(), set_numbers_.end(), periods);
    for (const ShownSet& shown : shown_sets_)
      set_numbers_[shown.axis] =
          shown.reader.number() + set_numbers(config_.axes[shown.axis].travel->sent) / 2;
  }
  numbered_ = true;
  for (std::uint64_t& number : set_numbers_) ++number;
}

bool CanController::is_driven(std::size_t axis) const noexcept {
  const OffsetCommand& command = gate_.command();
  for (std::size_t i = first_[axis]; i < first_[axis] + config_.axes[axis].offsets(); ++i)
    if (!command.valid[i] || !std::isfinite(command.offset_um[i])) return false;
  return true;
}

std::span<double> CanController::held_um(std::size_t axis) noexcept {
  return std::span(held_um_).subspan(first_[axis], config_.axes[axis].offsets());
}

void CanController::send_command(nanoseconds now) {
  if (commands_.fresh()) gate_.offered(commands_.front().command, commands_.front().computed_at);
  const SendVerdict verdict = gate_.verdict(now);
  if (verdict == SendVerdict::resynchronise) return lose(true);
  // Without received frames, nothing else renews the published time.
  if (incoming_.empty() && gate_.in_sync()) publish(true, now);
  if (verdict == SendVerdict::nothing_to_send) return;
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    if (!is_driven(axis)) continue;
    std::copy_n(gate_.command().offset_um.begin() + static_cast<std::ptrdiff_t>(first_[axis]),
                config_.axes[axis].offsets(), held_um(axis).begin());
    ++set_numbers_[axis];
  }
  ++heartbeat_;
  const bool waits = handed_ > socket_.sent_out() && !gate_.written(now);
  // Frames of an emptied queue are never sent: not awaited.
  if (waits) handed_ = written_ = socket_.sent_out();
  const bool sent = std::all_of(outgoing_.begin(), outgoing_.end(),
                                [this](Outgoing& frame) { return compose_and_send(frame); });
  if (!sent) lose(false, socket_.is_open());
  if (sent) gate_.sent(now);
  const std::scoped_lock lock(health_mutex_);
  ++(sent ? health_.writes : health_.write_errors);
  if (sent && !waits) return;
  ++health_.write.unanswered;
  health_.write.error =
      sent ? config_.interface + ": frames cannot be sent: no other node acknowledges them"
           : socket_.error();
  health_.last_error = health_.write.error;
}

/// True if the frame carries only sets that must not be followed: a controller that uses the valid
/// bits of the previous period would otherwise take the held values.
bool CanController::may_be_left_out(const Outgoing& outgoing) const noexcept {
  if (outgoing.has_valid_bits || outgoing.has_heartbeat) return false;
  return std::none_of(outgoing.axes.begin(), outgoing.axes.end(), [this](std::size_t axis) {
    return !config_.axes[axis].travel || is_driven(axis);
  });
}

bool CanController::compose_and_send(Outgoing& outgoing) {
  if (may_be_left_out(outgoing)) return true;
  const std::span<std::uint8_t> data(outgoing.frame.data.data(), outgoing.frame.size);
  for (const std::size_t axis : outgoing.axes) {
    const std::span<const double> held = held_um(axis);
    const bool known =
        std::none_of(held.begin(), held.end(), [](double each) { return std::isnan(each); });
    if (!known && !outgoing.has_valid_bits) return true;  // not sent, see the class
    const std::vector<double> offset_um =
        known ? std::vector<double>(held.begin(), held.end()) : std::vector(held.size(), 0.0);
    if (const auto& travel = config_.axes[axis].travel)
      put_set(travel->sent, travel_values(*travel, travel->sent.values.size(), offset_um),
              set_numbers_[axis], outgoing.frame);
    else
      encode(offset_um.front(), data, config_.axes[axis].offset);
  }
  if (outgoing.has_valid_bits) {
    std::uint64_t bits = 0;
    for (std::size_t axis = 0; axis < config_.axes.size(); ++axis)
      bits |= std::uint64_t{is_driven(axis) ? 1u : 0u} << axis;
    insert_raw(data, *config_.valid_bits, bits);
  }
  if (outgoing.has_heartbeat) insert_raw(data, *config_.heartbeat, heartbeat_);
  if (!socket_.send(outgoing.frame)) return false;
  ++handed_;
  return true;
}

void CanController::publish(bool online, nanoseconds now) {
  state_.online = online;
  state_.written = gate_.written(now);
  state_.link_epoch = gate_.epoch();
  state_.read_back_number = gate_.read_back_number();
  state_.taken_at = now;
  for (const Incoming& frame : incoming_)
    state_.taken_at = std::min(state_.taken_at, frame.received_at);
  for (const ShownSet& set : shown_sets_)
    state_.taken_at = std::min(state_.taken_at, set.received_at);
  states_.back() = state_;
  states_.publish();
}

/// All frames must be received again before the next epoch.
void CanController::lose(bool same_link, bool online) {
  if (same_link)
    gate_.paused();
  else
    gate_.lost();
  await_all();
  publish(online, monotonic_now());
  const std::scoped_lock lock(health_mutex_);
  health_.connected = online;
}

}  // namespace thermocomp
