#include "cli/scan/scan_report.hpp"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

using namespace thermocomp;
using namespace thermocomp::cli;
using Catch::Matchers::Contains;

namespace {

ScanValue there(const std::string& what, double value) {
  ScanValue shown;
  shown.what = what;
  shown.place = "input 10 uint16";
  shown.raw = "00 0A";
  shown.value = value;
  return shown;
}

ScanValue missing(const std::string& what) {
  ScanValue shown;
  shown.what = what;
  shown.place = "input 20 uint16";
  shown.why = "the controller answers with exception 2 (illegal data address)";
  return shown;
}

ScanReport report_of(std::vector<ScanValue> values) {
  ScanReport report;
  report.controller = {"cnc", "modbus_tcp", "127.0.0.1:502",  "unit 1", "",
                       "",    "",           std::move(values)};
  return report;
}

}  // namespace

TEST_CASE("a scan with every value of the controller is complete", "[cli][scan]") {
  const ScanReport report = report_of({there("spindle_rpm", 10.0), there("heartbeat", 0.0)});
  CHECK(is_complete(report));
  CHECK_THAT(scan_text(report, false),
             Contains("spindle_rpm  input 10 uint16  00 0A  -> 10.00") &&
                 Contains("2 of 2 values of the controller are present\n"));
  CHECK(scan_json(report)["controller"]["complete"] == true);
  CHECK(scan_json(ScanReport{})["controller"].is_null());
  CHECK(is_complete(ScanReport{}));
}

TEST_CASE("a module whose temperatures are those of a room in degF is noted", "[cli][scan]") {
  const auto note_of = [](std::vector<double> temps_degC) {
    ScanReport report;
    ScanDevice& device = report.buses.emplace_back().devices.emplace_back();
    for (const double each : temps_degC) {
      ScanChannel& channel = device.channels.emplace_back();
      channel.temp_degC = each;
      channel.fault = Fault::none;
    }
    device.channels.emplace_back();  // never read
    note_fahrenheit(report);
    return report.buses[0].devices[0].note;
  };
  CHECK_THAT(note_of({66.8, 68.1}),
             Contains("66.8 to 68.1 degC; as degF it would be 19.3 to 20.1"));
  CHECK(note_of({66.8, 24.0}).empty());
  CHECK(note_of({}).empty());
}

TEST_CASE("a channel that jumps between two values in turn has two senders", "[cli][scan]") {
  const auto fault_of = [](const std::vector<double>& temps_degC) {
    ScanChannel channel;
    channel.fault = Fault::none;
    judge_turns(temps_degC, channel);
    return channel.fault;
  };
  CHECK(fault_of({21.5, 35.25, 21.5, 35.25, 21.5, 35.25}) == Fault::device_error);
  CHECK(fault_of({21.5, 22.2, 21.5, 22.2, 21.6, 22.2, 21.6, 22.3}) == Fault::device_error);
  CHECK(fault_of({21.5, 22.2, 21.5, 22.2}) == Fault::none);              // too few
  CHECK(fault_of({21.5, 21.6, 21.5, 21.6, 21.5, 21.6}) == Fault::none);  // its last digit
  CHECK(fault_of({20, 21, 22, 23, 24, 25, 26}) == Fault::none);
  CHECK(fault_of({21, 22, 22, 21, 22, 21, 21, 22}) == Fault::none);
}

TEST_CASE("missing values of a controller are listed with its answers", "[cli][scan]") {
  const ScanReport report =
      report_of({there("spindle_rpm", 10.0), missing("x_mm"), missing("heartbeat")});
  CHECK_FALSE(is_complete(report));
  CHECK_THAT(
      scan_text(report, false),
      Contains("-> missing\n        the controller answers with exception 2") &&
          Contains("1 of 3 values of the controller are present; missing: x_mm, heartbeat\n"));
  const auto values = scan_json(report)["controller"]["values"];
  ScanValue unreadable = missing("heartbeat");
  unreadable.is_needed = false;  // the daemon only writes it
  CHECK(is_complete(report_of({unreadable})));
  CHECK(values[1]["value"].is_null());
  CHECK_THAT(values[1]["why"].get<std::string>(), Contains("exception 2"));
}

TEST_CASE("values that the daemon's own requests cannot read leave the scan incomplete",
          "[cli][scan]") {
  ScanReport report = report_of({there("spindle_rpm", 10.0)});
  report.controller->refused = "the daemon reads input 10..18 in one request";
  CHECK_FALSE(is_complete(report));
  CHECK_THAT(scan_text(report, false), Contains("in one request"));
  report.controller->refused.clear();
  report.controller->error = "cannot be opened: Connection refused";
  CHECK_FALSE(is_complete(report));
}

TEST_CASE("registers are shown as they come over the wire", "[cli][scan]") {
  CHECK(hex_words(std::vector<std::uint16_t>{0x12AB, 0x0003}) == "12 AB 00 03");
}
