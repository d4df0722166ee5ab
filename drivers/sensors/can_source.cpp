#include "drivers/sensors/can_source.hpp"

#include <algorithm>
#include <string>

#include "drivers/bus_thread.hpp"
#include "drivers/sensors/make_source.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// A device silent for longer is shown as not answering; screening limits its readings.
constexpr nanoseconds silent_after = std::chrono::seconds{5};
/// Longest interval between updates of the health.
constexpr nanoseconds look_every = std::chrono::seconds{1};
/// At 1 Mbit/s about 80 frames arrive in this time: one system call instead of as many.
constexpr nanoseconds gather = std::chrono::milliseconds{10};

CanId id_of(const CanSignal& signal) {
  return {signal.id, signal.extended_id};
}

bool is_group(const CanSignal& signal) {
  return signal.id_mask != CanSignal{}.id_mask;
}

std::vector<CanId> identifiers(const CanBusConfig& config) {
  std::vector<CanId> ids;
  for (const CanDeviceConfig& device : config.devices) {
    for (const CanChannel& channel : device.channels) {
      if (!is_group(channel.signal)) ids.push_back(id_of(channel.signal));
    }
  }
  return ids;
}

std::vector<UnitHealth> units_of(const CanBusConfig& config) {
  std::vector<UnitHealth> units;
  for (const CanDeviceConfig& device : config.devices) units.emplace_back().name = device.name;
  return units;
}

}  // namespace

CanSource::CanSource(const CanBusConfig& config) : CanSource(config, channels_of(config)) {}

CanSource::CanSource(const CanBusConfig& config, std::vector<Channel> channels)
    : CanInterfaceSource({config.name, config.outline().kind, config.interface, config.reconnect_s,
                          look_every, gather},
                         identifiers(config), sensors_of(channels), units_of(config)),
      channels_(std::move(channels)),
      readings_(channels_.size()),
      units_(units_of(config)),
      last_good_(config.devices.size()) {
  const auto groups = std::find_if(channels_.begin(), channels_.end(),
                                   [](const Channel& each) { return is_group(each.signal); });
  groups_begin_ = static_cast<std::size_t>(groups - channels_.begin());
  for (auto each = groups; each != channels_.end(); ++each) {
    socket().add_filter({each->id, each->signal.id_mask});
  }
}

CanSource::~CanSource() {
  stop();
}

std::vector<CanSource::Channel> CanSource::channels_of(const CanBusConfig& config) {
  std::vector<Channel> channels;
  for (std::size_t device = 0; device < config.devices.size(); ++device) {
    for (const CanChannel& channel : config.devices[device].channels) {
      check(channel.signal);
      if (channel.counter) check(*channel.counter, channel.signal.fd);
      channels.push_back(
          {id_of(channel.signal), channel.signal, channel.counter, device, channel.sensor});
    }
  }
  std::stable_sort(channels.begin(), channels.end(), [](const Channel& a, const Channel& b) {
    return std::pair(is_group(a.signal), a.id) < std::pair(is_group(b.signal), b.id);
  });
  return channels;
}

std::vector<std::size_t> CanSource::sensors_of(const std::vector<Channel>& channels) {
  std::vector<std::size_t> sensors;
  sensors.reserve(channels.size());
  for (const Channel& channel : channels) sensors.push_back(channel.sensor);
  return sensors;
}

void CanSource::bus_opened(nanoseconds now) {
  opened_at_ = now;
}

/// Marks every reading; those marked before keep the time of their loss.
void CanSource::bus_closed(nanoseconds now) {
  for (Reading& reading : readings_) {
    if (reading.fault != Fault::no_answer) reading = {not_a_number, now, Fault::no_answer};
  }
  for (Channel& channel : channels_) channel.count_of_frame = channel.count_of_page = std::nullopt;
}

void CanSource::work() {
  constexpr int batches_max = 16;  // so that readings are published even in a flood
  for (int batch = 0; batch < batches_max; ++batch) {
    const auto frames = socket().receive();
    for (const CanFrame& frame : frames) take(frame);
    if (frames.size() < CanSocket::batch_max) return;
  }
}

