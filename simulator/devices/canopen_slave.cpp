#include "simulator/devices/canopen_slave.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "drivers/bus_thread.hpp"
#include "drivers/can/signal_codec.hpp"

namespace thermocomp {
namespace {

using namespace std::chrono_literals;

constexpr std::uint8_t state_stopped = 0x04;
constexpr std::uint8_t state_operational = 0x05;
constexpr std::uint8_t state_pre_operational = 0x7F;
constexpr std::uint32_t object_does_not_exist = 0x06020000;
constexpr std::uint32_t general_error = 0x08000000;
constexpr std::uint16_t sensor_error = 0x5030;
constexpr std::uint8_t broken = 0x01;
constexpr std::uint8_t shorted = 0x02;
constexpr nanoseconds emergency_again = 1s;  // repetition of a JUMO CANtrans
constexpr std::string_view device_name = "thermocomp-sim CANopen node";

std::vector<std::uint8_t> number(std::uint64_t value, std::size_t bytes) {
  std::vector<std::uint8_t> result(bytes);
  put_little_endian(result, 0, bytes, value);
  return result;
}

/// Place of a channel without a preset.
CanopenChannel default_place(std::size_t channel) {
  CanopenChannel place;
  place.way = CanopenWay::pdo_object;
  place.object = {0x7130, static_cast<std::uint8_t>(channel)};
  place.signal.scale = 0.1;
  place.emergency_channel = static_cast<int>(channel);
  return place;
}

std::pair<std::uint16_t, std::uint8_t> key(const ObjectAddress& object) {
  return {object.index, object.sub};
}

bool is_broken(std::optional<ChannelFault> fault) {
  return fault == ChannelFault::open_circuit || fault == ChannelFault::short_circuit;
}

}  // namespace

CanopenSlave::CanopenSlave(const SimulatedCanopenNode& config, nanoseconds now)
    : config_(config), switched_on_(now), now_(now) {
  for (const CanopenNodeChannel& channel : config_.channels) {
    places_.push_back(channel.place.value_or(default_place(places_.size() + 1)));
  }
  boot(now);
}

void CanopenSlave::boot(nanoseconds now) {
  frames_.clear();
  segments_.clear();
  objects_.clear();
  objects_[{0x1000, 0}] = number(0x00020194, 4);  // device profile 404
  objects_[{0x1001, 0}] = number(0, 1);
  objects_[{0x1008, 0}] = {device_name.begin(), device_name.end()};
  const long heartbeat_ms = std::lround(config_.heartbeat_s * 1e3);
  objects_[{0x1017, 0}] = number(static_cast<std::uint64_t>(heartbeat_ms), 2);
  objects_[{0x1800, 1}] = number(config_.cob_id, 4);
  std::uint8_t mapped = 0;
  for (const CanopenChannel& place : places_) {
    const auto [index, sub] = place.object;
    const auto bits = static_cast<std::uint32_t>(place.signal.length_bits);
    if (place.status) {
      const auto status_bits = static_cast<std::size_t>(place.status->number.field.length_bits);
      objects_[key(place.status->object)] = number(0, (status_bits + 7) / 8);
    }
    if (place.way == CanopenWay::pdo_bits) continue;
    objects_[{index, sub}] = number(0, (bits + 7) / 8);
    objects_[{0x6110, sub}] = number(0, 2);
    if (place.way == CanopenWay::sdo) continue;
    objects_[{0x1A00, ++mapped}] =
        number((std::uint64_t{index} << 16) | (std::uint64_t{sub} << 8u) | bits, 4);
  }
  objects_[{0x1A00, 0}] = number(mapped, 1);
  emergencies_.assign(places_.size(), 0);
  state_ = state_pre_operational;
  pdo_at_ = heartbeat_at_ = emergency_at_ = now;
  put(0x700, number(0, 1));
}

void CanopenSlave::put(std::uint32_t function, std::span<const std::uint8_t> data) {
  send(function + static_cast<std::uint32_t>(config_.node), data);
}

void CanopenSlave::send(std::uint32_t id, std::span<const std::uint8_t> data) {
  CanFrame frame;
  frame.id = {id, false};
  frame.size = data.size();
  std::copy(data.begin(), data.end(), frame.data.begin());
  frames_.push_back(frame);
}

const NodeEvent* CanopenSlave::fault_of(std::size_t channel) const {
  const auto found =
      std::find_if(config_.events.begin(), config_.events.end(), [&](const NodeEvent& event) {
        return channel_fault(event.kind) && event.channel == channel && is_now(event);
      });
  return found == config_.events.end() ? nullptr : &*found;
}

bool CanopenSlave::is_now(const NodeEvent& event) const {
  const double time_s = std::chrono::duration<double>(now_ - switched_on_).count();
  return time_s >= event.at_s && time_s < event.at_s + event.duration_s;
}

bool CanopenSlave::happens(NodeEventKind kind) const {
  return std::any_of(config_.events.begin(), config_.events.end(),
                     [&](const NodeEvent& event) { return event.kind == kind && is_now(event); });
}

void CanopenSlave::take(const CanFrame& frame, nanoseconds now) {
  now_ = now;
  if (frame.id.extended || happens(NodeEventKind::silence)) return;
  const auto data = frame.payload();
  if (frame.id.id == 0 && data.size() == 2 && (data[1] == 0 || data[1] == config_.node)) {
    take_command(data[0], now);
  } else if (frame.id.id == 0x080) {
    synced_ = true;
  } else if (frame.id.id == 0x600 + static_cast<std::uint32_t>(config_.node) && data.size() == 8 &&
             state_ != state_stopped) {
    take_request(data);
  }
}

void CanopenSlave::take_command(std::uint8_t command, nanoseconds now) {
  switch (command) {
    case 0x01:
      state_ = state_operational;
      break;
    case 0x02:
      state_ = state_stopped;
      break;
    case 0x80:
      state_ = state_pre_operational;
      break;
    case 0x81:
    case 0x82:
      boot(now);
      break;
    default:
      break;
  }
}

void CanopenSlave::take_request(std::span<const std::uint8_t> data) {
  const ObjectAddress object{static_cast<std::uint16_t>(little_endian(data, 1, 2)), data[3]};
  const unsigned specifier = data[0] & 0xE0u;
  if (specifier == 0x80) {
    segments_.clear();
  } else if (happens(NodeEventKind::sdo_abort)) {
    abort(object, general_error);
  } else if (specifier == 0x40) {
    answer_read(object);
  } else if (specifier == 0x20) {
    answer_write(object, data);
  } else if (specifier == 0x60) {
    answer_segment((data[0] & 0x10u) != 0);
  }
}

void CanopenSlave::answer(std::uint8_t command, ObjectAddress object, std::uint64_t data) {
  std::vector<std::uint8_t> frame(8);
  frame[0] = command;
  put_little_endian(frame, 1, 2, object.index);
  frame[3] = object.sub;
  put_little_endian(frame, 4, 4, data);
  put(0x580, frame);
}

void CanopenSlave::abort(ObjectAddress object, std::uint32_t code) {
  answer(0x80, object, code);
}

void CanopenSlave::answer_read(ObjectAddress object) {
  const auto found = objects_.find({object.index, object.sub});
  if (found == objects_.end()) return abort(object, object_does_not_exist);
  const std::vector<std::uint8_t>& value = found->second;
  if (value.size() > 4) {
    segments_ = value;
    return answer(0x41, object, value.size());
  }
  answer(static_cast<std::uint8_t>(0x43u | ((4 - value.size()) << 2)), object,
         little_endian(value, 0, 4));
}

void CanopenSlave::answer_write(ObjectAddress object, std::span<const std::uint8_t> data) {
  const auto found = objects_.find({object.index, object.sub});
  if (found == objects_.end()) return abort(object, object_does_not_exist);
  if ((data[0] & 0x02u) == 0) return abort(object, 0x06010000);  // only expedited transfers
  const std::size_t size = (data[0] & 0x01u) != 0 ? 4u - ((data[0] >> 2) & 3u) : 4u;
  if (size != found->second.size()) return abort(object, 0x06070010);
  found->second.assign(data.begin() + 4, data.begin() + 4 + static_cast<std::ptrdiff_t>(size));
  answer(0x60, object, 0);
}

void CanopenSlave::answer_segment(bool toggle) {
  const std::size_t count = std::min<std::size_t>(7, segments_.size());
  std::vector<std::uint8_t> frame(8);
  const bool last = count == segments_.size();
  frame[0] = static_cast<std::uint8_t>((toggle ? 0x10u : 0u) | ((7 - count) << 1) | (last ? 1 : 0));
  std::copy_n(segments_.begin(), count, frame.begin() + 1);
  segments_.erase(segments_.begin(), segments_.begin() + static_cast<std::ptrdiff_t>(count));
  put(0x580, frame);
}

std::uint64_t CanopenSlave::number_at(ObjectAddress object) const {
  return little_endian(objects_.at({object.index, object.sub}), 0, 8);
}

/// Shows the highest value for an open circuit that no status reports.
void CanopenSlave::show_value(std::size_t channel, double temp_degC,
                              std::span<std::uint8_t> payload) const {
  constexpr double beyond_any_integer = 1e30;
  const CanSignal& signal = places_[channel].signal;
  const CanopenNodeChannel& from = config_.channels[channel];
  const Shown shown = shown_of(channel);
  if (const auto code = code_for(from.codes, shown.fault, shown.code)) {
    return insert_raw(payload, signal, static_cast<std::uint64_t>(*code));
  }
  const bool is_lost = std::isnan(temp_degC) || (is_broken(shown.fault) && !status_of(channel));
  encode(is_lost ? std::copysign(beyond_any_integer, signal.scale) : temp_degC, payload, signal);
}

CanopenSlave::Shown CanopenSlave::shown_of(std::size_t channel) const {
  const NodeEvent* event = fault_of(channel);
  if (event == nullptr) return {};
  return {channel_fault(event->kind), event->code};
}

/// Status code of a fault; the error code for an open or short circuit without a code of its own.
std::optional<std::int64_t> CanopenSlave::status_of(std::size_t channel) const {
  const FaultCodes& codes = config_.channels[channel].status.codes;
  const Shown shown = shown_of(channel);
  if (const auto code = code_for(codes, shown.fault, shown.code)) return code;
  if (!is_broken(shown.fault)) return std::nullopt;
  return code_for(codes, ChannelFault::error, shown.code);
}

void CanopenSlave::measure(std::span<const double> temps_degC) {
  tpdos_.clear();
  std::vector<std::uint8_t>& mapped = tpdos_[config_.cob_id];
  for (std::size_t i = 0; i < places_.size(); ++i) {
    CanopenChannel place = places_[i];
    const auto status =
        static_cast<std::uint64_t>(status_of(i).value_or(config_.channels[i].status.good));
    if (place.way == CanopenWay::pdo_bits) {
      std::vector<std::uint8_t>& payload = tpdos_[place.signal.id];
      payload.resize(std::max(payload.size(), bytes_needed(place.signal)));
      show_value(i, temps_degC[i], payload);
      if (place.signal.status) insert_raw(payload, place.signal.status->field, status);
      continue;
    }
    std::vector<std::uint8_t>& value = objects_.at(key(place.object));
    show_value(i, temps_degC[i], value);
    if (place.way == CanopenWay::pdo_object)
      mapped.insert(mapped.end(), value.begin(), value.end());
    if (place.status) {
      std::vector<std::uint8_t>& object = objects_.at(key(place.status->object));
      object = number(status, object.size());
    }
  }
}

/// Sends emergency messages like a JUMO CANtrans: when a fault begins or ends, and periodically.
void CanopenSlave::send_emergencies() {
  if (config_.emergency != EmergencyForm::jumo) return;
  const bool again = now_ >= emergency_at_;
  if (again) emergency_at_ = now_ + emergency_again;
  const std::vector<std::uint8_t> before = emergencies_;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const auto fault = shown_of(i).fault;
    emergencies_[i] = fault == ChannelFault::open_circuit    ? broken
                      : fault == ChannelFault::short_circuit ? shorted
                                                             : std::uint8_t{0};
  }
  const bool any =
      std::any_of(emergencies_.begin(), emergencies_.end(), [](auto each) { return each != 0; });
  const std::uint8_t error_register = any ? 1 : 0;
  objects_[{0x1001, 0}] = number(error_register, 1);
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const std::uint8_t shown = emergencies_[i];
    if (shown == before[i] && !(again && shown != 0)) continue;
    std::vector<std::uint8_t> frame(8);
    put_little_endian(frame, 0, 2, shown != 0 ? sensor_error : 0);
    frame[2] = error_register;
    frame[3] = static_cast<std::uint8_t>(places_[i].emergency_channel);
    frame[4] = shown;
    put(0x080, frame);
  }
}

