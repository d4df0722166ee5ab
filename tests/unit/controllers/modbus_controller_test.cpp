// The Modbus link against a libmodbus server.
#include "drivers/controllers/kinds/modbus/modbus_controller.hpp"

#include <chrono>
#include <cmath>
#include <memory>
#include <thread>
#include <utility>

#include <catch2/catch.hpp>

#include "cycle_stub.hpp"
#include "estimator/checks.hpp"
#include "modbus_machine.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;
using test::Cycle;
using test::eventually;
using test::ModbusMachine;

namespace {

constexpr int valid_bits_at = 10;
constexpr int heartbeat_at = 11;

ModbusValue at(ModbusTable table, std::uint16_t address, Encoding encoding, double scale = 1.0) {
  ModbusValue value;
  value.table = table;
  value.address = address;
  value.encoding = encoding;
  value.scale = scale;
  return value;
}

/// Three axes as in the example of the documentation: int32, 0.01 um per count.
ModbusControllerConfig three_axes(int port) {
  ModbusControllerConfig config;
  config.name = "cnc";
  config.line.link = ModbusTcp{"127.0.0.1", port};
  config.line.timeout_ms = 300;
  config.line.reconnect_s = 0.05;
  config.period_s = 0.02;
  for (std::uint16_t address : {std::uint16_t{0}, std::uint16_t{2}, std::uint16_t{4}}) {
    config.axes.push_back({at(ModbusTable::holding, address, Encoding::int32, 0.01),
                           at(ModbusTable::input, address, Encoding::int32, 0.01)});
  }
  config.valid_bits = at(ModbusTable::holding, valid_bits_at, Encoding::uint16);
  config.heartbeat = at(ModbusTable::holding, heartbeat_at, Encoding::uint16);
  return config;
}

ModbusControllerConfig without_read_back(ModbusControllerConfig config) {
  for (ModbusAxis& axis : config.axes) axis.applied.reset();
  return config;
}

}  // namespace

TEST_CASE("offsets are written to the controller's registers with sign and scale",
          "[controllers]") {
  ModbusMachine machine;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link);
  cycle.want(0, 12.34);
  cycle.want(1, -7.0);
  cycle.want(2, -600.005);
  REQUIRE(eventually([&] { return machine.holding(valid_bits_at) == 0b111; }));
  CHECK(int32_of(machine, 0) == 1234);
  CHECK(int32_of(machine, 2) == -700);
  CHECK(std::abs(int32_of(machine, 4) + 60000.5) <= 0.5);
}

TEST_CASE("the heartbeat is incremented by every write", "[controllers]") {
  ModbusMachine machine;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link);
  cycle.want(0, 1.0);
  REQUIRE(eventually([&] { return machine.holding(heartbeat_at) >= 5; }));
  const std::uint64_t writes = link.health().writes;
  const std::uint16_t beats = machine.holding(heartbeat_at);
  CHECK(beats >= writes);
  CHECK(beats <= link.health().writes + 1);
}

TEST_CASE("an invalid axis keeps its register and clears its bit", "[controllers]") {
  ModbusMachine machine;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link);
  cycle.want(0, 1.0);
  cycle.want(1, 2.0);
  cycle.want(2, 3.0);
  REQUIRE(eventually([&] { return machine.holding(valid_bits_at) == 0b111; }));
  cycle.want(1, 50.0, false);
  REQUIRE(eventually([&] { return machine.holding(valid_bits_at) == 0b101; }));
  cycle.want(0, not_a_number);
  REQUIRE(eventually([&] { return machine.holding(valid_bits_at) == 0b100; }));
  cycle.want(2, 3.5);
  REQUIRE(eventually([&] { return int32_of(machine, 4) == 350; }));
  CHECK(int32_of(machine, 0) == 100);
  CHECK(int32_of(machine, 2) == 200);
}