void CanSource::write_readings(std::vector<Reading>& readings) {
  readings = readings_;  // same size: no allocation
}

std::vector<UnitHealth> CanSource::units(nanoseconds now) {
  for (std::size_t i = 0; i < last_good_.size(); ++i) {
    units_[i].answering =
        usable() && last_good_[i] != nanoseconds{0} && now - last_good_[i] < silent_after;
  }
  for (const Channel& channel : channels_) {
    UnitHealth& unit = units_[channel.device];
    if (!usable() || unit.answers != 0 || !unit.last_error.empty()) continue;
    if (now - opened_at_ < silent_after) continue;
    unit.last_error = "no frame with identifier " + to_string(channel.id) + " received";
  }
  return units_;
}

/// Compares and stores the counter of a channel with this frame's identifier.
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
  return still ? Arrival::unchanged : Arrival::renewed;
}

void CanSource::note_arrival(Arrival arrival, UnitHealth& unit) {
  if (arrival == Arrival::bad_frame) {
    ++unit.bad_frames;
    unit.last_error = "frame too short";
  } else if (arrival == Arrival::unchanged) {
    unit.last_error = "the counter in the frame does not change";
  } else {
    ++unit.answers;
    unit.last_error.clear();
  }
}

/// Detects two senders of one group within a short time, whose values cannot be attributed.
/// @return the problem; empty: there is one sender
std::string CanSource::contest(const CanFrame& frame, Channel& channel) {
  const nanoseconds at = frame.received_at;
  if (channel.sender && *channel.sender != frame.id && at - channel.last_frame < silent_after) {
    channel.contested_until = at + silent_after;
    channel.rival = channel.sender;
  }
  channel.sender = frame.id;
  channel.last_frame = at;
  if (at >= channel.contested_until) return {};
  const auto [low, high] = std::minmax(*channel.rival, frame.id);
  return to_string(low) + " and " + to_string(high) +
         " send the same group: choose one by the sensor's key id";
}

void CanSource::take(const CanFrame& frame) {
  const auto groups = channels_.begin() + static_cast<std::ptrdiff_t>(groups_begin_);
  const auto [first, last] =
      std::equal_range(channels_.begin(), groups, Channel{frame.id, {}, {}, 0, 0},
                       [](const Channel& a, const Channel& b) { return a.id < b.id; });
  std::size_t counted = last_good_.size();  // each device once per frame
  for (auto channel = first; channel != last; ++channel) take(frame, *channel, counted);
  for (auto channel = groups; channel != channels_.end(); ++channel) {
    if (matches(frame.id, channel->signal)) take(frame, *channel, counted);
  }
}

void CanSource::take(const CanFrame& frame, Channel& channel, std::size_t& counted) {
  Arrival arrival = arrival_of(frame, channel);
  if (arrival == Arrival::other_page) return;
  UnitHealth& unit = units_[channel.device];
  if (is_group(channel.signal)) {
    if (std::string contested = contest(frame, channel); !contested.empty()) {
      readings_[static_cast<std::size_t>(&channel - channels_.data())] = {
          not_a_number, frame.received_at, Fault::device_error};
      unit.last_error = std::move(contested);
      last_good_[channel.device] = frame.received_at;
      return;
    }
  }
  if (arrival != Arrival::unchanged) {
    const CanValue decoded =
        arrival == Arrival::renewed ? decode(frame.payload(), channel.signal) : CanValue{};
    if (decoded.fault == Fault::bad_frame) arrival = Arrival::bad_frame;
    readings_[static_cast<std::size_t>(&channel - channels_.data())] = {
        decoded.value, frame.received_at, decoded.fault};
  }
  if (channel.device == counted) return;
  counted = channel.device;
  note_arrival(arrival, unit);
  if (arrival == Arrival::renewed) last_good_[channel.device] = frame.received_at;
}

std::unique_ptr<SensorSource> make_bus_source(const CanBusConfig& bus) {
  return std::make_unique<CanSource>(bus);
}

}  // namespace thermocomp
