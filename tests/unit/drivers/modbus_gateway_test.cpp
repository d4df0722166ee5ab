// A gateway that serves its units one after the other, with the poller, in virtual time.
#include <deque>
#include <map>

#include <catch2/catch.hpp>

#include "drivers/sensors/modbus_poller.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

/// One request at a time; for a dead unit it waits and then answers with exception 11, or not at
/// all. Each register holds 7.
class Gateway final : public ModbusPort {
 public:
  nanoseconds waits_for{1s};
  bool drops_what_waits{false};                               ///< requests during the wait are lost
  std::map<int, std::pair<nanoseconds, nanoseconds>> silent;  ///< from, until
  std::map<int, std::vector<nanoseconds>> asked;

  [[nodiscard]] nanoseconds now() const noexcept override { return clock_; }
  bool open(std::string& /*why*/) override {
    clock_ += 1ms;
    return true;
  }
  void close() noexcept override { answers_.clear(); }
  bool send(std::span<const std::uint8_t> bytes) noexcept override {
    clock_ += 100us;
    const int unit = bytes[6];
    asked[unit].push_back(clock_);
    if (drops_what_waits && clock_ < busy_until_) return true;
    const auto found = silent.find(unit);
    const bool is_silent =
        found != silent.end() && clock_ >= found->second.first && clock_ < found->second.second;
    busy_until_ = std::max(clock_, busy_until_) + (is_silent ? waits_for : nanoseconds{10ms});
    std::vector<std::uint8_t> answer(bytes.begin(), bytes.begin() + 8);
    if (is_silent) {
      answer[5] = 3;
      answer[7] |= 0x80;
      answer.push_back(11);
    } else {
      answer[5] = 5;
      answer.insert(answer.end(), {2, 0, 7});
    }
    answers_.emplace_back(busy_until_, answer);
    return true;
  }
  PortWait wait_for_input(nanoseconds deadline) noexcept override {
    if (!answers_.empty() && answers_.front().first <= deadline) {
      clock_ = std::max(clock_, answers_.front().first);
      return PortWait::ready;
    }
    clock_ = std::max(clock_, deadline);
    return PortWait::late;
  }
  PortBytes receive(std::span<std::uint8_t> into) noexcept override {
    if (answers_.empty() || answers_.front().first > clock_) return {};
    const auto answer = answers_.front().second;
    answers_.pop_front();
    std::copy(answer.begin(), answer.end(), into.begin());
    return {PortBytes::Kind::bytes, answer.size()};
  }
  bool pause_until(nanoseconds time) noexcept override {
    clock_ = std::max(clock_, time);
    return true;
  }
  void cancel() noexcept override {}
  [[nodiscard]] bool cancelled() const noexcept override { return false; }

 private:
  nanoseconds clock_{100s};
  nanoseconds busy_until_{0};
  std::deque<std::pair<nanoseconds, std::vector<std::uint8_t>>> answers_;
};

ModbusBusConfig cabinet(int units) {
  ModbusBusConfig bus;
  bus.name = "cabinet";
  bus.line.link = ModbusTcp{"127.0.0.1"};
  for (int unit = 1; unit <= units; ++unit) {
    ModbusDeviceConfig device;
    device.name = "unit_" + std::to_string(unit);
    device.unit = unit;
    device.channels.emplace_back().sensor = static_cast<std::size_t>(unit - 1);
    bus.devices.push_back(device);
  }
  return bus;
}

}  // namespace

TEST_CASE("a gateway that waits for dead units leaves the others nine tenths of their rate",
          "[gateway]") {
  const int dead = GENERATE(1, 2, 3);
  const auto waits_for = GENERATE(200ms, 1000ms, 2500ms);
  const bool drops = GENERATE(false, true);
  CAPTURE(dead, waits_for.count(), drops);
  // Such waits would take more than a tenth of the time.
  if (dead * waits_for > 3000ms || (drops && dead > 1)) return;
  constexpr int good = 2;
  constexpr auto begin = 100s;
  constexpr auto back_at = begin + 700s;
  auto port = std::make_unique<Gateway>();
  Gateway& gateway = *port;
  gateway.waits_for = waits_for;
  gateway.drops_what_waits = drops;
  for (int unit = 1; unit <= dead; ++unit) gateway.silent[unit] = {0s, back_at};
  const ModbusBusConfig bus = cabinet(dead + good);
  ModbusConnection connection(bus.line, std::move(port));
  ModbusPoller poller(bus, connection);
  const auto run_until = [&](nanoseconds time) {
    while (gateway.now() < time) poller.act();
    return poller.health();
  };
  const BusHealth after_a_minute = run_until(begin + 60s);
  const BusHealth at_the_end = run_until(begin + 660s);
  for (std::size_t i = static_cast<std::size_t>(dead); i < bus.devices.size(); ++i) {
    CHECK(at_the_end.units[i].answers - after_a_minute.units[i].answers >= 540);
    if (!drops && waits_for <= 1s) CHECK(at_the_end.units[i].timeouts == 0);
  }
  for (int unit = 1; unit <= dead; ++unit) {
    const auto& times = gateway.asked[unit];
    for (std::size_t i = 1; i < times.size(); ++i) CHECK(times[i] - times[i - 1] <= 60s);
    CHECK_FALSE(at_the_end.units[static_cast<std::size_t>(unit - 1)].answering);
  }
  const BusHealth back = run_until(back_at + 60s);
  for (const UnitHealth& unit : back.units) CHECK(unit.answering);
}
