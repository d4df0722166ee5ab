// Offsets along a travel as a set of registers, and the link that writes them.
#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include <catch2/catch.hpp>

#include "cycle_stub.hpp"
#include "drivers/controllers/kinds/modbus/modbus_controller.hpp"
#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"
#include "drivers/controllers/travel_values.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "estimator/checks.hpp"
#include "modbus_machine.hpp"

using namespace thermocomp;
using test::Cycle;
using test::eventually;
using test::ModbusMachine;

namespace {

ModbusValue at(ModbusTable table, int address, Encoding encoding, double scale = 1.0) {
  ModbusValue value;
  value.table = table;
  value.address = static_cast<std::uint16_t>(address);
  value.encoding = encoding;
  value.scale = scale;
  return value;
}

/// begin 20, K0 21..22, slope 23..24, P0 25..26, end 27.
ModbusTravel line() {
  ModbusTravel travel;
  travel.nodes_mm = {-100.0, 700.0};
  travel.p0_mm = 200.0;
  travel.begin = at(ModbusTable::holding, 20, Encoding::uint16);
  travel.values = {at(ModbusTable::holding, 21, Encoding::int32, 0.001),
                   at(ModbusTable::holding, 23, Encoding::int32, 0.001),
                   at(ModbusTable::holding, 25, Encoding::int32, 0.1)};
  travel.end = at(ModbusTable::holding, 27, Encoding::uint16);
  travel.applied = {at(ModbusTable::input, 21, Encoding::int32, 0.001),
                    at(ModbusTable::input, 23, Encoding::int32, 0.001),
                    at(ModbusTable::input, 25, Encoding::int32, 0.1)};
  return travel;
}

/// begin 20, five offsets 21..25, end 26.
ModbusTravel table() {
  ModbusTravel travel;
  travel.nodes_mm = {0.0, 100.0, 300.0, 600.0, 800.0};
  travel.begin = at(ModbusTable::holding, 20, Encoding::uint16);
  for (int i = 0; i < 5; ++i) {
    travel.values.push_back(at(ModbusTable::holding, 21 + i, Encoding::int16, 0.01));
    travel.applied.push_back(at(ModbusTable::input, 21 + i, Encoding::int16, 0.01));
  }
  travel.end = at(ModbusTable::holding, 26, Encoding::uint16);
  return travel;
}

/// A controller's reader: `end` first, then the values, then `begin`; it may stop between any two
/// registers, and then takes nothing over.
class Reader {
 public:
  /// Reads one more register; takes the set over when all are read and both numbers are equal.
  void read_one(const std::vector<std::uint16_t>& registers) {
    const std::size_t place = registers.size() - 1 - next_;
    copy_.resize(registers.size());
    copy_[place] = registers[place];
    if (++next_ < registers.size()) return;
    next_ = 0;
    if (copy_.front() == copy_.back()) taken = copy_;
  }
  void stop() { next_ = 0; }

  std::optional<std::vector<std::uint16_t>> taken;

 private:
  std::vector<std::uint16_t> copy_;
  std::size_t next_{0};
};

double value_in(const std::vector<std::uint16_t>& block, const ModbusTravel& travel,
                std::size_t index) {
  const ModbusValue& place = travel.values[index];
  return decode(std::span(block).subspan(place.address - travel.begin.address),
                {place.encoding, place.word_order, place.scale, 0.0}, {})
      .value;
}

/// Offset that a controller interpolates from a set at a position.
double interpolated(const std::vector<std::uint16_t>& block, const ModbusTravel& travel,
                    double position_mm) {
  if (travel.p0_mm)
    return value_in(block, travel, 0) +
           value_in(block, travel, 1) * (position_mm - value_in(block, travel, 2)) / 1000.0;
  std::size_t above = 1;
  while (above + 1 < travel.nodes_mm.size() && position_mm > travel.nodes_mm[above]) ++above;
  const double low_mm = travel.nodes_mm[above - 1];
  const double share = (position_mm - low_mm) / (travel.nodes_mm[above] - low_mm);
  return (1 - share) * value_in(block, travel, above - 1) + share * value_in(block, travel, above);
}

ModbusControllerConfig config_of(int port, const ModbusTravel& travel) {
  ModbusControllerConfig config;
  config.name = "plc";
  config.line.link = ModbusTcp{"127.0.0.1", port};
  config.line.timeout_ms = 300;
  config.line.reconnect_s = 0.05;
  config.period_s = 0.02;
  ModbusAxis along;
  along.travel = travel;
  config.axes.push_back(along);
  config.axes.push_back({at(ModbusTable::holding, 2, Encoding::int32, 0.01),
                         at(ModbusTable::input, 2, Encoding::int32, 0.01)});
  config.valid_bits = at(ModbusTable::holding, 10, Encoding::uint16);
  config.heartbeat = at(ModbusTable::holding, 11, Encoding::uint16);
  return config;
}

}  // namespace