TEST_CASE("applied offsets and signals are read back", "[controllers]") {
  ModbusMachine machine;
  machine.set_input(0, 0xFFFF);  // -500 counts of 0.01 um
  machine.set_input(1, 0xFE0C);
  machine.set_input(26, 12000);
  machine.set_holding(100, 0x41CC);  // 25.5f
  machine.set_discrete(3, true);
  machine.set_coil(7, true);
  ModbusControllerConfig config = three_axes(machine.port());
  config.signals = {{0, at(ModbusTable::input, 26, Encoding::uint16)},
                    {1, at(ModbusTable::discrete_input, 3, Encoding::uint16)},
                    {2, at(ModbusTable::discrete_input, 4, Encoding::uint16)},
                    {3, at(ModbusTable::coil, 7, Encoding::uint16)},
                    {5, at(ModbusTable::holding, 100, Encoding::float32, 2.0)}};
  ModbusController link(config);
  const nanoseconds before = monotonic_now();
  link.start();
  ControllerState state;
  REQUIRE(eventually([&] {
    link.newest(state);
    return state.online;
  }));
  CHECK(state.link_epoch != 0);
  CHECK(state.applied_um[0] == Approx(-5.0));
  CHECK(state.applied_um[1] == 0.0);
  CHECK(std::isnan(state.applied_um[3]));
  CHECK(state.signals[0] == 12000.0);
  CHECK(state.signals[1] == 1.0);
  CHECK(state.signals[2] == 0.0);
  CHECK(state.signals[3] == 1.0);
  CHECK(std::isnan(state.signals[4]));
  CHECK(state.signals[5] == 51.0);
  CHECK(state.taken_at >= before);
  CHECK(state.taken_at <= monotonic_now());
  machine.set_input(26, 3000);
  const nanoseconds first = state.taken_at;
  REQUIRE(eventually([&] {
    link.newest(state);
    return state.signals[0] == 3000.0;
  }));
  CHECK(state.taken_at > first);
  CHECK(link.health().kind == "modbus_tcp");
}

TEST_CASE("without read-back the written registers give the start", "[controllers]") {
  ModbusMachine machine;
  machine.set_holding(2, 0xFFFF);  // -1500 counts
  machine.set_holding(3, 0xFA24);
  machine.shows = GENERATE(ModbusMachine::Shows::all, ModbusMachine::Shows::exception);
  ModbusControllerConfig config = three_axes(machine.port());
  config.axes[1].applied.reset();
  ModbusController link(config);
  Cycle cycle(link);
  REQUIRE(eventually([&] { return cycle.state().online; }));
  if (machine.shows == ModbusMachine::Shows::all)
    CHECK(cycle.state().applied_um[1] == Approx(-15.0));
  else
    CHECK(std::isnan(cycle.state().applied_um[1]));
  CHECK(cycle.state().applied_um[0] == 0.0);
  // Offsets sent afterwards are not read back and begin no new epoch.
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.want(1, -14.0);
  REQUIRE(eventually([&] { return int32_of(machine, 2) == -1400; }));
  cycle.want(1, 20.0);
  REQUIRE(eventually([&] { return int32_of(machine, 2) == 2000; }));
  CHECK(cycle.state().link_epoch == epoch);
  link.stop();
}

TEST_CASE("registers that do not hold the values written give no start", "[controllers]") {
  ModbusMachine machine;
  machine.shows = ModbusMachine::Shows::zeros;
  ModbusController link(without_read_back(three_axes(machine.port())));
  Cycle cycle(link);
  REQUIRE(eventually([&] { return cycle.state().online; }));
  CHECK(cycle.state().applied_um[0] == 0.0);
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.want(0, 3.0);
  // Another link, with unknown offset.
  REQUIRE(eventually([&] {
    const ControllerState state = cycle.state();
    return state.online && !is_same_link(state.link_epoch, epoch);
  }));
  CHECK(std::isnan(cycle.state().applied_um[0]));
  CHECK(eventually([&] { return int32_of(machine, 0) == 300; }));
  link.stop();
}

TEST_CASE("a write that is answered and not done is not confirmed", "[controllers]") {
  ModbusMachine machine;
  ModbusController link(without_read_back(three_axes(machine.port())));
  Cycle cycle(link);
  cycle.want(1, -5.46);
  REQUIRE(eventually([&] { return cycle.state().written && int32_of(machine, 2) == -546; }));
  machine.keep_offsets = true;
  cycle.want(1, -9.0);
  std::this_thread::sleep_for(2500ms);
  CHECK(cycle.state().written);  // the value before the newest may still be shown
  cycle.want(1, -17.3);
  REQUIRE(eventually([&] { return !cycle.state().written; }));
  CHECK(cycle.state().online);
  CHECK(cycle.state().applied_um[1] == Approx(-5.46));
  CHECK(link.health().last_error ==
        "writes are answered, but register 2 keeps another value: -17.30 was written, "
        "-5.46 is read");
  machine.keep_offsets = false;
  REQUIRE(eventually([&] { return cycle.state().written; }));
  CHECK(link.health().last_error.empty());
  machine.keep_offsets = true;
  machine.shows = ModbusMachine::Shows::exception;  // no longer readable: nothing to compare
  cycle.want(1, 1.0);
  std::this_thread::sleep_for(100ms);
  cycle.want(1, 2.0);
  std::this_thread::sleep_for(2500ms);
  CHECK(cycle.state().written);
  link.stop();
}