void CanopenSlave::send_values() {
  for (const auto& [cob_id, payload] : tpdos_) {
    if (!payload.empty()) send(cob_id, payload);
  }
}

void CanopenSlave::update(nanoseconds now, std::span<const double> temps_degC) {
  now_ = now;
  if (happens(NodeEventKind::silence)) {
    frames_.clear();
    return;
  }
  send_emergencies();
  measure(temps_degC);
  const bool due = config_.period_s > 0.0 ? now >= pdo_at_ : synced_;
  synced_ = false;
  if (due) {
    const nanoseconds period = from_seconds(config_.period_s);
    pdo_at_ = now - pdo_at_ < period ? pdo_at_ + period : now + period;
    if (state_ == state_operational) send_values();
  }
  const auto heartbeat = 1ms * static_cast<long>(number_at({0x1017, 0}));
  if (heartbeat > 0ms && now >= heartbeat_at_) {
    heartbeat_at_ = now - heartbeat_at_ < heartbeat ? heartbeat_at_ + heartbeat : now + heartbeat;
    if (!happens(NodeEventKind::heartbeat_loss)) put(0x700, number(state_, 1));
  }
}

std::optional<CanFrame> CanopenSlave::next_frame() {
  if (frames_.empty()) return std::nullopt;
  const CanFrame frame = frames_.front();
  frames_.pop_front();
  return frame;
}

std::unique_ptr<FieldNode> switch_on(const SimulatedCanopenNode& node, nanoseconds now) {
  return std::make_unique<CanopenSlave>(node, now);
}

}  // namespace thermocomp
