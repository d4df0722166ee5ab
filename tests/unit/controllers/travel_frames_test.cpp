// Offsets along a travel as a set of CAN frames, and their assembly when frames are lost.
#include "drivers/controllers/kinds/can/travel_frames.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include <catch2/catch.hpp>

#include "drivers/controllers/kinds/can/can_controller.hpp"
#include "drivers/controllers/travel_values.hpp"
#include "estimator/checks.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;
using Taken = CanSetReader::Taken;

namespace {

CanSignal at(std::uint32_t id, int start_bit, int length_bits, double scale = 1.0) {
  CanSignal signal;
  signal.id = id;
  signal.start_bit = start_bit;
  signal.length_bits = length_bits;
  signal.scale = scale;
  return signal;
}

CanSignal number_at(std::uint32_t id, int start_bit, int length_bits = 8) {
  CanSignal signal = at(id, start_bit, length_bits);
  signal.is_signed = false;
  return signal;
}

/// K0 in 0x210, slope and P0 in 0x211; the number at different positions.
CanTravel frames_of_line() {
  CanTravel travel;
  travel.nodes_mm = {-100.0, 700.0};
  travel.p0_mm = 200.0;
  travel.sent.values = {at(0x210, 0, 24, 0.001), at(0x211, 0, 24, 0.001), at(0x211, 24, 16, 0.1)};
  travel.sent.numbers = {number_at(0x210, 24), number_at(0x211, 56)};
  travel.applied.values = {at(0x310, 0, 24, 0.001), at(0x310, 24, 24, 0.001)};
  travel.applied.numbers = {number_at(0x310, 48)};
  return travel;
}

/// Five offsets in `frames` frames: one of CAN FD, or two or three classic ones.
CanTravel table(std::size_t frames) {
  CanTravel travel;
  travel.nodes_mm = {0.0, 100.0, 300.0, 600.0, 800.0};
  const std::size_t in_a_frame = frames == 1 ? 5 : frames == 2 ? 3 : 2;
  for (std::size_t i = 0; i < travel.nodes_mm.size(); ++i) {
    CanSignal value = at(0x220 + static_cast<std::uint32_t>(i / in_a_frame),
                         static_cast<int>(16 * (i % in_a_frame)), 16, 0.01);
    value.fd = frames == 1;
    travel.sent.values.push_back(value);
  }
  for (std::size_t i = 0; i < frames; ++i) {
    CanSignal number = number_at(0x220 + static_cast<std::uint32_t>(i), frames == 1 ? 80 : 56);
    number.fd = frames == 1;
    travel.sent.numbers.push_back(number);
  }
  return travel;
}

std::vector<double> values_of(const CanTravel& travel, std::span<const double> offset_um) {
  return travel_values(travel, travel.sent.values.size(), offset_um);
}

/// All frames of a set, in the order of its numbers.
std::vector<CanFrame> frames_of(const CanTravel& travel, std::uint64_t number,
                                std::span<const double> offset_um, nanoseconds received_at = 0s) {
  std::vector<CanFrame> frames;
  for (const CanSignal& place : travel.sent.numbers) {
    CanFrame& frame = frames.emplace_back();
    frame.id = {place.id, place.extended_id};
    frame.size = place.fd ? 64 : 8;
    frame.received_at = received_at;
    put_set(travel.sent, values_of(travel, offset_um), number, frame);
  }
  return frames;
}

/// The set as received, rounded to counts.
std::vector<double> rounded(const CanTravel& travel, std::uint64_t number,
                            std::span<const double> offset_um) {
  CanSetReader reader(travel.sent);
  for (const CanFrame& frame : frames_of(travel, number, offset_um)) reader.take(frame);
  return {reader.values().begin(), reader.values().end()};
}

std::vector<double> offsets(std::mt19937& engine, std::size_t count) {
  std::vector<double> offset_um(count);
  for (double& each : offset_um) each = static_cast<double>(engine() % 12001) / 100.0 - 60.0;
  return offset_um;
}

CanControllerConfig config_of(const CanTravel& travel) {
  CanControllerConfig config;
  config.name = "plc";
  config.interface = "vcan0";
  CanAxis along;
  along.travel = travel;
  config.axes.push_back(along);
  config.valid_bits = number_at(0x200, 0);
  config.heartbeat = number_at(0x200, 8);
  return config;
}

}  // namespace

