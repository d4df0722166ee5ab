#include "drivers/sensors/can_source.hpp"

#include <algorithm>

#include "drivers/monotonic_clock.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// A device that sends nothing for so long is shown as not answering (its readings have their own
/// limit, in the screening).
constexpr nanoseconds silent_after = std::chrono::seconds{5};
/// The health is brought up to date at least this often, frames or not.
constexpr nanoseconds look_every = std::chrono::seconds{1};
/// At 1 Mbit/s some 80 frames arrive meanwhile: one call to the kernel instead of as many.
constexpr nanoseconds gather = std::chrono::milliseconds{10};

CanId id_of(const CanSignal& signal) {
  return {signal.id, signal.extended_id};
}

std::vector<CanId> identifiers(const CanBusConfig& config) {
  std::vector<CanId> ids;
  for (const CanDeviceConfig& device : config.devices) {
    for (const CanChannel& channel : device.channels) ids.push_back(id_of(channel.signal));
  }
  return ids;
}

}  // namespace

CanSource::CanSource(CanBusConfig config)
    : config_(std::move(config)),
      socket_(config_.interface, identifiers(config_)),
      readings_(identifiers(config_).size()),
      last_good_(config_.devices.size()),
      slot_(readings_) {
  for (std::size_t device = 0; device < config_.devices.size(); ++device) {
    for (const CanChannel& channel : config_.devices[device].channels) {
      check(channel.signal);
      if (channel.counter) check(*channel.counter, channel.signal.fd);
      channels_.push_back(
          {id_of(channel.signal), channel.signal, channel.counter, device, channel.sensor});
    }
    health_.units.emplace_back().name = config_.devices[device].name;
  }
  std::stable_sort(channels_.begin(), channels_.end(),
                   [](const Channel& a, const Channel& b) { return a.id < b.id; });
  health_.name = config_.name;
  health_.kind = "can";
  health_.state = to_string(socket_.state());
  health_.state_since = socket_.state_since();
}

CanSource::~CanSource() {
  stop();
}

void CanSource::start() {
  if (const std::string reason = can_unavailable(); !reason.empty()) {
    throw DriverError(config_.name + ": this system has no CAN sockets: " + reason);
  }
  thread_.start(config_.name, [this] { run(); });
}

void CanSource::stop() noexcept {
  stopping_.store(true);
  wake_.signal();
  thread_.join();
}

void CanSource::newest(std::span<Reading> all) noexcept {
  slot_.fresh();
  const std::vector<Reading>& newest = slot_.front();
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    THERMOCOMP_ENSURE(channels_[i].sensor < all.size());
    all[channels_[i].sensor] = newest[i];
  }
}

BusHealth CanSource::health() const {
  const std::scoped_lock lock(health_mutex_);
  return health_;
}

void CanSource::run() {
  while (!stopping_.load()) {
    if (!socket_.is_open() && !open()) {
      wake_.wait_until(monotonic_now() + from_seconds(config_.reconnect_s));
      continue;
    }
    wake_.wait_until(monotonic_now() + look_every, socket_.descriptor());
    const bool was_bus_off = socket_.bus_off();
    receive();
    if (!socket_.is_open() || (socket_.bus_off() && !was_bus_off)) lose_all();
    note_health();
    wake_.wait_until(monotonic_now() + gather);
  }
  socket_.close();
}

void CanSource::receive() {
  std::span<const CanFrame> frames;
  do {
    frames = socket_.receive();
    take(frames);
  } while (frames.size() == CanSocket::batch_max && !stopping_.load());
}

bool CanSource::open() {
  const bool opened = socket_.open();
  if (opened) {
    const std::scoped_lock lock(health_mutex_);
    ++health_.connects;
  } else {
    lose_all();
  }
  note_health();
  return opened;
}

/// Marks every reading that is not marked yet; the time is that of the loss.
void CanSource::lose_all() {
  const nanoseconds now = monotonic_now();
  for (Reading& reading : readings_) {
    if (reading.fault != Fault::no_answer) reading = {not_a_number, now, Fault::no_answer};
  }
  for (Channel& channel : channels_) channel.count_of_frame = channel.count_of_page = std::nullopt;
  publish();
}

void CanSource::take(std::span<const CanFrame> frames) {
  if (frames.empty()) return;
  {
    const std::scoped_lock lock(health_mutex_);
    for (const CanFrame& frame : frames) take(frame);
  }
  publish();
}

/// Keeps the counter of a channel of this frame's identifier.
CanSource::Arrival CanSource::arrival_of(const CanFrame& frame, Channel& channel) noexcept {
  const bool on_page = carries(frame.payload(), channel.signal);
  if (!channel.counter) return on_page ? Arrival::renewed : Arrival::other_page;
  if (frame.size < bytes_needed(*channel.counter)) {
    return on_page ? Arrival::bad_frame : Arrival::other_page;
  }
  const std::uint64_t count = extract_raw(frame.payload(), *channel.counter);
  const bool still = channel.count_of_frame == count && channel.count_of_page == count;
  channel.count_of_frame = count;
  if (!on_page) return Arrival::other_page;
  channel.count_of_page = count;
  return still ? Arrival::stood_still : Arrival::renewed;
}

void CanSource::note_arrival(Arrival arrival, UnitHealth& unit) {
  if (arrival == Arrival::bad_frame) {
    ++unit.bad_frames;
    unit.last_error = "frame too short";
  } else if (arrival == Arrival::stood_still) {
    unit.last_error = "the counter in the frame stands still";
  } else {
    ++unit.answers;
    unit.last_error.clear();
  }
}

/// @pre health_mutex_ is held
void CanSource::take(const CanFrame& frame) {
  const auto [first, last] =
      std::equal_range(channels_.begin(), channels_.end(), Channel{frame.id, {}, {}, 0, 0},
                       [](const Channel& a, const Channel& b) { return a.id < b.id; });
  std::size_t counted = config_.devices.size();  // each device once a frame
  for (auto channel = first; channel != last; ++channel) {
    Arrival arrival = arrival_of(frame, *channel);
    if (arrival == Arrival::other_page) continue;
    if (arrival != Arrival::stood_still) {
      const CanValue decoded =
          arrival == Arrival::renewed ? decode(frame.payload(), channel->signal) : CanValue{};
      if (decoded.fault == Fault::bad_frame) arrival = Arrival::bad_frame;
      readings_[static_cast<std::size_t>(channel - channels_.begin())] = {
          decoded.value, frame.received_at, decoded.fault};
    }
    if (channel->device == counted) continue;
    counted = channel->device;
    note_arrival(arrival, health_.units[channel->device]);
    if (arrival == Arrival::renewed) last_good_[channel->device] = frame.received_at;
  }
}

void CanSource::publish() {
  slot_.back() = readings_;  // same size: copies, never allocates
  slot_.publish();
}

void CanSource::note_health() {
  const nanoseconds now = monotonic_now();
  const bool connected = socket_.is_open() && !socket_.bus_off();
  const std::scoped_lock lock(health_mutex_);
  health_.connected = connected;
  health_.last_error = socket_.error();
  health_.state = to_string(socket_.state());
  health_.state_since = socket_.state_since();
  health_.error_frames = socket_.errors().error_frames;
  health_.bus_offs = socket_.errors().bus_off;
  health_.restarts = socket_.errors().restarted;
  health_.dropped = socket_.errors().dropped;
  for (std::size_t i = 0; i < last_good_.size(); ++i) {
    health_.units[i].answering =
        connected && last_good_[i] != nanoseconds{0} && now - last_good_[i] < silent_after;
  }
}

}  // namespace thermocomp
