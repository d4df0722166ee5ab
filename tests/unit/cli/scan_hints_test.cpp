#include <array>
#include <vector>

#include <catch2/catch.hpp>

#include "cli/scan/scan_report.hpp"

using namespace thermocomp;
using namespace thermocomp::cli;

namespace {

ModbusChannel float_channel() {
  ModbusChannel channel;
  channel.encoding = Encoding::float32;
  return channel;
}

ModbusChannel tenths() {
  ModbusChannel channel;
  channel.encoding = Encoding::int16;
  channel.scale = 0.1;
  return channel;
}

}  // namespace

TEST_CASE("a float with swapped words is recognised, and nothing else is suggested") {
  const std::array<std::uint16_t, 2> words{0x0000, 0x41AC};  // 21.5, low word first
  CHECK_FALSE(is_plausible(float_channel(), 2.36e-41, {}));
  CHECK(hints_for_words(float_channel(), words, {}) ==
        std::vector<std::string>{"word_order = \"CDAB\" would make it 21.50 degC"});
}

TEST_CASE("exchanged bytes of one register are recognised") {
  const std::array<std::uint16_t, 1> words{0xD700};  // 215, low byte first
  CHECK(hints_for_words(tenths(), words, {}) ==
        std::vector<std::string>{"word_order = \"BADC\" would make it 21.50 degC"});
}

TEST_CASE("a missing scale is recognised") {
  ModbusChannel channel = tenths();
  channel.scale = 1.0;
  const std::array<std::uint16_t, 1> words{2150};
  const std::vector<std::string> hints = hints_for_words(channel, words, {});
  REQUIRE(hints.size() == 1);
  CHECK(hints[0] == "scale = 0.01 would make it 21.50 degC");
}

TEST_CASE("the ends of an encoding are recognised as likely open-circuit codes") {
  const std::array<std::uint16_t, 1> words{0x7FFF};
  const std::vector<std::string> hints = hints_for_words(tenths(), words, {});
  REQUIRE(hints.size() == 1);
  CHECK(hints[0].find("open_circuit_codes = [32767]") != std::string::npos);
}

TEST_CASE("a register's number from a manual is recognised, a plain address is left alone") {
  ModbusChannel channel = tenths();
  channel.address = 40003;
  const std::vector<std::string> hints = hints_for_address(channel);
  REQUIRE(hints.size() == 1);
  CHECK(hints[0].find("table = \"holding\", address = 2") != std::string::npos);
  channel.address = 3;
  CHECK(hints_for_address(channel).empty());
}

TEST_CASE("a plausible temperature needs a range, and 0 is one") {
  CHECK(is_plausible(float_channel(), 0.0, {}));
  CHECK(is_plausible(float_channel(), 21.5, {}));
  CHECK_FALSE(is_plausible(float_channel(), 201.0, {}));
  CHECK_FALSE(is_plausible(float_channel(), not_a_number, {}));
}

TEST_CASE("the report counts channels with a temperature and shows faults in its place") {
  ScanChannel good;
  good.sensor = "a";
  good.raw = "00 D7";
  good.temp_degC = 21.5;
  good.fault = Fault::none;
  ScanChannel bad;
  bad.sensor = "b";
  bad.fault = Fault::open_circuit;
  bad.hints = {"look at the terminals"};
  ScanDevice device{"d", "unit 1", true, "", {good, bad}};
  const ScanReport report{"f.toml", {{"bus", "modbus_tcp", "host:502", "", "", "", {}, {device}}}};
  CHECK(count_channels(report) == 2);
  CHECK(count_good(report) == 1);
  const std::string text = scan_text(report, false);
  CHECK(text.find("-> 21.50 degC") != std::string::npos);
  CHECK(text.find("-> open_circuit") != std::string::npos);
  CHECK(text.find("try: look at the terminals") != std::string::npos);
  CHECK(text.find("1 of 2 channels") != std::string::npos);
}
