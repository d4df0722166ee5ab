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
      channels_.push_back({id_of(channel.signal), channel.signal, device, channel.sensor});
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
    take(socket_.receive());
    if (!socket_.is_open() || (socket_.bus_off() && !was_bus_off)) lose_all();
    note_health();
  }
  socket_.close();
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

/// @pre health_mutex_ is held
void CanSource::take(const CanFrame& frame) {
  const auto [first, last] =
      std::equal_range(channels_.begin(), channels_.end(), Channel{frame.id, {}, 0, 0},
                       [](const Channel& a, const Channel& b) { return a.id < b.id; });
  std::size_t counted = config_.devices.size();  // each device once a frame
  for (auto channel = first; channel != last; ++channel) {
    const CanValue decoded = decode(frame.payload(), channel->signal);
    readings_[static_cast<std::size_t>(channel - channels_.begin())] = {
        decoded.value, frame.received_at, decoded.fault};
    if (channel->device == counted) continue;
    counted = channel->device;
    UnitHealth& unit = health_.units[channel->device];
    if (decoded.fault == Fault::bad_frame) {
      ++unit.bad_frames;
      unit.last_error = "frame too short";
    } else {
      ++unit.answers;
      unit.last_error.clear();
      last_good_[channel->device] = frame.received_at;
    }
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
  health_.dropped = socket_.errors().dropped;
  for (std::size_t i = 0; i < last_good_.size(); ++i) {
    health_.units[i].answering =
        connected && last_good_[i] != nanoseconds{0} && now - last_good_[i] < silent_after;
  }
}

}  // namespace thermocomp