TEST_CASE("each frame of a set carries its number with its values", "[controllers][travel]") {
  const std::vector<double> offset_um{-4.0, 12.0};  // 20 um/m, 2 um at P0
  const auto frames = frames_of(frames_of_line(), 0xA7, offset_um);
  REQUIRE(frames.size() == 2);
  const auto bytes = [&](std::size_t frame) {
    const auto payload = frames[frame].payload();
    return std::vector<int>(payload.begin(), payload.end());
  };
  CHECK(bytes(0) == std::vector<int>{0xD0, 0x07, 0x00, 0xA7, 0, 0, 0, 0});        // 2000
  CHECK(bytes(1) == std::vector<int>{0x20, 0x4E, 0x00, 0xD0, 0x07, 0, 0, 0xA7});  // 20000, 2000
}

TEST_CASE("a number wraps to 0", "[controllers][travel]") {
  const std::vector<double> offset_um{1.0, 2.0};
  CHECK(set_numbers(frames_of_line().sent) == 256);
  CHECK(frames_of(frames_of_line(), 256 + 3, offset_um)[0].data[3] == 3);
}

TEST_CASE("other bits in a frame of a set are unchanged", "[controllers][travel]") {
  CanFrame frame;
  frame.id = {0x210, false};
  frame.size = 8;
  frame.data.fill(0xFF);
  put_set(frames_of_line().sent, std::vector<double>{0.0, 0.0, 200.0}, 0, frame);
  CHECK(frame.data[3] == 0);
  CHECK(frame.data[4] == 0xFF);
  CHECK(frame.data[7] == 0xFF);
}

TEST_CASE("a set is complete when all of its frames have come, in any order",
          "[controllers][travel]") {
  const CanTravel travel = table(3);
  const std::vector<double> offset_um{1.0, -2.0, 3.0, -4.0, 5.0};
  auto frames = frames_of(travel, 9, offset_um, 5s);
  std::vector<std::size_t> order{0, 1, 2};
  do {
    CanSetReader reader(travel.sent);
    CHECK(std::isnan(reader.values()[0]));
    frames[order[1]].received_at = 3s;
    CHECK(reader.take(frames[order[0]]) == Taken::part);
    CHECK(reader.take(frames[order[1]]) == Taken::part);
    CHECK(std::isnan(reader.values()[0]));
    CHECK(reader.take(frames[order[2]]) == Taken::whole);
    CHECK(reader.number() == 9);
    CHECK(reader.received_at() == 3s);  // as old as its oldest frame
    for (std::size_t i = 0; i < offset_um.size(); ++i)
      CHECK(reader.values()[i] == Approx(offset_um[i]));
    frames[order[1]].received_at = 5s;
  } while (std::next_permutation(order.begin(), order.end()));
}

TEST_CASE("a frame with another identifier or too short is not part of the set",
          "[controllers][travel]") {
  const CanTravel travel = table(2);
  const auto frames = frames_of(travel, 9, std::vector<double>(5, 1.0));
  CanSetReader reader(travel.sent);
  CanFrame other = frames[0];
  other.id.extended = true;
  CHECK(reader.take(other) == Taken::nothing);
  other.id = {0x7FF, false};
  CHECK(reader.take(other) == Taken::nothing);
  CanFrame cut = frames[1];
  cut.size = 7;
  CHECK(reader.take(frames[0]) == Taken::part);
  CHECK(reader.take(cut) == Taken::too_short);
  CHECK(reader.take(frames[0]) == Taken::part);
  CHECK(reader.take(frames[1]) == Taken::whole);
}

