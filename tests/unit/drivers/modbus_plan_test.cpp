#include <map>
#include <random>
#include <set>
#include <tuple>

#include <catch2/catch.hpp>

#include "drivers/modbus/late_answers.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "drivers/sensors/modbus_poller.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

ModbusChannel channel_at(int address, Encoding encoding = Encoding::int16,
                         ModbusTable table = ModbusTable::input) {
  ModbusChannel channel;
  channel.table = table;
  channel.address = static_cast<std::uint16_t>(address);
  channel.encoding = encoding;
  return channel;
}

ModbusDeviceConfig random_device(std::mt19937& random) {
  const auto pick = [&random](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(random);
  };
  ModbusDeviceConfig device;
  device.registers_per_request_max = pick(4, 125);
  device.gap_registers_max = pick(0, 20);
  device.one_register_a_request = pick(0, 4) == 0;
  const int span = pick(10, 3000);
  const int count = pick(1, 60);
  for (int i = 0; i < count; ++i) {
    auto channel = channel_at(pick(0, span), static_cast<Encoding>(pick(0, 5)),
                              static_cast<ModbusTable>(pick(0, 3)));
    if (pick(0, 3) == 0) {
      channel.status.emplace();
      channel.status->table = static_cast<ModbusTable>(pick(0, 3));
      channel.status->address = static_cast<std::uint16_t>(pick(0, span));
    }
    device.channels.push_back(channel);
  }
  if (pick(0, 2) == 0) device.renewal = ModbusRenewal{ModbusTable::input, 5};
  return device;
}

/// The words of a table that are needed.
std::set<std::tuple<ModbusTable, int>> wanted_words(const ModbusDeviceConfig& device) {
  std::set<std::tuple<ModbusTable, int>> wanted;
  const auto want = [&wanted](ModbusTable table, int address, std::size_t words) {
    for (int i = 0; i < static_cast<int>(words); ++i) wanted.emplace(table, address + i);
  };
  for (const ModbusChannel& channel : device.channels) {
    want(channel.table, channel.address, words_of(channel.table, channel.encoding));
    if (channel.status) want(channel.status->table, channel.status->address, 1);
  }
  if (device.renewal) want(device.renewal->table, device.renewal->address, 1);
  return wanted;
}

void check_place(const ModbusPlan& plan, const WordPlace& place, ModbusTable table, int address,
                 std::size_t words) {
  REQUIRE(place.request < plan.requests.size());
  const PlannedRequest& request = plan.requests[place.request];
  CHECK(request.table == table);
  CHECK(static_cast<std::size_t>(request.address) + place.offset ==
        static_cast<std::size_t>(address));
  CHECK(place.offset + words <= request.count);
}

void check_gaps(const ModbusPlan& plan, const ModbusDeviceConfig& device) {
  const auto wanted = wanted_words(device);
  for (const PlannedRequest& request : plan.requests) {
    const int gap_max = device.one_register_a_request ? 0
                        : is_bit_table(request.table) ? 16 * device.gap_registers_max
                                                      : device.gap_registers_max;
    int gap = 0;
    for (int i = 0; i < request.count; ++i) {
      gap = wanted.contains({request.table, request.address + i}) ? 0 : gap + 1;
      REQUIRE(gap <= gap_max);
    }
    CHECK(gap == 0);
    CHECK(wanted.contains({request.table, int{request.address}}));
  }
}

}  // namespace

TEST_CASE("every value is read as a whole, within limits and gaps", "[plan][property]") {
  const unsigned seed = GENERATE(range(0U, 300U));
  CAPTURE(seed);
  std::mt19937 random(seed);
  const ModbusDeviceConfig device = random_device(random);
  const ModbusPlan plan = plan_requests(device, 60);
  REQUIRE(plan.channels.size() == device.channels.size());
  for (std::size_t i = 0; i < device.channels.size(); ++i) {
    const ModbusChannel& channel = device.channels[i];
    check_place(plan, plan.channels[i].value, channel.table, channel.address,
                words_of(channel.table, channel.encoding));
    REQUIRE(plan.channels[i].status.has_value() == channel.status.has_value());
    if (channel.status) {
      check_place(plan, *plan.channels[i].status, channel.status->table, channel.status->address,
                  1);
    }
  }
  for (const PlannedRequest& request : plan.requests) {
    const int limit = is_bit_table(request.table) ? bits_per_request_limit
                                                  : std::min(device.registers_per_request_max, 60);
    CHECK(request.count >= 1);
    CHECK(request.count <= limit);
    if (device.one_register_a_request) CHECK(request.count <= 4);
  }
  check_gaps(plan, device);
  REQUIRE(plan.renewal.has_value() == device.renewal.has_value());
  if (plan.renewal) {
    CHECK(plan.renewal->request == 0);
    check_place(plan, *plan.renewal, device.renewal->table, device.renewal->address, 1);
  }
}

TEST_CASE("neighbours share a request, distant values do not", "[plan]") {
  ModbusDeviceConfig device;
  device.gap_registers_max = 3;
  device.channels = {channel_at(0), channel_at(4), channel_at(9), channel_at(100)};
  const ModbusPlan plan = plan_requests(device);
  REQUIRE(plan.requests.size() == 3);  // 0..4 with a gap of 3; 9 is 4 away; 100
  CHECK(plan.requests[0].count == 5);
  CHECK(plan.channels[1].value.offset == 4);
}

