#include "cli/admit/admission.hpp"

#include <catch2/catch.hpp>

namespace {

using Catch::Matchers::Contains;
using thermocomp::CandidateModel;
using thermocomp::DaemonConfig;
using thermocomp::MadeFrom;
using thermocomp::parse_run;
using thermocomp::RunFile;
using thermocomp::ThermalModel;
using thermocomp::cli::why_not_admitted;

/// z = gain t, with a stated error of `stated_um` or none.
ThermalModel model(double gain, double stated_um = 0.0) {
  ThermalModel made;
  made.inputs = {"t_degC"};
  made.outputs = {"z_um"};
  made.matrix_um_per_K = {{gain}};
  if (stated_um > 0) {
    made.made_from.emplace();
    made.made_from->columns = {"t_degC"};
    made.made_from->low = {20.0};
    made.made_from->high = {30.0};
    made.made_from->taus_s = {0.0};
    made.made_from->mean = {25.0, 5.0};
    made.made_from->covariance = {{9.0, 0.0}, {0.0, 9.0}};
    made.made_from->distance_max = 10.0;
    made.made_from->outputs["z_um"].left_out_rms_um = stated_um;
    made.made_from->outputs["z_um"].no_model_rms_um = 10.0;
  }
  return made;
}

DaemonConfig with(const ThermalModel& in_use, const ThermalModel& offered) {
  DaemonConfig config;
  config.model = in_use;
  config.model_checksum = "in use";
  config.candidate = CandidateModel{
      .file = "new.toml", .problem = "", .checksum = "offered", .estimator = {}, .model = offered};
  return config;
}

/// A machine with z = 2 um/K; with z_um if `probed`.
RunFile days(bool probed) {
  std::string text = probed ? "time_s,t_degC,z_um\n" : "time_s,t_degC\n";
  for (int i = 0; i < 50; ++i) {
    text += std::to_string(60 * i) + "," + std::to_string(20 + i % 10);
    if (probed) text += i % 10 == 3 || i % 10 == 8 ? "," + std::to_string(2 * (i % 10)) : ",";
    text += "\n";
  }
  return parse_run(text, "days");
}

std::string why(const DaemonConfig& config, const RunFile& run) {
  std::string found;
  return why_not_admitted(config, run, {}, found);
}

TEST_CASE("a model with a larger remainder at the probings is refused, a smaller one is not",
          "[cli][admit]") {
  std::string found;
  CHECK(why_not_admitted(with(model(3.0), model(2.0)), days(true), {}, found).empty());
  CHECK_THAT(found, Contains("z_um: leaves 0.00 of 2.6") && Contains("over 10 probings"));
  CHECK_THAT(why(with(model(2.0), model(3.0)), days(true)),
             Contains("z_um: leaves 2.6") && Contains("of 0.00 um"));
}

TEST_CASE("the smaller of the stated errors is allowed, whatever the offered model states",
          "[cli][admit]") {
  // 2.5 um/K leaves 1.3 um, 2 um/K nothing.
  CHECK(why(with(model(2.0, 1.4), model(2.5, 1.4)), days(true)).empty());
  CHECK_THAT(why(with(model(2.0, 1.2), model(2.5, 100.0)), days(true)),
             Contains("1.20 um are allowed"));
  CHECK_THAT(why(with(model(2.0), model(2.5)), days(true)), Contains("0.00 um are allowed"));
}

TEST_CASE("without probings two models must agree within what they state", "[cli][admit]") {
  // 1 um/K over 20 to 29 degC: 2.9 um apart.
  CHECK(why(with(model(2.0, 1.0), model(3.0, 1.0)), days(false)).empty());
  CHECK_THAT(why(with(model(2.0, 0.5), model(3.0, 0.5)), days(false)),
             Contains("cannot be compared here with the model in use: z_um: too few probings; the "
                      "models differ by 2.9") &&
                 Contains("0.71 um"));
  CHECK_THAT(why(with(model(2.0), model(2.1)), days(false)), Contains("neither states an error"));
}

TEST_CASE("a model for another machine is refused by what differs", "[cli][admit]") {
  ThermalModel other = model(2.0);
  other.outputs = {"y_um"};
  CHECK_THAT(why(with(model(2.0), other), days(true)), Contains("has the outputs y_um"));
  DaemonConfig config = with(model(2.0), model(2.0));
  config.candidate->checksum = "in use";
  CHECK(why(config, days(true)) == "is the model in use");
  config.candidate->problem = "no block ram_degC";
  CHECK_THAT(why(config, days(true)), Contains("does not fit this machine: no block ram_degC"));
  other = model(2.0);
  other.inputs = {"ram_degC"};
  CHECK_THAT(why(with(model(2.0), other), days(true)), Contains("ram_degC"));
}

}  // namespace
