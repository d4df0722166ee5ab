// Parts of the controller links that need no bus.
#include <chrono>
#include <cmath>

#include <catch2/catch.hpp>

#include "drivers/bus.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/controllers/kinds/can/can_controller.hpp"
#include "drivers/controllers/kinds/make_controller.hpp"
#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"
#include "estimator/checks.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

OffsetCommand of_epoch(std::uint32_t epoch) {
  OffsetCommand command;
  command.link_epoch = epoch;
  return command;
}

ModbusValue value_at(ModbusTable table, std::uint16_t address,
                     Encoding encoding = Encoding::int16) {
  ModbusValue value;
  value.table = table;
  value.address = address;
  value.encoding = encoding;
  return value;
}

CanSignal can_signal(std::uint32_t id, int start, int length) {
  CanSignal signal;
  signal.id = id;
  signal.start_bit = start;
  signal.length_bits = length;
  return signal;
}

}  // namespace

TEST_CASE("only commands of the newest epoch may be sent", "[controllers]") {
  WriteGate gate(100ms);
  gate.offered(of_epoch(0), 0s);
  CHECK(gate.verdict(0s) == SendVerdict::nothing_to_send);
  CHECK(gate.synchronised() == 1);
  CHECK(gate.verdict(0s) == SendVerdict::nothing_to_send);
  gate.offered(of_epoch(1), 0s);
  CHECK(gate.verdict(0s) == SendVerdict::send);
  gate.lost();
  CHECK(gate.verdict(0s) == SendVerdict::nothing_to_send);
  CHECK(gate.synchronised() == 2);
  CHECK(gate.verdict(0s) == SendVerdict::nothing_to_send);
  gate.offered(of_epoch(2), 0s);
  CHECK(gate.verdict(0s) == SendVerdict::send);
}

TEST_CASE("a pause of a link and another link have distinguishable epochs", "[controllers]") {
  WriteGate gate(100ms);
  const std::uint32_t first = gate.synchronised();
  const std::uint32_t looked_again = gate.synchronised();
  CHECK(looked_again != first);
  CHECK(is_same_link(first, looked_again));
  gate.paused();
  CHECK_FALSE(gate.in_sync());
  const std::uint32_t paused = gate.synchronised();
  CHECK(paused != looked_again);
  CHECK(is_same_link(first, paused));
  gate.lost();
  gate.paused();  // now lost
  CHECK_FALSE(is_same_link(first, gate.synchronised()));
}

TEST_CASE("epochs stay unique after a million links", "[controllers]") {
  WriteGate gate(100ms);
  std::uint32_t before = 0;
  for (std::uint32_t i = 0; i < 3 * epochs_of_a_link / 2; ++i) {
    gate.lost();
    const std::uint32_t epoch = gate.synchronised();
    if (epoch == 0 || is_same_link(epoch, before) || (i > 0 && epoch == 1)) FAIL("epoch " << epoch);
    before = epoch;
  }
}

TEST_CASE("a command computed more than two seconds ago is not sent", "[controllers]") {
  WriteGate gate(100ms);
  gate.synchronised();
  gate.offered(of_epoch(1), 10s);
  CHECK(gate.verdict(12s) == SendVerdict::send);
  CHECK(gate.verdict(12s + 1ns) == SendVerdict::nothing_to_send);
}

TEST_CASE("written() is a recent confirmation on this link", "[controllers]") {
  WriteGate gate(100ms);
  gate.synchronised();
  gate.sent(100s);
  CHECK_FALSE(gate.written(100s));  // on its way is not confirmed
  gate.confirmed(100s);
  CHECK(gate.written(101s));
  CHECK_FALSE(gate.written(101s + 1ns));
  gate.paused();
  CHECK(gate.written(101s));  // a refused write does not undo the one before
  gate.lost();
  CHECK_FALSE(gate.written(100s));
  gate.synchronised();
  CHECK_FALSE(gate.written(100s));
}

