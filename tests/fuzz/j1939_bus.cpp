/// A J1939 line with a device at an address and one with a NAME, and any frames at any time.
#include <cmath>
#include <string>

#include "common/fuzz.hpp"
#include "drivers/can/j1939/j1939_line.hpp"
#include "drivers/can/signal_codec.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

constexpr int j1939_frames_at_once_max = 8;
constexpr std::uint64_t j1939_name = 0x8000FF0012345678;

J1939BusConfig j1939_configuration(std::uint8_t kind) {
  J1939BusConfig bus;
  bus.name = "bus";
  bus.interface = "can0";
  if ((kind & 1) != 0) bus.own_address = 0xF9;
  bus.own_name = j1939_name + 1;
  bus.nodes.resize(2);
  bus.nodes[0].name = "placed";
  bus.nodes[0].address = 0x80;
  bus.nodes[1].name = "named";
  bus.nodes[1].name_claimed = j1939_name;
  constexpr int lengths[] = {8, 16, 24, 32, 10, 2};
  for (std::size_t i = 0; i < 6; ++i) {
    J1939Parameter parameter;
    parameter.pgn = i < 3 ? 0xFEEE : i < 5 ? 0xFF10 : 0xEF00;
    parameter.start_byte = static_cast<int>(i < 3 ? i : 6 * i);
    parameter.start_bit = i == 4 ? 7 : 0;
    parameter.length_bits = lengths[i];
    parameter.sentinels = {{7, Fault::short_circuit}};
    bus.nodes[i % 2].channels.push_back({i, parameter});
  }
  return bus;
}

void check_line(J1939Line& line, nanoseconds now, bool open) {
  for (const Reading& reading : line.readings()) {
    FUZZ_REQUIRE(std::isfinite(reading.temp_degC) == (reading.fault == Fault::none));
    FUZZ_REQUIRE(reading.taken_at <= now);
    FUZZ_REQUIRE(open || reading.fault == Fault::no_answer);
  }
  int sent = 0;
  while (const auto frame = line.next_frame()) {
    FUZZ_REQUIRE(open);
    FUZZ_REQUIRE(frame->id.extended && frame->id.id <= 0x1FFFFFFF && frame->size <= 8);
    FUZZ_REQUIRE(++sent <= j1939_frames_at_once_max);
  }
  FUZZ_REQUIRE(!line.address_of(1) || *line.address_of(1) <= address_max);
  for (const UnitHealth& unit : line.health(now)) {
    FUZZ_REQUIRE(unit.last_error.size() < 200);
    for (const char c : unit.last_error) FUZZ_REQUIRE(c >= 0x20 && c < 0x7F);
  }
}

/// Mostly identifiers used on this line.
std::uint32_t j1939_identifier_from(fuzz::ByteFeed& feed) {
  constexpr std::uint32_t ours[] = {0x18FEEE80, 0x1CECFF80, 0x1CEBFF80, 0x1CECF980, 0x1CEBF980,
                                    0x18EEFF80, 0x18EAFF80, 0x18EEFFF9, 0x18FEEE90, 0x18EEFF90};
  const std::uint8_t which = feed.u8();
  if (which < 0xF0) return ours[which % std::size(ours)];
  return static_cast<std::uint32_t>(feed.u64()) & 0x1FFFFFFFu;
}

/// A message assembled from packets matches its announcement.
void check_transport(std::span<const std::uint8_t> rest) {
  TransportReceiver receiver({0xFF10});
  const J1939Id control = read_identifier(0x1CECFF80);
  const J1939Id packet = read_identifier(0x1CEBFF80);
  std::size_t announced = 0;
  for (; rest.size() >= 8; rest = rest.subspan(8)) {
    const auto data = rest.first(8);
    if (data[0] == 32) announced = static_cast<std::size_t>(little_endian(data, 1, 2));
    const auto message = receiver.take(data[0] == 32 ? control : packet, data, 1s);
    FUZZ_REQUIRE(receiver.open_transfers() <= 1);
    if (message) FUZZ_REQUIRE(message->bytes.size() == announced && message->pgn == 0xFF10);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteFeed feed(data, size);
  const std::uint8_t kind = feed.u8();
  if ((kind & 2) != 0) check_transport(feed.rest());
  J1939Line line(j1939_configuration(kind));
  nanoseconds now = 1000s;
  bool open = true;
  line.opened(now);
  check_line(line, now, open);
  while (!feed.empty()) {
    const std::uint8_t step = feed.u8();
    if (step < 0xC0) {
      CanFrame frame;
      frame.id = {j1939_identifier_from(feed), step != 0xBF};
      const auto bytes = feed.take(step < 0xB0 ? 8 : step % 9);
      frame.size = bytes.size();
      std::copy(bytes.begin(), bytes.end(), frame.data.begin());
      frame.received_at = now;
      line.take(frame);
    } else if (step < 0xFC) {
      now += (step & 0x20) != 0 ? 10ms * feed.u8() : 20ms;
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
  return 0;
}