TEST_CASE("a register that a program sets back after each write is not written", "[controllers]") {
  ModbusMachine machine;
  ModbusController link(without_read_back(three_axes(machine.port())));
  Cycle cycle(link);
  cycle.want(0, -5.46);
  REQUIRE(eventually([&] { return cycle.state().written && int32_of(machine, 0) == -546; }));
  std::this_thread::sleep_for(100ms);  // compared: the registers hold what is written
  machine.sets_back = true;
  cycle.want(0, -9.0);
  std::this_thread::sleep_for(100ms);
  cycle.want(0, -17.3);
  REQUIRE(eventually([&] { return !cycle.state().written; }));
  CHECK(cycle.state().online);
  link.stop();
}

TEST_CASE("a controller that restarts on a living link is another link", "[controllers]") {
  ModbusMachine machine;
  ModbusController link(without_read_back(three_axes(machine.port())));
  Cycle cycle(link);
  for (const int count : {-300, -546}) {  // two, since the last but one may be read as well
    cycle.want(0, 0.01 * count);
    REQUIRE(eventually([&] { return cycle.state().written && int32_of(machine, 0) == count; }));
  }
  std::this_thread::sleep_for(100ms);  // compared: the registers hold what is written
  const std::uint32_t epoch = cycle.state().link_epoch;
  const bool is_silent = GENERATE(true, false);
  INFO((is_silent ? "another end of the link answers" : "its registers are cleared in between"));
  if (is_silent) {
    machine.refuse_reads = machine.refuse_writes = true;
    REQUIRE(eventually([&] { return !cycle.state().written; }));
    CHECK(is_same_link(cycle.state().link_epoch, epoch));
  }
  cycle.fixed_epoch = epoch;  // commands for the link before are not sent on another
  for (const int address : {0, 1}) machine.set_holding(address, 0);
  machine.refuse_writes = false;
  std::this_thread::sleep_for(100ms);  // it may be restarting, and is not written unread
  CHECK(int32_of(machine, 0) == 0);
  machine.refuse_reads = false;
  REQUIRE(eventually([&] {
    const ControllerState state = cycle.state();
    return state.online && !is_same_link(state.link_epoch, epoch);
  }));
  CHECK(cycle.state().applied_um[0] == 0.0);
  CHECK(int32_of(machine, 0) == 0);
  cycle.fixed_epoch = 0;
  cycle.want(0, -0.5);
  CHECK(eventually([&] { return cycle.state().written && int32_of(machine, 0) == -50; }));
  link.stop();
}

TEST_CASE("while a read-back is no number, nothing is written", "[controllers]") {
  ModbusMachine machine;
  ModbusControllerConfig config = three_axes(machine.port());
  config.axes[0].applied = at(ModbusTable::input, 20, Encoding::float32);
  ModbusController link(config);
  Cycle cycle(link);
  cycle.want(0, 0.5);
  REQUIRE(eventually([&] { return int32_of(machine, 0) == 50; }));
  machine.set_input(20, 0x7FC0);  // NaN
  REQUIRE(eventually([&] { return std::isnan(cycle.state().applied_um[0]); }));
  const int writes = machine.writes;
  const int reads = machine.reads;
  cycle.want(0, 3.0);
  REQUIRE(eventually([&] { return machine.reads > reads + 20; }));
  CHECK(machine.writes == writes);
  CHECK(int32_of(machine, 0) == 50);
  machine.set_input(20, 0x3F00);  // 0.5
  CHECK(eventually([&] { return int32_of(machine, 0) == 300; }));
  link.stop();
}

TEST_CASE("a controller that applies something else is detected", "[controllers]") {
  ModbusMachine machine;
  machine.mirrored = 6;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link);
  cycle.want(0, 8.0);
  REQUIRE(eventually([&] { return cycle.state().applied_um[0] == Approx(8.0); }));
  machine.mirrored = 0;
  machine.set_input(1, 300);
  REQUIRE(eventually([&] { return cycle.state().applied_um[0] == Approx(3.0); }));
  CHECK(int32_of(machine, 0) == 800);
}

