#include "modelling/thermal_test/part_test.hpp"

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"
#include "config/text/problems.hpp"
#include "simulator/files/machine_file.hpp"
#include "simulator/plant/simulate.hpp"

namespace {

using namespace thermocomp;
using namespace thermocomp::thermal_test;
using Catch::Matchers::Contains;

/// A sheet on disk; the destructor removes it.
class Sheet {
 public:
  explicit Sheet(const std::string& text)
      : path_(std::filesystem::temp_directory_path() /
              ("part_" + std::to_string(reinterpret_cast<std::uintptr_t>(this)) + ".csv")) {
    std::ofstream(path_) << text;
  }
  ~Sheet() { std::filesystem::remove(path_); }
  Sheet(const Sheet&) = delete;
  Sheet& operator=(const Sheet&) = delete;
  [[nodiscard]] PartFigures figures() const { return part_figures(path_.string()); }

 private:
  std::filesystem::path path_;
};

const std::string head = "repeat,state,feature,x_um,z_um\n";

}  // namespace

TEST_CASE("shifts of a part and their intervals match the manual calculation", "[part]") {
  // P1 in Z: shifts 10 and 14, P2: 4 and 4. s^2 = (8 + 0) / 2; t for one degree of freedom: 12.706.
  const Sheet sheet(head +
                    "1,cold,P1,,100\n1,cold,P2,,-3\n1,warm,P1,,110\n1,warm,P2,,1\n"
                    "2,cold,P1,,90\n2,cold,P2,,0\n2,warm,P1,,104\n2,warm,P2,,4\n"
                    "3,cold,P1,,95\n");  // without warm: excluded
  const PartFigures figures = sheet.figures();
  REQUIRE(figures.axes.size() == 1);
  const PartAxis& axis = figures.axes.front();
  CHECK(axis.axis == "Z");
  CHECK(axis.repeats == 2);
  CHECK(axis.repeat_sd_um == Approx(2.0));
  const double half = 12.706 * 2.0 / std::sqrt(2.0);
  REQUIRE(figures.shifts.size() == 2);
  CHECK(figures.shifts[0].shift_um.value == Approx(12.0));
  CHECK(figures.shifts[0].shift_um.high == Approx(12.0 + half));
  CHECK(figures.shifts[1].shift_um.low == Approx(4.0 - half));
  CHECK(axis.rms_um.value == Approx(std::sqrt((144.0 + 16.0) / 2.0)));
  CHECK(axis.rms_um.low == 0.0);
}

TEST_CASE("a tolerance is kept, exceeded or undecided by whole intervals", "[part]") {
  const auto figure = [](double low, double high) { return Figure{(low + high) / 2.0, low, high}; };
  PartFigures figures{
      "on.csv", {{"P1", "Z", figure(-2.0, 3.0)}, {"P2", "Z", figure(4.0, 8.0)}}, {}};
  CHECK(tolerance_of(figures, 8.0) == Tolerance::kept);
  CHECK(tolerance_of(figures, 7.9) == Tolerance::undecided);
  CHECK(tolerance_of(figures, 3.9) == Tolerance::exceeded);
  figures.shifts[1].shift_um = figure(-8.0, -4.0);
  CHECK(tolerance_of(figures, 3.9) == Tolerance::exceeded);
  const PartTest test{figures, figures, 7.0};
  const std::vector<std::string> sentences = part_sentences(test);
  REQUIRE(sentences.size() == 2);
  CHECK_THAT(sentences[1], Contains("with compensation: undecided. Farthest: P2 in Z") &&
                               Contains("more repeats"));
  CHECK_THAT(part_json(test), Contains("\"after\": \"undecided\""));
}

TEST_CASE("an invalid sheet is reported with line, column and rule", "[part]") {
  const std::string cold = "1,cold,P1,,1\n";
  const auto says = [](const std::string& text, const std::string& words) {
    CHECK_THROWS_WITH(Sheet(text).figures(), Contains(words));
  };
  says(head + cold + "1,hot,P1,,2\n", ":3: state = hot: must be cold or warm");
  says(head + cold + cold,
       ":3: z_um = 1: the feature already has a value for this repeat and state");
  says(head + cold + "1,warm,P1,,two\n", ":3: z_um = two: must be a number");
  says(head + cold + "1,warm,P1,,2\n", "at least twice");
  says(head + cold + "2,warm,P1,,2\n", "no feature has a value both cold and warm in one repeat");
  says("repeat,feature,z_um\n1,P1,1\n2,P1,2\n", "state");
  says("repeat,state,feature,length\n1,cold,P1,1\n1,warm,P1,2\n", "x_um, y_um, z_um");
}

