#include "estimator/learning/recorded_course.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "estimator/learning/probings.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

using Vector = std::vector<double>;

/// x = 10 A - 4 C; in the record the gain of A is 1.3 while heating.
ThermalModel with_course() {
  ThermalModel model;
  model.inputs = {"a_degC", "c_degC"};
  model.outputs = {"x_um"};
  model.matrix_um_per_K = {{10.0, -4.0}};
  RecordedCourse course;
  course.groups = {{"a_degC"}, {"c_degC"}};
  for (int i = 1; i <= 10; ++i)
    course.outputs["x_um"].push_back(
        {CoursePhase::heating, 60.0 * i, {0.5 * i, 0.05 * i}, {1.3, 1.0}, {0.02, 0.1}});
  model.course = course;
  return model;
}

CorrectionConfig two_phase() {
  CorrectionConfig config;
  config.form = CorrectionForm::two_phase;
  config.groups = {{"a_degC"}, {"c_degC"}};
  config.noise_um = 0.3;
  config.turn_um = 2.0;
  return config;
}

/// One minute of heating after the other, as in the record.
void heat(RunningCorrection& correction, int from, int to) {
  for (int i = from; i <= to; ++i) correction.step(i * 60s, Vector{0.5 * i, 0.05 * i}, true);
}

}  // namespace

TEST_CASE("heating, the turn of the displacement and cooling are distinguished", "[course]") {
  HeatPhase phase(1.0);
  CHECK(phase.phase() == CoursePhase::heating);
  for (int i = 0; i <= 10; ++i) phase.step(i * 60s, 2.0 * i, 2.0 * i);
  CHECK(phase.phase() == CoursePhase::heating);
  CHECK(phase.since_s() == 600.0);
  for (int i = 11; i <= 15; ++i) phase.step(i * 60s, 2.0 * i, 20.0 - (i - 10));
  CHECK(phase.phase() == CoursePhase::turned);
  CHECK(phase.since_s() == 900.0);  // still heating
  for (int i = 16; i <= 20; ++i) phase.step(i * 60s, 30.0 - 3.0 * (i - 15), 10.0);
  CHECK(phase.phase() == CoursePhase::cooling);
  CHECK(phase.since_s() == 300.0);  // since the largest value, not since its detection
  for (int i = 21; i <= 23; ++i) phase.step(i * 60s, 15.0 + 2.0 * (i - 20), 12.0);
  CHECK(phase.phase() == CoursePhase::heating);
  phase.restart();
  CHECK(phase.since_s() == 0.0);
}

TEST_CASE("noise below back_um changes no phase", "[course]") {
  HeatPhase phase(1.0);
  for (int i = 0; i < 200; ++i) phase.step(i * 10s, -20.0 + (i % 2 == 0 ? 0.4 : -0.4), -20.0);
  CHECK(phase.phase() == CoursePhase::heating);
}

TEST_CASE("near the record its gains hold, far from it 1 with gain_sd", "[course]") {
  const ThermalModel model = with_course();
  const CourseLookup lookup(*model.course, model, 0, 0.3);
  const RecordedGains near = lookup.at(CoursePhase::heating, 300.0, Vector{2.5, 0.25});
  CHECK(near.gain[0] == Approx(1.3).margin(0.01));
  CHECK(near.sd[0] < 0.06);
  const RecordedGains far = lookup.at(CoursePhase::heating, 300.0, Vector{40.0, 0.25});
  CHECK(far.gain[0] == Approx(1.0).margin(1e-6));
  CHECK(far.sd[0] == Approx(0.3).margin(1e-6));
  const RecordedGains other = lookup.at(CoursePhase::cooling, 300.0, Vector{2.5, 0.25});
  CHECK(other.gain[0] == 1.0);
  CHECK(other.sd[0] == Approx(0.3));
  for (double rise_K = 2.5; rise_K < 12; rise_K += 0.1)  // less certain with distance
    CHECK(lookup.at(CoursePhase::heating, 300.0, Vector{rise_K + 0.1, 0.25}).sd[0] <= 0.31);
}

TEST_CASE("without a probing the recorded gains correct the displacement", "[course]") {
  RunningCorrection correction(two_phase(), with_course(), 0);
  heat(correction, 0, 6);
  CHECK(correction.correction_um() == Approx(0.3 * 30.0).margin(0.3));
  const CorrectionReport report = correction.report();
  CHECK(report.has_record);
  CHECK(report.recorded[0] == Approx(1.3).margin(0.01));
  CHECK(report.sd_um > 0.1);  // the record is not certain
  CHECK(report.sd_um < 3.0);
}

TEST_CASE("a probing counts more than the record, and less with time", "[course]") {
  CorrectionConfig config = two_phase();
  config.step_um_max = 100.0;
  RunningCorrection correction(config, with_course(), 0);
  heat(correction, 0, 6);
  const double before_um = correction.correction_um();
  // Today the gain of A is only 1.1: model 30 - 1.2, tool 33 - 1.2.
  correction.measured({33.0 - 1.2, 30.0 - 1.2});
  correction.step(361s, Vector{3.0, 0.3}, true);
  const double probed_um = correction.correction_um();
  CHECK(probed_um < before_um - 3.0);
  CHECK(probed_um == Approx(3.0).margin(1.6));
  // The same heat on another day, after a night.
  for (int i = 1; i <= 48; ++i) correction.step(361s + i * 30min, Vector{0.0, 0.0}, true);
  for (int i = 1; i <= 6; ++i)
    correction.step(361s + 24h + i * 60s, Vector{0.5 * i, 0.05 * i}, true);
  CHECK(correction.correction_um() > probed_um + 1.0);
}

TEST_CASE("a probing moves the estimate by at most its limit, from the record too", "[course]") {
  CorrectionConfig config = two_phase();
  config.step_um_max = 1.0;
  RunningCorrection correction(config, with_course(), 0);
  heat(correction, 0, 6);
  const double before_um = correction.correction_um();
  correction.measured({60.0, 30.0 - 1.2});
  correction.step(361s, Vector{3.0, 0.3}, true);
  CHECK(std::abs(correction.correction_um() - before_um) <= 1.0 + 0.05);
}

TEST_CASE("a model without a course has the same state as before", "[course]") {
  const auto bytes = [](const ThermalModel& model) {
    RunningCorrection correction(two_phase(), model, 0);
    StateArchive count;
    correction.visit_state(count);
    return count.position_bytes();
  };
  ThermalModel without = with_course();
  without.course.reset();
  CHECK(bytes(without) == 362);
  CHECK(bytes(with_course()) > bytes(without));
}

TEST_CASE("a course of other groups or shapes is refused", "[course]") {
  ThermalModel model = with_course();
  model.course->groups = {{"c_degC"}, {"a_degC"}};
  CHECK_THROWS_WITH(RunningCorrection(two_phase(), model, 0),
                    Catch::Contains("groups of the model's [course]"));
  model = with_course();
  model.course->outputs["x_um"][3].rise_K.pop_back();
  CHECK_THROWS_WITH(RunningCorrection(two_phase(), model, 0), Catch::Contains("a rise for each"));
}
