#include "modelling/identification/gate/tie_course.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"

namespace thermocomp::identification {
namespace {

const std::string columns =
    "working_height_mm = 600\nheated_height_mm = 300\n[column]\nwidth_mm = 80\ndepth_mm = 60\n"
    "modulus_MPa = 206000\nexpansion_per_K = 11.5e-6\n";

std::string tie(double height_mm, const std::string& more = "") {
  return "[[tie]]\nheight_mm = " + std::to_string(height_mm) +
         "\nlength_mm = 400\narea_mm2 = 150\ntemperatures = [\"tie_degC\"]\n" + more;
}

GateFile gate(const std::string& ties) {
  return parse_gate_file(columns + ties, "gate.toml");
}

/// Oil on and off hourly for five hours: A - B within minutes, the tie within hours.
RunFile oil_run() {
  std::string text = "time_s,side_a_degC,side_b_degC,tie_degC\n";
  double a_K = 0.0;
  double b_K = 0.0;
  double tie_K = 0.0;
  for (int minute = 0; minute <= 300; ++minute) {
    text += std::to_string(60 * minute) + "," + std::to_string(20 + a_K) + "," +
            std::to_string(20 + b_K) + "," + std::to_string(20 + tie_K) + "\n";
    const double oil_K = (minute / 60) % 2 == 0 ? 15.0 : 0.0;
    a_K += (oil_K - a_K) / 8.0;
    b_K += (0.8 * oil_K - b_K) / 25.0;
    tie_K += (6.0 - tie_K) / 70.0;
  }
  return parse_run(text, "oil.csv");
}

std::vector<TieCourse> courses_of(const GateFile& file) {
  std::vector<std::string> notes;
  return tie_courses(file, {oil_run()}, notes);
}

TEST_CASE("a course is relative to its first row: A - B, and each tie times its factor",
          "[tiebar]") {
  const GateFile file = gate(tie(250) + tie(700, "rise_factor = 0.5\n"));
  const TieCourse course = courses_of(file).front();
  REQUIRE(course.rises_K.cols() == 3);
  CHECK(course.rises_K.row(0).cwiseAbs().maxCoeff() == 0.0);
  CHECK(course.rises_K(30, 0) > 0.0);
  CHECK(course.rises_K(200, 2) == Approx(0.5 * course.rises_K(200, 1)));
  const TiedCoefficients k = tied_coefficients(file.columns);
  CHECK(displacement_um(course, k)[200] ==
        Approx(k.ki_um_per_K * course.rises_K(200, 0) - k.kc_um_per_K[0] * course.rises_K(200, 1) -
               k.kc_um_per_K[1] * course.rises_K(200, 2)));
}

TEST_CASE("a run that lacks a column of the geometry is refused, naming both files", "[tiebar]") {
  std::vector<std::string> notes;
  const GateFile file =
      parse_gate_file(columns +
                          "[[tie]]\nheight_mm = 250\nlength_mm = 400\narea_mm2 = 150\n"
                          "temperatures = [\"rod_degC\"]\n",
                      "gate.toml");
  try {
    (void)tie_courses(file, {oil_run()}, notes);
    FAIL("accepted");
  } catch (const ConfigurationError& error) {
    for (const char* part : {"oil.csv", "rod_degC", "gate.toml", "temperatures"})
      CHECK_THAT(error.what(), Catch::Contains(part));
  }
}

TEST_CASE("the best tie equals that of an exhaustive search of heights and areas", "[tiebar]") {
  const GateFile file = gate(tie(250));
  const std::vector<TieCourse> courses = courses_of(file);
  TiedColumns other = file.columns;
  double least_um = INFINITY;
  for (double height_mm = 120; height_mm <= 900; height_mm += 5)
    for (double area_mm2 = 37.5; area_mm2 <= 600; area_mm2 *= 1.02) {
      other.ties[0].height_mm = height_mm;
      other.ties[0].area_mm2 = area_mm2;
      least_um = std::min(least_um, swing_um(courses, tied_coefficients(other)));
    }
  const TiedColumns best = best_ties(file, courses);
  CHECK(swing_um(courses, tied_coefficients(best)) <= least_um + 1e-9);
  CHECK(swing_um(courses, tied_coefficients(best)) > 0.9 * least_um);
}

TEST_CASE("a second tie leaves less than the best single one, within the bounds", "[tiebar]") {
  const std::string area = "area_mm2_range = [40, 600]\n";
  const GateFile one = gate(tie(250, area + "height_mm_range = [120, 900]\n"));
  const GateFile two = gate(tie(250, area + "height_mm_range = [120, 590]\n") +
                            tie(700, area + "height_mm_range = [610, 900]\n"));
  const double one_um =
      swing_um(courses_of(one), tied_coefficients(best_ties(one, courses_of(one))));
  const TiedColumns best = best_ties(two, courses_of(two));
  const double two_um = swing_um(courses_of(two), tied_coefficients(best));
  CAPTURE(one_um, two_um);
  CHECK(two_um <= one_um + 1e-6);
  CHECK(best.ties[0].height_mm <= 590.0);
  CHECK(best.ties[1].height_mm >= 610.0);
  for (const Tie& each : best.ties) {
    CHECK(each.area_mm2 >= 40.0 * (1 - 1e-12));
    CHECK(each.area_mm2 <= 600.0 * (1 + 1e-12));
  }
}

TEST_CASE("a fixed tie stays, and optimising only fixed ties is refused", "[tiebar]") {
  const GateFile some = gate(tie(250, "fixed = true\n") + tie(700));
  CHECK(best_ties(some, courses_of(some)).ties[0].height_mm == 250.0);
  const GateFile none = gate(tie(250, "fixed = true\n"));
  CHECK_THROWS_AS(best_ties(none, courses_of(none)), ConfigurationError);
}

TEST_CASE("the picture shows each course and the swing over the heights", "[tiebar]") {
  const GateFile file = gate(tie(250));
  const std::vector<TieCourse> courses = courses_of(file);
  const TiedColumns best = best_ties(file, courses);
  const std::string picture = tie_picture(file, courses, &best);
  for (const char* part : {"oil.csv", "no tie", "as drawn", "best ties", "Swing over the height"})
    CHECK_THAT(picture, Catch::Contains(part));
  CHECK_THAT(tie_picture(file, courses, nullptr), !Catch::Contains("best ties"));
}

}  // namespace
}  // namespace thermocomp::identification