TEST_CASE("a re-homed controller gets no offset computed before the re-homing was seen",
          "[controllers]") {
  ModbusMachine machine;
  machine.mirrored = 6;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link);
  cycle.want(0, 30.0);
  REQUIRE(eventually([&] { return cycle.state().applied_um[0] == Approx(30.0); }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.fixed_epoch = epoch;  // the cycle has not noticed
  machine.mirrored = 0;
  machine.set_input(1, 0);  // the offset is gone, the connection is not
  REQUIRE(eventually([&] { return cycle.state().link_epoch > epoch; }));
  CHECK(cycle.state().applied_um[0] == 0.0);
  const int writes = machine.writes;
  const int reads = machine.reads;
  REQUIRE(eventually([&] { return machine.reads > reads + 20; }));
  CHECK(machine.writes == writes);
}

TEST_CASE("nothing is written without a command of this epoch, not even a heartbeat",
          "[controllers]") {
  ModbusMachine machine;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link, 4711);
  cycle.want(0, 5.0);
  const int reads = machine.reads;
  REQUIRE(eventually([&] { return machine.reads > reads + 20; }));
  CHECK(machine.writes == 0);
  CHECK(machine.holding(heartbeat_at) == 0);
  cycle.fixed_epoch = 0;
  REQUIRE(eventually([&] { return int32_of(machine, 0) == 500; }));
}

