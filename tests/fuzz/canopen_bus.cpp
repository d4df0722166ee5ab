/// A CANopen line with two nodes, one of which uses all features, and arbitrary frames at any time.
#include <cmath>
#include <string>

#include "common/fuzz.hpp"
#include "drivers/can/canopen/canopen_line.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

constexpr int canopen_frames_at_once_max = 64;

CanopenChannel channel_of(CanopenWay way, std::size_t sensor, ObjectAddress object) {
  CanopenChannel channel;
  channel.sensor = sensor;
  channel.way = way;
  channel.object = object;
  channel.signal.length_bits = 16;
  channel.signal.scale = 0.1;
  if (way == CanopenWay::pdo_bits) channel.signal.id = 0x185;
  return channel;
}

CanopenBusConfig canopen_configuration(std::uint8_t kind) {
  CanopenBusConfig bus;
  bus.name = "bus";
  bus.interface = "can0";
  bus.start_nodes = (kind & 1) == 0;
  bus.sync_s = (kind & 2) != 0 ? 0.05 : 0.0;
  bus.own_node = (kind & 4) != 0 ? 127 : 0;
  bus.nodes.resize(2);
  CanopenNodeConfig& all = bus.nodes[0];
  all.name = "all";
  all.node = 5;
  all.heartbeat_s = (kind & 8) != 0 ? 0.1 : 0.0;
  all.heartbeat_timeout_s = (kind & 16) != 0 ? 0.3 : 0.0;
  all.pdo_period_s = (kind & 32) != 0 ? 0.1 : 0.0;
  if ((kind & 64) != 0) all.writes = {{{0x6110, 1}, {20, 0}}};
  if ((kind & 128) != 0) all.mappings_read = {1};
  all.emergency = EmergencyForm::jumo;
  all.channels = {channel_of(CanopenWay::pdo_bits, 0, {}),
                  channel_of(CanopenWay::sdo, 1, {0x2040, 1})};
  all.channels[0].emergency_channel = 1;
  all.channels[1].emergency_codes = {0x4210};
  if ((kind & 32) != 0) {
    all.channels[0].signal.status = {{32, 8, ByteOrder::little_endian}, 0x07, {}};
    all.channels[1].status = {{0x6150, 1}, {{0, 8, ByteOrder::little_endian}, 0x07, {}}};
  }
  if (!all.mappings_read.empty()) {
    all.channels.push_back(channel_of(CanopenWay::pdo_object, 2, {0x7130, 1}));
  }
  CanopenNodeConfig& plain = bus.nodes[1];
  plain.name = "plain";
  plain.node = 6;
  plain.mappings = {{0x186, {{{0x7130, 1}, 16}, {{0x7130, 2}, 16}}}};
  plain.channels = {channel_of(CanopenWay::pdo_object, 3, {0x7130, 2})};
  return bus;
}

void check_line(CanopenLine& line, nanoseconds now, bool open) {
  for (const Reading& reading : line.readings()) {
    FUZZ_REQUIRE(std::isfinite(reading.temp_degC) == (reading.fault == Fault::none));
    FUZZ_REQUIRE(reading.taken_at <= now);
    FUZZ_REQUIRE(open || reading.fault == Fault::no_answer);
  }
  FUZZ_REQUIRE(line.raw().size() == line.readings().size());
  for (const RawReading& raw : line.raw()) {
    FUZZ_REQUIRE(open || (raw.value.empty() && raw.status.empty()));
  }
  int sent = 0;
  while (const auto frame = line.next_frame()) {
    FUZZ_REQUIRE(open);
    FUZZ_REQUIRE(!frame->id.extended && frame->id.id <= 0x7FF && frame->size <= 8);
    FUZZ_REQUIRE(++sent <= canopen_frames_at_once_max);
  }
  for (const UnitHealth& unit : line.health(now)) {
    FUZZ_REQUIRE(unit.last_error.size() < 300);
    for (const char c : unit.last_error) FUZZ_REQUIRE(c >= 0x20 && c < 0x7F);
    FUZZ_REQUIRE(open || !unit.answering);
  }
}

/// Mostly identifiers used on this line.
std::uint32_t canopen_identifier_from(fuzz::ByteFeed& feed) {
  constexpr std::uint32_t ours[] = {0x585, 0x705, 0x085, 0x185, 0x186, 0x706, 0x586, 0x195};
  const std::uint8_t which = feed.u8();
  return which < 0xF0 ? ours[which % std::size(ours)] : feed.u16() & 0x7FFu;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteFeed feed(data, size);
  CanopenLine line(canopen_configuration(feed.u8()));
  nanoseconds now = 1000s;
  bool open = true;
  line.opened(now);
  check_line(line, now, open);
  while (!feed.empty()) {
    const std::uint8_t step = feed.u8();
    if (step < 0xC0) {
      CanFrame frame;
      frame.id = {canopen_identifier_from(feed), step == 0xBF};
      const auto bytes = feed.take(step < 0xB0 ? 8 : step % 9);
      frame.size = bytes.size();
      std::copy(bytes.begin(), bytes.end(), frame.data.begin());
      frame.received_at = now;
      line.take(frame);
    } else if (step < 0xFC) {
      now += (step & 0x20) != 0 ? 1ms * feed.u8() : 20ms;
    } else if (open) {
      open = false;
      line.closed(now);
    } else {
      open = true;
      line.opened(now);
    }
    line.advance(now);
    check_line(line, now, open);
  }
  line.closed(now);
  check_line(line, now, false);
  return 0;
}