TEST_CASE("a controller whose exchange takes seconds is waited for", "[controllers]") {
  WriteGate gate(100ms);
  gate.synchronised();
  gate.note_exchange_time(2300ms);
  gate.offered(of_epoch(1), 100s);
  gate.sent(100s);
  gate.confirmed(100s);
  gate.offered(of_epoch(1), 102s);
  CHECK(gate.verdict(102300ms) == SendVerdict::send);
  CHECK(gate.written(104600ms));
  CHECK_FALSE(gate.written(104601ms));
  gate.offered(of_epoch(1), 104s);
  CHECK(gate.verdict(104601ms) == SendVerdict::resynchronise);
}

TEST_CASE("a long pause between two writes requires a new epoch", "[controllers]") {
  const auto verdict_after = [](nanoseconds period, nanoseconds pause) {
    WriteGate gate(period);
    gate.synchronised();
    gate.offered(of_epoch(1), 100s);
    gate.sent(100s);
    gate.offered(of_epoch(1), 100s + pause);
    return gate.verdict(100s + pause);
  };
  CHECK(verdict_after(100ms, 1s) == SendVerdict::send);
  CHECK(verdict_after(100ms, 1s + 1ns) == SendVerdict::resynchronise);
  CHECK(verdict_after(1s, 5s) == SendVerdict::send);
  CHECK(verdict_after(1s, 5s + 1ns) == SendVerdict::resynchronise);
}

TEST_CASE("the wait for the first command of an epoch does not count as a pause", "[controllers]") {
  WriteGate gate(100ms);
  gate.synchronised();
  gate.offered(of_epoch(1), 1000s);
  CHECK(gate.verdict(1000s) == SendVerdict::send);
  gate.sent(1000s);
  gate.lost();
  gate.synchronised();
  gate.offered(of_epoch(2), 2000s);
  CHECK(gate.verdict(2000s) == SendVerdict::send);
}

TEST_CASE("the first command of an epoch is looked for early, a few times", "[controllers]") {
  WriteGate gate(100ms);
  CHECK(gate.next_pause() == 100ms);
  gate.synchronised();
  for (int look = 0; look < WriteGate::first_looks; ++look) CHECK(gate.next_pause() == 25ms);
  CHECK(gate.next_pause() == 100ms);
  gate.synchronised();
  CHECK(gate.next_pause() == 25ms);
  gate.offered(of_epoch(gate.epoch()), 1s);
  gate.sent(1s);
  CHECK(gate.next_pause() == 100ms);
}

TEST_CASE("an axis on its way to an offset sent lately is explained, one elsewhere is not",
          "[controllers]") {
  WriteGate gate(100ms, {0.01});
  static_cast<void>(gate.synchronised());
  std::array<double, axes_max> applied_um{};
  applied_um.fill(not_a_number);
  applied_um[0] = 10.0;
  CHECK(gate.check_read_back(applied_um));
  const auto send = [&](double offset_um) {
    OffsetCommand command = of_epoch(gate.epoch());
    command.offset_um[0] = offset_um;
    command.valid[0] = true;
    gate.offered(command, 0s);
    gate.sent(0s);
  };
  send(14.0);
  send(12.0);
  applied_um[0] = 13.9;  // late: still at an earlier offset
  CHECK(gate.check_read_back(applied_um));
  applied_um[0] = 11.0;
  CHECK(gate.check_read_back(applied_um));
  CHECK(gate.verdict(0s) == SendVerdict::send);
  applied_um[0] = not_a_number;
  CHECK(gate.check_read_back(applied_um));
  CHECK(gate.verdict(0s) == SendVerdict::nothing_to_send);
  const OffsetCommand driven = gate.command();
  gate.offered(of_epoch(gate.epoch()), 0s);  // the axis is not driven: the others are written
  CHECK(gate.verdict(0s) == SendVerdict::send);
  gate.offered(driven, 0s);
  applied_um[0] = 11.0;
  CHECK(gate.check_read_back(applied_um));
  CHECK(gate.verdict(0s) == SendVerdict::send);
  applied_um[0] = not_a_number;
  CHECK(gate.check_read_back(applied_um));
  applied_um[0] = 0.0;  // re-homed meanwhile
  CHECK_FALSE(gate.check_read_back(applied_um));
  // A new epoch starts from there.
  static_cast<void>(gate.synchronised());
  CHECK(gate.check_read_back(applied_um));
}