TEST_CASE("a power-cycled controller is read back before it is written to", "[controllers]") {
  auto machine = std::make_unique<ModbusMachine>();
  machine->mirrored = 6;
  const int port = machine->port();
  ModbusController link(three_axes(port));
  Cycle cycle(link);
  cycle.want(0, 9.0);
  REQUIRE(eventually([&] { return cycle.state().applied_um[0] == Approx(9.0); }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.fixed_epoch = epoch;  // the cycle has not noticed
  machine.reset();
  REQUIRE(eventually([&] { return !cycle.state().online; }));
  CHECK(cycle.state().link_epoch == epoch);
  CHECK_FALSE(link.health().connected);
  machine = std::make_unique<ModbusMachine>(port);  // all registers 0
  machine->mirrored = 6;
  REQUIRE(eventually([&] { return cycle.state().online; }));
  CHECK(cycle.state().link_epoch > epoch);
  CHECK(cycle.state().applied_um[0] == 0.0);
  REQUIRE(eventually([&] { return machine->reads > 20; }));
  CHECK(machine->writes == 0);
  cycle.fixed_epoch = 0;
  REQUIRE(eventually([&] { return int32_of(*machine, 0) == 900; }));
  CHECK(link.health().connects == 2);
}

TEST_CASE("a failed write begins a new epoch and is not repeated with the old one",
          "[controllers]") {
  ModbusMachine machine;
  machine.mirrored = 6;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link);
  cycle.want(0, 2.0);
  REQUIRE(eventually([&] { return cycle.state().applied_um[0] == Approx(2.0); }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.fixed_epoch = epoch;
  machine.refuse_writes = true;
  cycle.want(0, 4.0);
  REQUIRE(eventually([&] { return cycle.state().link_epoch > epoch; }));
  CHECK(link.health().write_errors >= 1);
  machine.refuse_writes = false;
  const int writes = machine.writes;
  const int reads = machine.reads;
  REQUIRE(eventually([&] { return machine.reads > reads + 20; }));
  CHECK(machine.writes == writes);
  CHECK(int32_of(machine, 0) == 200);
  CHECK(cycle.state().online);
  cycle.fixed_epoch = 0;
  REQUIRE(eventually([&] { return int32_of(machine, 0) == 400; }));
}

TEST_CASE("a controller that refuses writes is online, retried once a period, and not written",
          "[controllers]") {
  ModbusMachine machine;
  machine.mirrored = 6;
  machine.refuse_writes = true;
  ModbusControllerConfig config = three_axes(machine.port());
  config.period_s = 0.1;
  ModbusController link(config);
  Cycle cycle(link);
  cycle.want(0, 2.0);
  REQUIRE(eventually([&] { return link.health().write.refused >= 3; }));
  const int writes = machine.writes;
  const int reads = machine.reads;
  const nanoseconds begun = monotonic_now();
  REQUIRE(eventually([&] {
    CHECK(cycle.state().online);
    CHECK_FALSE(cycle.state().written);
    return machine.writes >= writes + 10;
  }));
  const double periods = 1e-8 * static_cast<double>((monotonic_now() - begun).count());
  CHECK(machine.writes - writes <= periods + 1);
  CHECK(machine.reads - reads <= 3 * periods + 3);
  const ControllerHealth health = link.health();
  CHECK(health.connected);
  CHECK(health.writes == 0);
  CHECK(health.write.unanswered == 0);
  CHECK(health.write.confirmed_at == nanoseconds{});
  CHECK(health.write.function == 16);
  CHECK(health.write.address == 0);
  CHECK(health.write.exception == 4);
  CHECK(health.last_error.find("refuses writes (function 16, register 0): exception 4 (") !=
        std::string::npos);
  machine.refuse_writes = false;
  REQUIRE(eventually([&] { return cycle.state().written; }));
  CHECK(link.health().last_error.empty());
  CHECK(link.health().write.function == 0);
  machine.refuse_writes = true;
  REQUIRE(eventually([&] { return !cycle.state().written; }));
}

TEST_CASE("a controller that ignores writes is online and not written", "[controllers]") {
  ModbusMachine machine;
  machine.mirrored = 6;
  ModbusControllerConfig config = three_axes(machine.port());
  config.line.timeout_ms = 100;
  ModbusController link(config);
  Cycle cycle(link);
  cycle.want(0, 2.0);
  REQUIRE(eventually([&] { return cycle.state().written; }));
  machine.ignore_writes = true;
  REQUIRE(eventually([&] { return link.health().write.unanswered >= 3; }));
  CHECK(cycle.state().online);
  CHECK_FALSE(cycle.state().written);
  CHECK(link.health().write.refused == 0);
  CHECK(link.health().last_error.find("no write is answered (function 16") != std::string::npos);
  machine.ignore_writes = false;
  REQUIRE(eventually([&] { return cycle.state().written; }));
}

TEST_CASE("a controller whose read takes longer than a command is valid is still written to",
          "[controllers]") {
  ModbusMachine machine;
  machine.read_takes = 700ms;
  ModbusControllerConfig config = three_axes(machine.port());
  config.line.timeout_ms = 2000;
  for (ModbusAxis& axis : config.axes) axis.applied.reset();
  for (std::uint16_t i = 0; i < 4; ++i)  // too far apart for one request
    config.signals.push_back(
        {i, at(ModbusTable::input, static_cast<std::uint16_t>(40 * i), Encoding::uint16)});
  ModbusController link(config);
  Cycle cycle(link);
  cycle.want(0, 2.0);
  REQUIRE(eventually([&] { return int32_of(machine, 0) == 200; }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.want(0, 3.0);
  REQUIRE(eventually([&] { return int32_of(machine, 0) == 300; }));
  cycle.want(0, 4.0);
  REQUIRE(eventually([&] { return int32_of(machine, 0) == 400; }));
  CHECK(cycle.state().written);
  CHECK(is_same_link(cycle.state().link_epoch, epoch));
  CHECK(link.health().write.late >= 2);
}

TEST_CASE("an unanswered write is not repeated before another read", "[controllers]") {
  ModbusMachine machine;
  machine.mirrored = 6;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link);
  cycle.want(0, 30.0);
  REQUIRE(eventually([&] { return cycle.state().applied_um[0] == Approx(30.0); }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.fixed_epoch = epoch;
  machine.restart_on_write = true;
  REQUIRE(eventually([&] { return !machine.restart_on_write; }));
  const int writes = machine.writes;
  REQUIRE(eventually([&] { return cycle.state().link_epoch > epoch; }));
  CHECK(cycle.state().applied_um[0] == 0.0);
  CHECK(machine.writes == writes);
}

TEST_CASE("a controller that cannot be read is offline and not written to", "[controllers]") {
  ModbusMachine machine;
  machine.refuse_reads = true;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link);
  cycle.want(0, 2.0);
  REQUIRE(eventually([&] { return link.health().read_errors >= 3; }));
  CHECK_FALSE(cycle.state().online);
  CHECK(cycle.state().link_epoch == 0);
  CHECK(machine.writes == 0);
  CHECK(link.health().last_error.find("exception 4") != std::string::npos);
  machine.refuse_reads = false;
  REQUIRE(eventually([&] { return int32_of(machine, 0) == 200; }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  machine.refuse_reads = true;
  REQUIRE(eventually([&] { return !cycle.state().online; }));
  machine.refuse_reads = false;
  REQUIRE(eventually([&] { return cycle.state().online; }));
  CHECK(cycle.state().link_epoch > epoch);
}

TEST_CASE("the heartbeat stops with the cycle, and its return is a new epoch", "[controllers]") {
  ModbusMachine machine;
  ModbusController link(three_axes(machine.port()));
  Cycle cycle(link);
  cycle.want(0, 6.0);
  REQUIRE(eventually([&] { return machine.holding(heartbeat_at) > 0; }));
  const std::uint32_t epoch = cycle.state().link_epoch;
  cycle.hung = true;
  std::uint16_t last = 0;
  REQUIRE(eventually([&] {  // no beat between two checks 300 ms (15 periods) apart
    last = machine.holding(heartbeat_at);
    std::this_thread::sleep_for(300ms);
    return machine.holding(heartbeat_at) == last;
  }));
  CHECK(cycle.state().online);  // still read
  std::this_thread::sleep_for(1200ms);
  CHECK(machine.holding(heartbeat_at) == last);
  cycle.hung = false;
  REQUIRE(eventually([&] { return machine.holding(heartbeat_at) != last; }));
  CHECK(cycle.state().link_epoch > epoch);
}

TEST_CASE("at its end the link writes the newest command once more and nothing else",
          "[controllers]") {
  ModbusMachine machine;
  ModbusControllerConfig config = three_axes(machine.port());
  config.period_s = 30.0;  // its own next write is far away
  ModbusController link(config);
  link.start();
  ControllerState state;
  REQUIRE(eventually([&] {
    link.newest(state);
    return state.online;
  }));
  // The first exchange, which looks for a command too, is over.
  int reads = -1;
  REQUIRE(eventually([&] {
    const int before = std::exchange(reads, machine.reads);
    std::this_thread::sleep_for(300ms);
    return machine.reads == before;
  }));
  OffsetCommand command;
  command.link_epoch = state.link_epoch;
  command.read_back_number = state.read_back_number;
  command.offset_um[0] = 1.5;
  command.valid[0] = true;
  link.offer(command);
  link.stop();
  CHECK(machine.writes >= 1);
  CHECK(int32_of(machine, 0) == 150);
  CHECK(machine.holding(valid_bits_at) == 1);
}

TEST_CASE("a controller that never answers does not delay the end and is not written",
          "[controllers]") {
  ModbusMachine machine;
  machine.mute = true;
  ModbusControllerConfig config = three_axes(machine.port());
  config.line.timeout_ms = 60'000;
  ModbusController link(config);
  link.start();
  REQUIRE(eventually([&] { return machine.reads > 0; }));
  const nanoseconds before = monotonic_now();
  link.stop();
  CHECK(monotonic_now() - before < 10s);  // the time-out is a minute
  CHECK(machine.writes == 0);
}

TEST_CASE("a missing controller is retried for ever", "[controllers]") {
  int port = 0;
  {
    const ModbusMachine machine;
    port = machine.port();
  }
  ModbusController link(three_axes(port));
  link.start();
  REQUIRE(eventually([&] { return !link.health().last_error.empty(); }));
  const ModbusMachine machine(port);
  REQUIRE(eventually([&] { return link.health().connected; }));
  CHECK(link.health().last_error.empty());
}

TEST_CASE("an invalid Modbus controller is refused", "[controllers]") {
  const auto refused = [](auto change) {
    ModbusControllerConfig bad = three_axes(502);
    CHECK_NOTHROW(ModbusController(bad));
    change(bad);
    CHECK_THROWS_AS(ModbusController(bad), InvalidValue);
  };
  refused([](auto& bad) { bad.axes[1].offset.address = 1; });  // half of axis 0
  refused([](auto& bad) { bad.axes[0].offset.table = ModbusTable::input; });
  refused([](auto& bad) { bad.axes[0].offset.scale = 0.0; });
  refused([](auto& bad) { bad.axes[0].offset.address = 65535; });  // two registers
  refused([](auto& bad) { bad.period_s = 0.0; });
  refused([](auto& bad) {
    bad.signals = {{signals_max, at(ModbusTable::input, 0, Encoding::int16)}};
  });
  refused([](auto& bad) { bad.axes.resize(17, bad.axes[0]); });
  ModbusControllerConfig nowhere = three_axes(502);
  nowhere.line.link = ModbusTcp{"", 502};
  CHECK_THROWS_AS(ModbusController(nowhere), DriverError);
}