TEST_CASE("for any order and numbers of the frames of two sets, one complete set is in effect",
          "[controllers][travel]") {
  const std::size_t count = GENERATE(range(1u, 4u));
  const std::uint64_t first = GENERATE(7u, 254u, 255u);
  CAPTURE(count, first);
  const CanTravel travel = table(count);
  // All values differ, so that any mixture is detected.
  const std::vector<std::vector<double>> offset_um{
      {1.0, 2.0, 3.0, 4.0, 5.0}, {11.0, 12.0, 13.0, 14.0, 15.0}, {-1.0, -2.0, -3.0, -4.0, -5.0}};
  std::vector<std::vector<double>> sets;
  std::vector<CanFrame> former = frames_of(travel, first, offset_um[0]);
  std::vector<CanFrame> symbols;
  for (std::uint64_t i = 0; i < offset_um.size(); ++i) {
    sets.push_back(rounded(travel, first + i, offset_um[i]));
    if (i == 0) continue;
    for (const CanFrame& frame : frames_of(travel, first + i, offset_um[i]))
      symbols.push_back(frame);
  }
  constexpr std::size_t length = 6;
  const auto sequences =
      static_cast<std::size_t>(std::pow(static_cast<double>(symbols.size()), length));
  std::size_t mixtures = 0;
  std::size_t wrong = 0;
  std::array<std::size_t, 3> in_effect{};
  for (std::size_t sequence = 0; sequence < sequences; ++sequence) {
    CanSetReader reader(travel.sent);
    for (const CanFrame& frame : former) reader.take(frame);
    std::vector<std::size_t> newest(count, 0);  // set of each identifier's newest frame
    std::size_t expected = 0;
    std::size_t rest = sequence;
    for (std::size_t i = 0; i < length; ++i, rest /= symbols.size()) {
      const std::size_t symbol = rest % symbols.size();
      reader.take(symbols[symbol]);
      newest[symbol % count] = 1 + symbol / count;
      if (std::count(newest.begin(), newest.end(), newest[0]) == static_cast<int>(count))
        expected = newest[0];
      const auto found = std::find_if(sets.begin(), sets.end(), [&](const auto& set) {
        return std::equal(set.begin(), set.end(), reader.values().begin());
      });
      if (found == sets.end()) ++mixtures;
      if (found - sets.begin() != static_cast<std::ptrdiff_t>(expected)) ++wrong;
    }
    ++in_effect[expected];
  }
  CHECK(mixtures == 0);
  CHECK(wrong == 0);
  CHECK(in_effect[1] > 0);
  CHECK(in_effect[2] > 0);
  CHECK((count == 1 || in_effect[0] > 0));
}

TEST_CASE("a link that loses, repeats and breaks off frames never gives a mixture",
          "[controllers][travel][property]") {
  const auto seed = GENERATE(range(0u, 100u));
  CAPTURE(seed);
  std::mt19937 engine(seed);
  const CanTravel travel = seed % 4 == 0 ? frames_of_line() : table(seed % 4);
  const double period_s = 0.01;
  CanSetReader reader(travel.sent);
  std::vector<std::vector<double>> sets;
  std::size_t taken = 0;
  std::size_t lost = 0;
  nanoseconds now = 10s;
  std::uint64_t number = engine();
  for (int turn = 0; turn < 2000; ++turn) {
    now += std::chrono::milliseconds(10);
    // A restarted sender continues half-way round, after a silence.
    if (engine() % 400 == 0) {
      now += 1s;
      number += set_numbers(travel.sent) / 2;
    }
    ++number;
    const std::vector<double> offset_um = offsets(engine, travel.nodes_mm.size());
    sets.push_back(rounded(travel, number, offset_um));
    std::vector<CanFrame> frames = frames_of(travel, number, offset_um, now);
    if (engine() % 8 == 0) frames.push_back(frames[engine() % frames.size()]);
    if (engine() % 8 == 0) std::shuffle(frames.begin(), frames.end(), engine);
    const std::size_t breaks_at = engine() % 8 == 0 ? engine() % frames.size() : frames.size();
    // At times one identifier is lost for longer than a round of numbers.
    const bool deaf = turn / 300 % 2 == 1;
    for (std::size_t i = 0; i < breaks_at; ++i) {
      const bool is_lost = engine() % 8 == 0 || (deaf && frames[i].id == frames[0].id);
      if (is_lost) ++lost;
      if (is_lost) continue;
      reader.forget_before(now - from_seconds(CanTravel::forgotten_after_s(period_s)));
      if (reader.take(frames[i]) != Taken::whole) continue;
      ++taken;
      const bool is_one =
          std::any_of(sets.rbegin(), sets.rend(), [&](const std::vector<double>& set) {
            return std::equal(set.begin(), set.end(), reader.values().begin());
          });
      CHECK(is_one);
      CHECK(reader.number() == number % set_numbers(travel.sent));
    }
  }
  CHECK(taken > 100);
  CHECK(lost > 100);
}