TEST_CASE("a line is K0 at P0 and its slope", "[controllers][travel]") {
  const WriteField field = travel_field(line(), 7, std::vector<double>{-4.0, 12.0});
  CHECK(field.address == 20);
  REQUIRE(field.words.size() == 8);
  CHECK(field.words.front() == 7);
  CHECK(field.words.back() == 7);
  CHECK(value_in(field.words, line(), 0) == Approx(2.0));   // 300 mm along at 20 um/m
  CHECK(value_in(field.words, line(), 1) == Approx(20.0));  // um/m
  CHECK(value_in(field.words, line(), 2) == Approx(200.0));
}

TEST_CASE("a read-back gives the offsets at the nodes, with the P0 read back",
          "[controllers][travel]") {
  std::vector<double> offset_um(2);
  offsets_shown(line(), std::vector<double>{2.0, 20.0, 200.0}, offset_um);
  CHECK(offset_um[0] == Approx(-4.0));
  CHECK(offset_um[1] == Approx(12.0));
  offsets_shown(line(), std::vector<double>{2.0, 20.0, 0.0}, offset_um);
  CHECK(offset_um[1] == Approx(16.0));
  offsets_shown(line(), std::vector<double>{2.0, not_a_number, 200.0}, offset_um);
  CHECK(std::isnan(offset_um[0]));
  CHECK(shown_resolution_um(line(), 1) == Approx(0.001 + 0.0005));
}

TEST_CASE("bound and slew hold over the whole travel, apart from rounding of registers",
          "[controllers][travel][property]") {
  const auto seed = GENERATE(range(0u, 100u));
  CAPTURE(seed);
  std::mt19937 engine(seed);
  const ModbusTravel travel = seed % 2 == 0 ? line() : table();
  const double bound_um = 60.0;
  const double step_um = 0.05;
  const double rounding_um = seed % 2 == 0 ? 0.002 : 0.011;
  std::vector<double> offset_um(travel.nodes_mm.size(), 0.0);
  std::vector<double> goal_um(offset_um.size(), 0.0);
  std::vector<double> before_um(41, 0.0);
  for (int write = 0; write < 500; ++write) {
    for (std::size_t i = 0; i < offset_um.size(); ++i) {
      if (engine() % 50 == 0) goal_um[i] = bound_um * (static_cast<double>(engine() % 3) - 1.0);
      offset_um[i] += std::clamp(goal_um[i] - offset_um[i], -step_um, step_um);
    }
    const WriteField field = travel_field(travel, static_cast<std::uint64_t>(write), offset_um);
    const double length_mm = travel.nodes_mm.back() - travel.nodes_mm.front();
    for (std::size_t i = 0; i < before_um.size(); ++i) {
      const double position_mm =
          travel.nodes_mm.front() + length_mm * static_cast<double>(i) / 40.0;
      const double now_um = interpolated(field.words, travel, position_mm);
      CHECK(std::abs(now_um) <= bound_um + rounding_um);
      CHECK(std::abs(now_um - before_um[i]) <= step_um + rounding_um);
      before_um[i] = now_um;
    }
  }
}

TEST_CASE("a controller that stops reading half-way never applies a mixture",
          "[controllers][travel][property]") {
  const auto seed = GENERATE(range(0u, 100u));
  CAPTURE(seed);
  std::mt19937 engine(seed);
  const ModbusTravel travel = seed % 2 == 0 ? line() : table();
  std::vector<std::vector<std::uint16_t>> sets;
  std::vector<std::uint16_t> registers = travel_field(travel, 0, std::vector<double>(5, 0.0)).words;
  sets.push_back(registers);
  Reader reader;
  std::size_t taken = 0;
  // Registers are written and read one at a time, in any interleaving, and both may stop.
  for (std::uint64_t number = 1; number < 300; ++number) {
    std::vector<double> offset_um(travel.nodes_mm.size());
    for (double& each : offset_um) each = static_cast<double>(engine() % 6000) / 100.0;
    sets.push_back(travel_field(travel, number, offset_um).words);
    const std::size_t breaks_at = engine() % 4 == 0 ? engine() % registers.size() : 1000;
    for (std::size_t i = 0; i < registers.size() && i < breaks_at; ++i) {
      registers[i] = sets.back()[i];
      for (std::size_t reads = engine() % 4; reads > 0; --reads) reader.read_one(registers);
      if (engine() % 10 == 0) reader.stop();
      if (!reader.taken) continue;
      ++taken;
      CHECK(std::find(sets.begin(), sets.end(), *reader.taken) != sets.end());
      reader.taken.reset();
    }
    // At times the link rests, and a reader completes a set.
    if (engine() % 2 == 0) continue;
    for (std::size_t reads = engine() % 20; reads > 0; --reads) reader.read_one(registers);
  }
  CHECK(taken > 20);
}

