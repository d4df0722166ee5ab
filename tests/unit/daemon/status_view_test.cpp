#include "daemon/status/status_view.hpp"

#include <catch2/catch.hpp>

namespace thermocomp {
namespace {

TEST_CASE("values that are being confirmed after an outage are named, with the time it takes",
          "[status_view]") {
  DaemonConfig config;
  Report report;
  report.mode = Mode::holding;
  report.reasons = static_cast<std::uint32_t>(Reason::block_lost);
  for (const auto& [name, value_degC] : {std::pair("bed", 21.5), std::pair("head", 24.0)}) {
    SensorConfig sensor;
    sensor.name = name;
    sensor.module = "m1";
    sensor.screening.settle_s = 2.0;
    config.estimator.sensors.push_back(sensor);
    report.sensors.push_back(
        {.raw_degC = value_degC, .fault = Fault::unconfirmed, .waiting = true});
  }
  const ControllerState controller;
  const CycleTiming timing;
  double uptime_s = 0.0;
  const auto confirming = [&] {
    return status_of(
               StatusView{
                   config, report, controller, timing, {}, {}, {}, {}, {}, uptime_s, false, {}})
        .confirming;
  };
  REQUIRE(confirming().size() == 1);
  CHECK(confirming()[0].sensors == std::vector<std::string>{"bed", "head"});
  CHECK(confirming()[0].settle_s == 2.0);
  CHECK(confirming()[0].one_value_of.empty());
  report.sensors[1].raw_degC = 21.5;
  REQUIRE(confirming().size() == 1);
  CHECK(confirming()[0].one_value_of == "m1");
  report.sensors[0].fault = report.sensors[1].fault = Fault::no_answer;
  CHECK(confirming().empty());
  report.sensors[0].fault = Fault::unconfirmed;
  report.mode = Mode::starting;  // normal there, unless it lasts
  CHECK(confirming().empty());
  uptime_s = 20.0;
  report.now = std::chrono::seconds(20);
  CHECK(confirming().size() == 1);
}

TEST_CASE("a module that sends rarely answers while its values are valid", "[status_view]") {
  DaemonConfig config;
  config.estimator.sensors.emplace_back().module = "m1";
  Report report;
  report.sensors.push_back({.raw_degC = 21.5, .fault = Fault::none});
  BusHealth bus;
  bus.units.emplace_back().name = "m1";
  bus.units[0].answers = 3;
  const ControllerState controller;
  const CycleTiming timing;
  const auto answers = [&] {
    const StatusView view{config, report, controller, timing, {bus}, {},
                          {},     {},     {},         0.0,    false, {}};
    return status_of(view).buses[0].units[0].answering;
  };
  CHECK(answers());
  report.sensors[0].fault = Fault::unconfirmed;
  CHECK(answers());
  report.sensors[0].fault = Fault::stale;
  CHECK_FALSE(answers());
  report.sensors[0].fault = Fault::none;
  bus.units[0].requests = 3;  // it is asked, and is silent
  CHECK_FALSE(answers());
}

}  // namespace
}  // namespace thermocomp