TEST_CASE("with one register per request every value has its own request", "[plan]") {
  ModbusDeviceConfig device;
  device.one_register_a_request = true;
  device.channels = {channel_at(0, Encoding::float32), channel_at(2, Encoding::float32),
                     channel_at(4), channel_at(4)};
  const ModbusPlan plan = plan_requests(device);
  REQUIRE(plan.requests.size() == 3);  // the same register is not read twice
  CHECK(plan.requests[0].count == 2);
  CHECK(plan.requests[2].count == 1);
}

TEST_CASE("a register of 32 bits is one address and two words", "[plan]") {
  ModbusDeviceConfig device;
  device.wide_registers = true;
  device.channels = {channel_at(10), channel_at(11), channel_at(14)};
  for (ModbusChannel& channel : device.channels) channel.encoding = Encoding::float32;
  device.channels[0].status = ModbusStatus{ModbusTable::input, 12, 0xFFFF, {}};
  const ModbusPlan plan = plan_requests(device);
  REQUIRE(plan.requests.size() == 1);
  CHECK(plan.words_a_register == 2);
  CHECK(plan.requests[0].address == 10);
  CHECK(plan.requests[0].count == 5);
  CHECK(plan.channels[1].value.offset == 2);
  CHECK(plan.channels[2].value.offset == 8);
  CHECK(plan.channels[0].status->offset == 5);  // its low word
}

TEST_CASE("back-off doubles up to its limit and an answer ends it at once", "[backoff]") {
  UnitBackoff backoff(1s);
  CHECK_FALSE(backoff.dead());
  std::chrono::nanoseconds now = 100s;
  std::vector<std::chrono::nanoseconds> pauses;
  for (int i = 0; i < 8; ++i) {
    backoff.failed(now, 1ms, 1, 30s);
    pauses.push_back(backoff.not_before() - now);
    now = backoff.not_before();
  }
  CHECK(pauses == std::vector<std::chrono::nanoseconds>{1s, 2s, 4s, 8s, 16s, 30s, 30s, 30s});
  backoff.answered();
  CHECK_FALSE(backoff.dead());
  CHECK(backoff.not_before() == 0s);
  backoff.failed(now, 1ms, 1, 30s);
  CHECK(backoff.not_before() - now == 1s);
}

TEST_CASE("dead units keep to their share of the line", "[backoff]") {
  UnitBackoff backoff(1s);
  const auto cost = 200ms;
  backoff.failed(0s, cost, 1, 30s);
  CHECK(backoff.not_before() == 1s);  // a short outage is noticed soon
  backoff.failed(0s, cost, 1, 30s);
  CHECK(backoff.not_before() == 2s);
  backoff.failed(0s, cost, 1, 30s);
  CHECK(backoff.not_before() == 10s);  // 200 ms in 10 s are 2 %
  backoff.failed(0s, cost, 8, 30s);
  CHECK(backoff.not_before() == 54s);  // 80 s would be 2 %, but no unit waits longer
}

namespace {
constexpr ModbusQuestion question{4, 10, 4};
}

TEST_CASE("a unit with an outstanding answer is not asked, longer each time", "[late]") {
  LateAnswers late;
  CHECK(late.ready_at(question) == 0s);
  late.unanswered(question, 10s, 10200ms);
  CHECK(late.ready_at(question) == 11200ms);
  late.unanswered(question, 11200ms, 11400ms);
  CHECK(late.ready_at(question) == 13400ms);
}

TEST_CASE("an answer while others are outstanding may be one of theirs: the last is waited for",
          "[late]") {
  LateAnswers late;
  late.unanswered(question, 10s, 10200ms);    // sent at 10.0
  late.answered(11200ms, 11300ms);            // arrives at 11.3: may be 1.3 s late
  CHECK(late.ready_at(question) == 12600ms);  // so the answer to 11.2 comes by 12.5
  late.answered(12600ms, 12610ms);
  CHECK(late.ready_at(question) == 12600ms);  // nothing outstanding any more
}

TEST_CASE("a request that the outstanding answer would fit waits until it cannot come any more",
          "[late]") {
  const ModbusQuestion other{4, 20, 4};
  LateAnswers late;
  late.unanswered(question, 10s, 10200ms);
  CHECK(late.ready_at(question) == 11200ms);
  CHECK(late.ready_at(other) == 13s);
  // With another function or length in the answer there is no need to wait.
  CHECK(late.ready_at({4, 20, 6}) == 11200ms);
  CHECK(late.ready_at({3, 20, 4}) == 11200ms);
  CHECK(late.ready_at({16, 20, 4}) == 11200ms);
  // The first of two answers came: the second may be later still.
  late.answered(11200ms, 11300ms);
  CHECK(late.ready_at(question) == 12600ms);
  CHECK(late.ready_at(other) == 14200ms);
}

TEST_CASE("after a bad frame the true answer may come late too", "[late]") {
  const ModbusQuestion other{4, 20, 4};
  LateAnswers late;
  late.spoiled(question, 10s, 300ms);  // from an unknown sender
  CHECK(late.ready_at(question) == 10300ms);
  CHECK(late.ready_at(other) == 13s);
  late.answered(10300ms, 10400ms);
  CHECK(late.ready_at(other) == 13300ms);
  late.answered(13300ms, 13310ms);
  CHECK(late.ready_at(other) == 13300ms);
}

TEST_CASE("a unit back after a long time is not delayed", "[late]") {
  LateAnswers late;
  late.unanswered(question, 10s, 10200ms);
  late.answered(100s, 100010ms);
  CHECK(late.ready_at(question) <= 100s);
}