TEST_CASE("a command computed before an axis moved elsewhere is not sent", "[controllers]") {
  WriteGate gate(100ms);
  std::array<double, axes_max> applied_um{};
  applied_um.fill(not_a_number);
  applied_um[0] = 20.0;
  static_cast<void>(gate.synchronised(applied_um));
  OffsetCommand command = of_epoch(gate.epoch());
  command.offset_um[0] = 20.0;
  command.valid[0] = true;
  command.read_back_number = gate.read_back_number();
  CHECK(gate.check_read_back(applied_um));
  applied_um[0] = 0.0;  // re-homed; no command of this epoch yet
  CHECK(gate.check_read_back(applied_um));
  gate.offered(command, 0s);
  CHECK(gate.verdict(0s) == SendVerdict::resynchronise);
  CHECK(gate.check_read_back(applied_um));
  CHECK(gate.verdict(0s) == SendVerdict::resynchronise);
  command.offset_um[0] = 0.0;
  command.read_back_number = gate.read_back_number();
  gate.offered(command, 0s);
  CHECK(gate.verdict(0s) == SendVerdict::send);
  gate.sent(0s);
  gate.offered(command, 0s);
  CHECK(gate.verdict(0s) == SendVerdict::send);
}

TEST_CASE("an axis that was never sent an offset is always explained", "[controllers]") {
  WriteGate gate(100ms);
  static_cast<void>(gate.synchronised());
  std::array<double, axes_max> applied_um{};
  CHECK(gate.check_read_back(applied_um));
  applied_um[3] = 200.0;
  CHECK(gate.check_read_back(applied_um));
}

TEST_CASE("neighbours are read in one request, distant registers are not", "[controllers]") {
  const std::vector<ModbusValue> values{
      value_at(ModbusTable::input, 26),
      value_at(ModbusTable::input, 0, Encoding::int32),
      value_at(ModbusTable::discrete_input, 5),
      value_at(ModbusTable::input, 10, Encoding::float32),  // 8 unused registers after the first
      value_at(ModbusTable::discrete_input, 3),
      value_at(ModbusTable::input, 21),  // 9 unused registers after 10..11
  };
  const ReadPlan plan = plan_reads(values, {});
  REQUIRE(plan.requests.size() == 3);
  CHECK(plan.requests[0].table == ModbusTable::discrete_input);
  CHECK(plan.requests[0].address == 3);
  CHECK(plan.requests[0].count == 3);
  CHECK(plan.requests[1].address == 0);
  CHECK(plan.requests[1].count == 12);
  CHECK(plan.requests[2].address == 21);
  CHECK(plan.requests[2].count == 6);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const ReadRequest& request = plan.requests[plan.places[i].request];
    CHECK(request.table == values[i].table);
    CHECK(request.address + plan.places[i].word == values[i].address);
  }
}

TEST_CASE("gaps and request sizes follow the configuration", "[controllers]") {
  const std::vector<ModbusValue> values{value_at(ModbusTable::input, 0),
                                        value_at(ModbusTable::input, 4),
                                        value_at(ModbusTable::input, 5)};
  ModbusControllerConfig config;
  CHECK(plan_reads(values, config).requests.size() == 1);
  config.gap_registers_max = 0;
  CHECK(plan_reads(values, config).requests.size() == 2);
  config.registers_per_request_max = 1;
  CHECK(plan_reads(values, config).requests.size() == 3);
  config.write_function = ModbusControllerConfig::one_register;
  CHECK(join_writes({{0, WriteStage::offset, {1}}, {1, WriteStage::offset, {2}}},
                    config.registers_per_write())
            .size() == 2);
}

