// Tests of a simulated CAN node's frames: pages, counters, FD.
#include <cmath>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>

#include "simulator/devices/can_node.hpp"
#include "simulator/files/can_places.hpp"

using namespace thermocomp;

namespace {

CanSignal value(int start_bit, std::optional<std::uint64_t> page = {}) {
  CanSignal signal;
  signal.id = 0x181;
  signal.start_bit = start_bit;
  signal.length_bits = 16;
  signal.scale = 0.1;
  if (page) signal.selectors = {{{0, 4, ByteOrder::little_endian}, {{*page, *page}}}};
  return signal;
}

double shown(const CanFrame& frame, const CanSignal& signal) {
  return carries(frame.payload(), signal) ? decode(frame.payload(), signal).value : not_a_number;
}

}  // namespace

TEST_CASE("a simulated node sends one frame per page, each with the plain values",
          "[simulator][can]") {
  CanFrames frames;
  const std::vector<CanSignal> signals{value(8), value(24, 2), value(24, 5), value(40, 2)};
  for (const CanSignal& signal : signals) frames.define(signal);
  for (std::size_t i = 0; i < signals.size(); ++i) {
    frames.set_value(signals[i], 20.0 + static_cast<double>(i));
  }
  const auto sent = frames.frames();
  REQUIRE(sent.size() == 2);
  CHECK(shown(sent[0], signals[0]) == Approx(20.0));
  CHECK(shown(sent[0], signals[1]) == Approx(21.0));
  CHECK(std::isnan(shown(sent[0], signals[2])));
  CHECK(shown(sent[0], signals[3]) == Approx(23.0));
  CHECK(shown(sent[1], signals[0]) == Approx(20.0));
  CHECK(std::isnan(shown(sent[1], signals[1])));
  CHECK(shown(sent[1], signals[2]) == Approx(22.0));
}

TEST_CASE("a simulated node's counter increments and wraps within its bits", "[simulator][can]") {
  CanFrames frames;
  const CanField counter{60, 2, ByteOrder::little_endian};
  frames.define(value(0));
  frames.define_counter(value(0), counter);
  frames.set_value(value(0), 25.0);
  for (const std::uint64_t count : {1u, 2u, 3u, 0u, 1u}) {
    frames.count();
    const CanFrame frame = frames.frames().at(0);
    CHECK(frame.size == 8);
    CHECK(extract_raw(frame.payload(), counter) == count);
    CHECK(shown(frame, value(0)) == Approx(25.0));
  }
}

TEST_CASE("a simulated value beyond 8 bytes makes its frame CAN FD", "[simulator][can]") {
  CanFrames frames;
  CanSignal far = value(200);
  far.fd = true;
  frames.define(value(0));
  frames.define(far);
  frames.set_value(far, -12.5);
  const CanFrame frame = frames.frames().at(0);
  CHECK(frame.fd);
  CHECK(frame.size == 27);
  CHECK(shown(frame, far) == Approx(-12.5));
}

TEST_CASE("values of one page must not share bits, values of different pages may",
          "[simulator][can]") {
  FramesTaken taken;
  CHECK(taken.take(value(24, 2)));
  CHECK(taken.take(value(24, 5)));
  CHECK_FALSE(taken.take(value(30, 5)));
  CHECK_FALSE(taken.take(value(32)));  // on every page
  CHECK_FALSE(taken.take(value(2)));   // the multiplexor's own bits
  CHECK(taken.take(value(24, 2), {60, 4, ByteOrder::little_endian}));
  CHECK(taken.take(value(24, 5), {60, 4, ByteOrder::little_endian}));  // the same counter
  CHECK_FALSE(taken.take(value(24, 2), {61, 2, ByteOrder::little_endian}));
}