TEST_CASE("the report reads the plan's sheet", "[part]") {
  std::string text = part_sheet({2, 2, 1.5}, false);
  CHECK_THAT(text, Contains("1.50 h of the shop's usual load") && Contains("finishing cut"));
  double value = 0.0;
  for (std::size_t at = text.find(",,,\n"); at != std::string::npos; at = text.find(",,,\n", at))
    text.replace(at, 3, ",,," + std::to_string(value += 1.0));
  const PartFigures figures = Sheet(text).figures();
  REQUIRE(figures.axes.size() == 1);
  CHECK(figures.axes.front().rms_um.value == Approx(2.0));  // two features later each time
  CHECK_THAT(part_sheet({2, 2, 1.5}, true), Contains("signed for the user"));
}

TEST_CASE("intervals of a part cover the truth on simulated days", "[part]") {
  // A head warmed by its spindle and a column, in a room that differs each day.
  const std::string machine =
      "format = 1\npitch_s = 30.0\n[plant]\nstep_s = 10.0\n"
      "[[signal]]\nname = \"spindle_rpm\"\nkind = \"steps\"\ntimes_s = [0, 600]\nvalues = [0, "
      "6000]\n"
      "[room]\ndaily_swing_K = 2.0\nwander_K = 0.5\n"
      "[[output]]\nname = \"x_um\"\nnoise_um = 0.5\n[[output]]\nname = \"y_um\"\nnoise_um = 0.5\n"
      "[[output]]\nname = \"z_um\"\nnoise_um = 0.5\n"
      "[[node]]\nname = \"head\"\ncapacity_J_per_K = 15e3\nroom_W_per_K = 8.0\n"
      "displacement_um_per_K = { x_um = 0.4, y_um = 0.2, z_um = 2.0 }\n"
      "[[node]]\nname = \"column\"\ncapacity_J_per_K = 50e3\nroom_W_per_K = 8.0\n"
      "displacement_um_per_K = { x_um = -0.9, y_um = -0.6, z_um = 3.0 }\n"
      "[[link]]\nbetween = [\"head\", \"column\"]\nconductance_W_per_K = 10.0\n"
      "[[source]]\nnode = \"head\"\nsignal = \"spindle_rpm\"\nheat_W = 300.0\nat = 6000.0\n"
      "[[thermocouple]]\nname = \"head\"\nnode = \"head\"\nnoise_K = 0.05\n";
  const auto plant = parse_machine(machine, "machine.toml");
  constexpr std::array names{"x_um", "y_um", "z_um"};
  /// Displacements of one day: cold at 10 min, warm two hours later.
  const auto day = [&](std::uint64_t seed) {
    const RunFile run = simulate(plant, 7800.0, seed);
    std::array<std::array<double, 3>, 2> values{};
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto& column = run.column(names[i]);
      values[0][i] = column[20];
      values[1][i] = column.back();
    }
    return values;
  };
  constexpr std::uint64_t days = 300;
  std::array<double, 3> truth{};
  for (std::uint64_t seed = 1; seed <= days; ++seed) {
    const auto values = day(seed);
    for (std::size_t i = 0; i < 3; ++i) truth[i] += (values[1][i] - values[0][i]) / days;
  }
  const double rms = std::hypot(truth[0], truth[1], truth[2]) / std::sqrt(3.0);
  constexpr int tests = 200;
  int shifts_hold = 0;
  int rms_holds = 0;
  std::uint64_t seed = 10'000;
  for (int test = 0; test < tests; ++test) {
    std::string text = "repeat,state,feature,z_um\n";
    for (int repeat = 1; repeat <= 3; ++repeat) {
      const auto values = day(++seed);
      for (std::size_t warm = 0; warm < 2; ++warm)
        for (std::size_t i = 0; i < 3; ++i)
          text += std::to_string(repeat) + (warm == 0 ? ",cold,P" : ",warm,P") + std::to_string(i) +
                  "," + std::to_string(values[warm][i]) + "\n";
    }
    const PartFigures figures = Sheet(text).figures();
    const auto holds = [](const Figure& figure, double true_value) {
      return figure.low <= true_value && true_value <= figure.high;
    };
    for (std::size_t i = 0; i < 3; ++i) shifts_hold += holds(figures.shifts[i].shift_um, truth[i]);
    rms_holds += holds(figures.axes.front().rms_um, rms);
  }
  const double shifts_share = shifts_hold / (3.0 * tests);
  const double rms_share = rms_holds / static_cast<double>(tests);
  WARN("of " << tests << " simulated tests of three days the 95 % intervals hold: shifts "
             << shifts_share << ", RMS " << rms_share);
  CHECK(shifts_share > 0.93);
  CHECK(rms_share > 0.93);
}
