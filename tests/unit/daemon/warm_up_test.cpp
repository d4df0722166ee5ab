#include "daemon/status/warm_up.hpp"

#include <cmath>

#include <catch2/catch.hpp>

namespace thermocomp {
namespace {

using std::chrono::minutes;

/// d(t) sampled once per minute.
template <class Course>
RemainingDrift after(int count, const Course& course_um, double bound_um = 1.0) {
  WarmUp warm;
  for (int i = 0; i <= count; ++i) warm.note(minutes(i), {course_um(i)}, bound_um);
  return warm.remaining().front();
}

TEST_CASE("the remainder of an exponential approach is estimated from its course", "[warm_up]") {
  // 30 um with 40 min, which is none of the taus: after two hours 30 exp(-3) = 1.49 um remain.
  const RemainingDrift hours = after(120, [](int i) { return 30.0 * (1.0 - std::exp(-i / 40.0)); });
  CHECK(hours.um == Approx(1.49).margin(1.1));
  // Two bodies at once, 20 um with 10 min and 10 um with 90 min: after an hour 10 exp(-2/3) = 5.13
  // um and 0.05 um remain; 1 um after another 147 min.
  const RemainingDrift both = after(60, [](int i) {
    return 20.0 * (1.0 - std::exp(-i / 10.0)) + 10.0 * (1.0 - std::exp(-i / 90.0));
  });
  CHECK(both.um == Approx(5.18).margin(0.3));
  CHECK(both.minutes == Approx(147.0).margin(8.0));
  const RemainingDrift late = after(200, [](int i) { return 30.0 * (1.0 - std::exp(-i / 40.0)); });
  CHECK(late.um < 1.0);
  CHECK(late.minutes == 0.0);
}

TEST_CASE("an indeterminate remainder is unknown, and a linear rise is not close to its end",
          "[warm_up]") {
  const auto rise = [](int i) { return 0.2 * i; };
  CHECK(std::isnan(after(10, rise).um));
  CHECK(after(60, rise).um > 12.0);
  // The load changed ten minutes ago: no stretch has a single approach.
  const RemainingDrift changed =
      after(100, [](int i) { return i < 90 ? 10.0 : 10.0 + 2.0 * (i - 90); });
  CHECK(std::isnan(changed.um));
  WarmUp unknown;
  for (int i = 0; i <= 60; ++i) unknown.note(minutes(i), {not_a_number}, 1.0);
  CHECK(std::isnan(unknown.remaining().front().um));
}

ThermalModel model_with_claim() {
  ThermalModel model;
  model.outputs = {"z_um"};
  model.made_from.emplace().runs.resize(16);
  MadeFrom::Output& output = model.made_from->outputs["z_um"];
  output.left_out_rms_um = std::sqrt(5.0 * 5.0 - 2.5 * 2.5);
  output.no_model_rms_um = 20.0;
  return model;
}

TEST_CASE("a probing is due by the model's error since the last one", "[warm_up]") {
  const ThermalModel model = model_with_claim();
  SinceProbing since;
  std::vector<AxisReport> axes(1);
  axes[0].displacement_um = 5.0;
  since.note(axes, "a");
  axes[0].displacement_um = 25.0;
  since.note(axes, "a");
  // 5 / 20 of the 20 um since the start; 5 = hypot(what was left out, 2.5 for the number of runs).
  CHECK(since.error_um(0, axes[0], model, "z_um", false) == Approx(5.0));
  axes[0].probings = 1;
  since.note(axes, "a");
  CHECK(since.error_um(0, axes[0], model, "z_um", false) == Approx(0.0));
  axes[0].displacement_um = 15.0;
  CHECK(since.error_um(0, axes[0], model, "z_um", false) == Approx(2.5));
  since.note(axes, "a");
  axes[0].displacement_um = 5.0;  // another model at the same temperatures
  since.note(axes, "b");
  CHECK(since.error_um(0, axes[0], model, "z_um", false) == Approx(2.5));
  axes[0].displacement_um = -5.0;
  since.note(axes, "b");
  CHECK(since.error_um(0, axes[0], model, "z_um", false) == Approx(5.0));
  axes[0].correction.sd_um = 0.7;
  CHECK(since.error_um(0, axes[0], model, "z_um", true) == Approx(0.7));
  CHECK(std::isnan(since.error_um(0, axes[0], ThermalModel{}, "z_um", false)));
}

}  // namespace
}  // namespace thermocomp