TEST_CASE("no read request is larger than the protocol allows", "[controllers]") {
  std::vector<ModbusValue> values;
  for (std::uint16_t i = 0; i < 200; ++i) {
    values.push_back(
        value_at(ModbusTable::holding, static_cast<std::uint16_t>(2 * i), Encoding::int32));
  }
  for (const ReadRequest& request : plan_reads(values, {}).requests) CHECK(request.count <= 125);
  CHECK(plan_reads(values, {}).requests.size() == 4);
  CHECK(plan_reads({}, {}).requests.empty());
}

TEST_CASE("adjacent registers are written together, others are not touched", "[controllers]") {
  const auto requests = join_writes({{11, WriteStage::heartbeat, {9}},
                                     {2, WriteStage::offset, {3, 4}},
                                     {0, WriteStage::offset, {1, 2}},
                                     {10, WriteStage::valid_bits, {7}},
                                     {20, WriteStage::offset, {5, 6}}},
                                    123);
  REQUIRE(requests.size() == 3);
  CHECK(requests[0].address == 0);
  CHECK(requests[0].words == std::vector<std::uint16_t>{1, 2, 3, 4});
  CHECK(requests[1].address == 20);
  CHECK(requests[2].address == 10);
  CHECK(requests[2].words == std::vector<std::uint16_t>{7, 9});
}

TEST_CASE("the heartbeat is written after the offsets it confirms", "[controllers]") {
  const auto requests = join_writes({{0, WriteStage::heartbeat, {1}},
                                     {2, WriteStage::valid_bits, {1}},
                                     {4, WriteStage::offset, {1}},
                                     {6, WriteStage::offset, {1}}},
                                    123);
  REQUIRE(requests.size() == 4);
  CHECK(requests[0].address == 4);
  CHECK(requests[1].address == 6);
  CHECK(requests[2].address == 2);
  CHECK(requests[3].address == 0);
  std::vector<WriteField> many;
  for (std::uint16_t i = 0; i < 200; ++i) many.push_back({i, WriteStage::offset, {i}});
  const auto split = join_writes(many, 123);
  REQUIRE(split.size() == 2);
  CHECK(split[0].words.size() == 123);
  CHECK(split[1].address == 123);
}

TEST_CASE("a dry run applies and shows the offered offsets", "[controllers]") {
  const auto link = make_controller(DryRunControllerConfig{"bench", 2});
  ControllerState state;
  link->newest(state);
  CHECK_FALSE(state.online);
  CHECK(state.link_epoch == 0);
  link->start();
  link->newest(state);
  CHECK(state.online);
  CHECK(state.link_epoch == 1);
  CHECK(state.applied_um[0] == 0.0);
  CHECK(state.applied_um[1] == 0.0);
  CHECK(std::isnan(state.applied_um[2]));

  OffsetCommand command = of_epoch(1);
  command.offset_um = {3.0, -4.0, 5.0};
  command.valid = {true, true, true};
  link->offer(command);
  command.offset_um = {1.0, 7.0};
  command.valid = {true, false};
  link->newest(state);
  CHECK(state.applied_um[1] == -4.0);
  CHECK(std::isnan(state.applied_um[2]));
  link->offer(command);
  link->newest(state);
  CHECK(state.applied_um[0] == 1.0);
  CHECK(state.applied_um[1] == -4.0);
  command.link_epoch = 2;
  command.offset_um[0] = 9.0;
  link->offer(command);
  link->newest(state);
  CHECK(state.applied_um[0] == 1.0);
  CHECK(link->health().writes == 0);  // nothing is written
  link->stop();
  link->newest(state);
  CHECK_FALSE(state.online);
}

namespace {

/// A link with a given state that records whether it was offered anything.
class ShownLink final : public ControllerLink {
 public:
  ShownLink(ControllerState& shown, int& offers) : shown_(shown), offers_(offers) {}
  void start() override {}
  void stop() noexcept override {}
  void newest(ControllerState& state) noexcept override { state = shown_; }
  void offer(const OffsetCommand&) noexcept override { ++offers_; }
  [[nodiscard]] ControllerHealth health() const override {
    ControllerHealth health;
    health.kind = "shown";
    return health;
  }

 private:
  ControllerState& shown_;
  int& offers_;
};

}  // namespace