TEST_CASE("a set is written as one block, and its number counts up", "[controllers][travel]") {
  ModbusMachine machine;
  machine.set_holding(20, 40);  // an incomplete set
  machine.set_holding(27, 39);
  machine.mirrored = 28;
  ModbusController link(config_of(machine.port(), line()));
  Cycle cycle(link);
  cycle.want(0, -4.0);
  cycle.want(1, 12.0);
  cycle.want(2, 3.0);
  REQUIRE(eventually([&] { return machine.holding(10) == 0b11; }));
  CHECK(int32_of(machine, 21) == 2000);
  CHECK(int32_of(machine, 23) == 20000);
  CHECK(int32_of(machine, 25) == 2000);
  CHECK(int32_of(machine, 2) == 300);
  REQUIRE(eventually([&] { return machine.holding(27) > 45; }));
  CHECK(machine.holding(27) < 1000);
  REQUIRE(eventually([&] { return cycle.state().applied_um[1] == Approx(12.0); }));
  CHECK(cycle.state().applied_um[0] == Approx(-4.0));
  CHECK(cycle.state().applied_um[2] == Approx(3.0));
}

TEST_CASE("the first set of a link has another number than the one in `end`",
          "[controllers][travel]") {
  ModbusMachine machine;
  machine.set_holding(27, 0xFFFF);
  ModbusController link(config_of(machine.port(), line()));
  Cycle cycle(link);
  cycle.want(0, 0.0);
  cycle.want(1, 0.0);
  REQUIRE(eventually([&] { return machine.holding(27) != 0xFFFF; }));
  CHECK(machine.holding(27) < 100);
  CHECK(machine.holding(20) == machine.holding(27));
}

TEST_CASE("while one node must stay, no value of the set is written and its bit is 0",
          "[controllers][travel]") {
  ModbusMachine machine;
  ModbusController link(config_of(machine.port(), table()));
  Cycle cycle(link);
  for (std::size_t i = 0; i < 6; ++i) cycle.want(i, 1.0);
  REQUIRE(eventually([&] { return machine.holding(10) == 0b11; }));
  cycle.want(3, 50.0, false);
  REQUIRE(eventually([&] { return machine.holding(10) == 0b10; }));
  const std::uint16_t number = machine.holding(26);
  cycle.want(0, 2.0);
  cycle.want(5, 2.0);
  REQUIRE(eventually([&] { return int32_of(machine, 2) == 200; }));
  CHECK(machine.holding(21) == 100);
  CHECK(machine.holding(26) == number);
}

TEST_CASE("impossible sets are refused", "[controllers][travel]") {
  const auto refused = [](ModbusTravel travel, auto change) {
    change(travel);
    CHECK_THROWS_AS(ModbusController(config_of(1, travel)), InvalidValue);
  };
  refused(line(), [](auto& bad) { bad.values[1].address = 24; });  // a gap
  refused(line(), [](auto& bad) { bad.end.address = 19; });
  refused(line(), [](auto& bad) { bad.nodes_mm = {0.0, 100.0, 200.0}; });
  refused(table(), [](auto& bad) { bad.nodes_mm[1] = 400.0; });
  refused(table(), [](auto& bad) { bad.applied.pop_back(); });
  refused(table(), [](auto& bad) { bad.begin.encoding = Encoding::float32; });
}

TEST_CASE("a set in its registers gives the offsets at the nodes", "[controllers]") {
  ModbusAxis axis;
  axis.travel = ModbusTravel{};
  ModbusTravel& travel = *axis.travel;
  travel.nodes_mm = {100.0, 300.0};
  travel.p0_mm = 200.0;
  const auto holding = [](std::uint16_t address, Encoding encoding, double scale) {
    return ModbusValue{ModbusTable::holding, address, encoding, WordOrder::abcd, scale};
  };
  travel.begin = holding(20, Encoding::uint16, 1.0);
  travel.values = {holding(21, Encoding::int32, 0.01), holding(23, Encoding::int32, 0.01)};
  travel.end = holding(25, Encoding::uint16, 1.0);
  WrittenOffsets written(axis);
  CHECK(written.request().address == 20);
  REQUIRE(written.request().count == 6);
  const std::vector<double> offset_um{-7.5, 12.5};
  WriteField field = travel_field(travel, 9, offset_um);
  CHECK(written.decode(field.words)[0] == Approx(-7.5));
  CHECK(written.decode(field.words)[1] == Approx(12.5));
  field.words.back() = 8;  // incomplete
  CHECK(std::isnan(written.decode(field.words)[0]));
  CHECK(std::isnan(written.decode({})[1]));
}
