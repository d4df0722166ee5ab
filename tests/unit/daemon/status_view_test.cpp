#include "daemon/status/status_view.hpp"

#include <catch2/catch.hpp>

namespace thermocomp {
namespace {

TEST_CASE("values that are being confirmed after an outage are a warning, with the time it takes",
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
  const auto warnings = [&] {
    return status_of(StatusView{config, report, controller, timing, {}, {}, {}, {}, 0.0, false, {}})
        .warnings;
  };
  const std::string text = "new values are being confirmed: bed, head count after settle_s = 2 s";
  CHECK(warnings() == std::vector{text});
  report.sensors[1].raw_degC = 21.5;
  CHECK(warnings() == std::vector{text + ", and not while all channels of m1 show one value, "
                                         "as a module that is not ready"});
  report.sensors[0].fault = report.sensors[1].fault = Fault::no_answer;
  CHECK(warnings().empty());
  report.sensors[0].fault = Fault::unconfirmed;
  report.mode = Mode::starting;  // normal there
  CHECK(warnings().empty());
}

}  // namespace
}  // namespace thermocomp
