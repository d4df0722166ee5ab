/// A CANopen line with its clock, for tests.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "canopen_frames.hpp"
#include "drivers/can/canopen/canopen_line.hpp"

namespace thermocomp {

using namespace std::chrono_literals;

inline CanSignal int16_tenths(std::uint32_t id, int start) {
  CanSignal signal;
  signal.id = id;
  signal.start_bit = start;
  signal.length_bits = 16;
  signal.scale = 0.1;
  return signal;
}

inline CanopenChannel in_pdo(std::size_t sensor, std::uint32_t cob_id, int start) {
  CanopenChannel channel;
  channel.sensor = sensor;
  channel.signal = int16_tenths(cob_id, start);
  return channel;
}

inline CanopenChannel object_channel(CanopenWay way, ObjectAddress object) {
  CanopenChannel channel;
  channel.way = way;
  channel.object = object;
  channel.signal = int16_tenths(0, 0);
  return channel;
}

inline CanopenBusConfig bus_of(std::vector<CanopenNodeConfig> nodes) {
  CanopenBusConfig bus;
  bus.name = "bus";
  bus.interface = "vcan0";
  bus.nodes = std::move(nodes);
  return bus;
}

inline CanopenNodeConfig node_5(std::vector<CanopenChannel> channels) {
  CanopenNodeConfig node;
  node.name = "module";
  node.node = 5;
  node.channels = std::move(channels);
  return node;
}

/// A line and its clock.
struct Bus {
  explicit Bus(CanopenBusConfig config) : line(std::move(config)) {
    line.opened(now);
    line.advance(now);
  }
  void put(std::uint32_t id, const Bytes& data) {
    CanFrame frame;
    frame.id = {id, false};
    frame.size = data.size();
    std::copy(data.begin(), data.end(), frame.data.begin());
    frame.received_at = now;
    line.take(frame);
    line.advance(now);
  }
  void wait(nanoseconds time) {
    for (const nanoseconds end = now + time; now < end;) {
      now += 10ms;
      line.advance(now);
    }
  }
  std::vector<Sent> sent() { return sent_by(line); }
  [[nodiscard]] Fault fault(std::size_t channel = 0) const {
    return line.readings()[channel].fault;
  }
  [[nodiscard]] double temp_degC(std::size_t channel = 0) const {
    return line.readings()[channel].temp_degC;
  }
  [[nodiscard]] std::string error(std::size_t node = 0) const {
    return line.health(now)[node].last_error;
  }

  nanoseconds now{1000s};
  CanopenLine line;
};

inline const Sent start_5{0x000, {0x01, 0x05}};
inline const Sent pre_operational_5{0x000, {0x80, 0x05}};

}  // namespace thermocomp
