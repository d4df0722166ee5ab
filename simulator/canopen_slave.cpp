#include "simulator/canopen_slave.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "drivers/can/little_endian.hpp"
#include "drivers/monotonic_clock.hpp"

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
constexpr nanoseconds emergency_again = 1s;  // as a CANtrans does it
constexpr std::uint16_t values = 0x7130;
constexpr std::string_view device_name = "thermocomp-sim CANopen node";

std::vector<std::uint8_t> number(std::uint64_t value, std::size_t bytes) {
  std::vector<std::uint8_t> result(bytes);
  put_little_endian(result, 0, bytes, value);
  return result;
}

}  // namespace

CanopenSlave::CanopenSlave(const SimulatedCanopenNode& config, nanoseconds now)
    : config_(config), switched_on_(now), now_(now) {
  boot(now);
}

void CanopenSlave::boot(nanoseconds now) {
  frames_.clear();
  segments_.clear();
  const std::size_t count = config_.channels.size();
  objects_.clear();
  objects_[{0x1000, 0}] = number(0x00020194, 4);  // device profile 404
  objects_[{0x1001, 0}] = number(0, 1);
  objects_[{0x1008, 0}] = {device_name.begin(), device_name.end()};
  const long heartbeat_ms = std::lround(config_.heartbeat_s * 1e3);
  objects_[{0x1017, 0}] = number(static_cast<std::uint64_t>(heartbeat_ms), 2);
  objects_[{0x1800, 1}] = number(config_.cob_id, 4);
  objects_[{0x1A00, 0}] = number(count, 1);
  for (std::size_t i = 0; i < count; ++i) {
    const auto sub = static_cast<std::uint8_t>(i + 1);
    objects_[{0x1A00, sub}] =
        number((std::uint64_t{values} << 16) | (std::uint64_t{sub} << 8u) | 16u, 4);
    objects_[{0x6110, sub}] = number(0, 2);
    objects_[{values, sub}] = number(0, 2);
  }
  faults_.assign(count, 0);
  state_ = state_pre_operational;
  pdo_at_ = heartbeat_at_ = emergency_at_ = now;
  put(0x700, number(0, 1));
}

void CanopenSlave::put(std::uint32_t id, std::span<const std::uint8_t> data) {
  CanFrame frame;
  frame.id = {
      id < 0x80 || id == config_.cob_id ? id : id + static_cast<std::uint32_t>(config_.node),
      false};
  frame.size = data.size();
  std::copy(data.begin(), data.end(), frame.data.begin());
  frames_.push_back(frame);
}

bool CanopenSlave::happens(NodeEventKind kind, std::size_t channel) const {
  const double time_s = std::chrono::duration<double>(now_ - switched_on_).count();
  return std::any_of(config_.events.begin(), config_.events.end(), [&](const NodeEvent& event) {
    return event.kind == kind && event.channel == channel && time_s >= event.at_s &&
           time_s < event.at_s + event.duration_s;
  });
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
  if ((data[0] & 0x02u) == 0) return abort(object, 0x06010000);  // expedited only
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

void CanopenSlave::measure(std::span<const double> temps_degC) {
  constexpr double least = -32768.0;
  constexpr double greatest = 32767.0;
  for (std::size_t i = 0; i < config_.channels.size(); ++i) {
    const double counts = faults_[i] != 0 ? greatest : std::round(10.0 * temps_degC[i]);
    const double shown = std::isnan(counts) ? greatest : std::clamp(counts, least, greatest);
    objects_[{values, static_cast<std::uint8_t>(i + 1)}] =
        number(static_cast<std::uint16_t>(static_cast<std::int16_t>(shown)), 2);
  }
}

/// Emergency messages in the form of a JUMO CANtrans: when a fault comes or goes, and again while
/// it lasts.
void CanopenSlave::tell_faults() {
  const bool again = now_ >= emergency_at_;
  if (again) emergency_at_ = now_ + emergency_again;
  const std::vector<std::uint8_t> before = faults_;
  for (std::size_t i = 0; i < faults_.size(); ++i) {
    faults_[i] = happens(NodeEventKind::open_circuit, i)    ? broken
                 : happens(NodeEventKind::short_circuit, i) ? shorted
                                                            : std::uint8_t{0};
  }
  const bool any = std::any_of(faults_.begin(), faults_.end(), [](auto each) { return each != 0; });
  const std::uint8_t error_register = any ? 1 : 0;
  objects_[{0x1001, 0}] = number(error_register, 1);
  for (std::size_t i = 0; i < faults_.size(); ++i) {
    if (faults_[i] == before[i] && !(again && faults_[i] != 0)) continue;
    std::vector<std::uint8_t> frame(8);
    put_little_endian(frame, 0, 2, faults_[i] != 0 ? sensor_error : 0);
    frame[2] = error_register;
    frame[3] = static_cast<std::uint8_t>(i + 1);
    frame[4] = faults_[i];
    put(0x080, frame);
  }
}

void CanopenSlave::send_values() {
  std::vector<std::uint8_t> data;
  for (std::size_t i = 0; i < config_.channels.size(); ++i) {
    const auto& value = objects_.at({values, static_cast<std::uint8_t>(i + 1)});
    data.insert(data.end(), value.begin(), value.end());
  }
  put(config_.cob_id, data);
}

void CanopenSlave::update(nanoseconds now, std::span<const double> temps_degC) {
  now_ = now;
  if (happens(NodeEventKind::silence)) {
    frames_.clear();
    return;
  }
  tell_faults();
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

}  // namespace thermocomp