TEST_CASE("a number that has wrapped around completes no set with an expired frame",
          "[controllers][travel]") {
  const CanTravel travel = table(2);
  const auto old = frames_of(travel, 4, std::vector<double>(5, 1.0), 10s);
  const auto young = frames_of(travel, 4 + 256, std::vector<double>(5, 2.0), 12s);
  CanSetReader careless(travel.sent);
  careless.take(old[0]);
  CHECK(careless.take(young[1]) == Taken::whole);  // the mixture that the rule prevents
  CanSetReader reader(travel.sent);
  reader.take(old[0]);
  reader.forget_before(11s);
  CHECK(reader.take(young[1]) == Taken::part);
  CHECK(reader.take(young[0]) == Taken::whole);
  reader.forget();
  CHECK(reader.take(young[0]) == Taken::part);
  CHECK(reader.values()[0] == Approx(2.0));
}

TEST_CASE("a node moves by one count of each value that it depends on", "[controllers][travel]") {
  CHECK(resolution_um(frames_of_line(), frames_of_line().sent, 1) == Approx(0.001 + 0.0005));
  CHECK(resolution_um(frames_of_line(), table(2).applied, 1) == 0.0);  // not read back
  CHECK(resolution_um(table(2), table(2).sent, 4) == Approx(0.01));
  CanTravel floats = table(3);
  for (CanSignal& value : floats.sent.values) {
    value.is_float = true;
    value.length_bits = 32;
  }
  CHECK(resolution_um(floats, floats.sent, 4) == 0.0);
}

TEST_CASE("impossible sets of frames are refused", "[controllers][travel]") {
  CHECK_NOTHROW(CanController(config_of(frames_of_line())));
  CHECK_NOTHROW(CanController(config_of(table(3))));
  const auto refused = [](const char* rule, CanTravel travel, auto change) {
    INFO(rule);
    change(travel);
    CHECK_THROWS_WITH(CanController(config_of(travel)), Catch::Contains(rule));
  };
  refused("each frame with a value must have the number", frames_of_line(),
          [](auto& bad) { bad.sent.numbers.pop_back(); });
  refused("must be one in each frame", frames_of_line(),
          [](auto& bad) { bad.sent.numbers.clear(); });
  refused("must be in a frame with a value", frames_of_line(),
          [](auto& bad) { bad.sent.numbers.push_back(number_at(0x212, 0)); });
  refused("a frame must have one number", frames_of_line(),
          [](auto& bad) { bad.sent.numbers.push_back(number_at(0x211, 40)); });
  refused("the same length", frames_of_line(),
          [](auto& bad) { bad.sent.numbers[1].length_bits = 7; });
  refused("8 to 32 bits", frames_of_line(), [](auto& bad) {
    for (CanSet* set : {&bad.sent, &bad.applied})
      for (CanSignal& number : set->numbers) number.length_bits = 7;
  });
  refused("the same length", frames_of_line(),
          [](auto& bad) { bad.applied.numbers[0].length_bits = 16; });
  refused("without scale", frames_of_line(), [](auto& bad) { bad.sent.numbers[0].scale = 2.0; });
  refused("must not overlap", frames_of_line(),
          [](auto& bad) { bad.sent.numbers[0].start_bit = 20; });
  refused("must not overlap", frames_of_line(),
          [](auto& bad) { bad.applied.numbers[0].start_bit = 40; });
  refused("cannot be one the controller sends", frames_of_line(), [](auto& bad) {
    for (CanSignal& value : bad.applied.values) value.id = 0x211;
    bad.applied.numbers[0].id = 0x211;
  });
  refused("what the set is made of", table(2), [](auto& bad) { bad.sent.values.pop_back(); });
  refused("must increase", table(2), [](auto& bad) { bad.nodes_mm[1] = 400.0; });
  CanControllerConfig config = config_of(frames_of_line());
  config.silent_after_s = 30.0;
  CHECK_THROWS_WITH(CanController(config), Catch::Contains("set numbers repeat"));
  config = config_of(table(3));
  config.axes.resize(4, config.axes[0]);
  CHECK_THROWS_WITH(CanController(config), Catch::Contains("at most 16 axes"));
}