TEST_CASE("a dry run passes on the controller's state and never offers it anything",
          "[controllers]") {
  ControllerState shown;
  int offers = 0;
  DryRunController link({"cnc", 1}, std::make_unique<ShownLink>(shown, offers));
  link.start();
  ControllerState state;
  link.newest(state);
  CHECK_FALSE(state.online);
  shown.online = true;
  shown.link_epoch = 3;
  shown.taken_at = 1s;
  shown.applied_um[0] = 40.0;
  shown.signals[0] = 250.0;
  link.newest(state);
  CHECK(state.online);
  CHECK(state.link_epoch == 3);
  CHECK(state.signals[0] == 250.0);
  CHECK(state.applied_um[0] == 0.0);  // what it would apply, not what the controller applies
  CHECK(link.health().shown_um->at(0) == 40.0);
  CHECK(link.health().kind == "shown");

  OffsetCommand command = of_epoch(3);
  command.offset_um[0] = 5.0;
  command.valid[0] = true;
  link.offer(command);
  link.newest(state);
  CHECK(state.applied_um[0] == 0.0);  // no read-back since
  shown.taken_at = 2s;
  link.newest(state);
  CHECK(state.applied_um[0] == 5.0);
  command = of_epoch(2);
  command.offset_um[0] = 9.0;
  command.valid[0] = true;
  link.offer(command);
  shown.taken_at = 3s;
  link.newest(state);
  CHECK(state.applied_um[0] == 5.0);  // of another epoch
  link.stop();
  CHECK(offers == 0);
}

TEST_CASE("an invalid CAN controller is refused", "[controllers][can]") {
  CanControllerConfig good;
  good.name = "cnc";
  good.interface = "can0";
  good.axes = {{can_signal(0x100, 0, 16), can_signal(0x200, 0, 16)},
               {can_signal(0x100, 16, 16), can_signal(0x200, 16, 16)}};
  good.valid_bits = can_signal(0x100, 32, 8);
  good.heartbeat = can_signal(0x100, 40, 8);
  CHECK_NOTHROW(CanController(good));
  const auto refused = [&good](auto change) {
    CanControllerConfig bad = good;
    change(bad);
    CHECK_THROWS_AS(CanController(bad), InvalidValue);
  };
  refused([](auto& bad) { bad.axes[1].offset.start_bit = 15; });
  refused([](auto& bad) { bad.axes[1].applied->id = 0x100; });
  refused([](auto& bad) { bad.axes[1].offset.start_bit = 60; });
  refused([](auto& bad) { bad.valid_bits->length_bits = 1; });
  refused([](auto& bad) { bad.interface = ""; });
  refused([](auto& bad) { bad.period_s = -1.0; });
}

TEST_CASE("a controller that moves between read-back and first command is detected",
          "[controllers][gate]") {
  WriteGate gate(100ms);
  std::array<double, axes_max> applied_um{};
  applied_um[0] = 23.0;
  OffsetCommand command;
  command.link_epoch = gate.synchronised(applied_um);
  command.read_back_number = gate.read_back_number();
  command.offset_um[0] = 23.1;
  command.valid[0] = true;
  gate.offered(command, 1s);
  CHECK(gate.check_read_back(applied_um));
  applied_um[0] = -11.0;  // re-homed before the first command of this epoch
  CHECK_FALSE(gate.check_read_back(applied_um));
  CHECK_FALSE(gate.check_read_back(applied_um));  // nor the next time
  // An axis that is not to be driven is always explained.
  command.link_epoch = gate.synchronised(applied_um);
  command.valid[0] = false;
  gate.offered(command, 2s);
  applied_um[0] = 5.0;
  CHECK(gate.check_read_back(applied_um));
}

TEST_CASE("a CAN controller reports at its start that the system has no CAN",
          "[controllers][can]") {
  if (can_unavailable().empty()) {
    WARN("this system has CAN: nothing to see here");
    return;
  }
  CanControllerConfig config;
  config.name = "cnc";
  config.interface = "can0";
  CanController link(config);
  CHECK_THROWS_AS(link.start(), DriverError);
  link.stop();
}
