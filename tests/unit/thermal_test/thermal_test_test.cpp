#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"
#include "config/text/problems.hpp"
#include "modelling/thermal_test/test_data.hpp"
#include "modelling/thermal_test/test_report.hpp"
#include "modelling/thermal_test/test_sheet.hpp"
#include "simulator/files/machine_file.hpp"
#include "simulator/plant/simulate.hpp"

namespace {

using namespace thermocomp;
using namespace thermocomp::thermal_test;
using Catch::Matchers::Contains;

constexpr double rest_s = 600.0;
constexpr double running_s = 4.0 * 3600.0;
constexpr double whole_s = rest_s + running_s + 2.0 * 3600.0;
constexpr double distance_mm = 100.0;

/// A spindle that warms within an hour and a column that takes several: X at both ends of a bar, Z.
std::string machine_text(double noise_um, double share) {
  const auto gain = [share](double value) { return std::to_string(share * value); };
  const std::string noise = "noise_um = " + std::to_string(noise_um) + "\n";
  return "format = 1\npitch_s = 5.0\n[plant]\nstep_s = 5.0\n"
         "[[signal]]\nname = \"spindle_rpm\"\nkind = \"steps\"\ntimes_s = [0, " +
         std::to_string(rest_s) + ", " + std::to_string(rest_s + running_s) +
         "]\nvalues = [0, 6000, 0]\n"
         "[room]\ndaily_swing_K = 1.0\nwander_K = 0.1\n"
         "[[output]]\nname = \"x1_um\"\n" +
         noise + "[[output]]\nname = \"x2_um\"\n" + noise + "[[output]]\nname = \"z_um\"\n" +
         noise +
         "[[node]]\nname = \"spindle\"\ncapacity_J_per_K = 15e3\nroom_W_per_K = 8.0\n"
         "displacement_um_per_K = { x1_um = " +
         gain(0.4) + ", x2_um = " + gain(0.2) + ", z_um = " + gain(2.0) +
         " }\n"
         "[[node]]\nname = \"column\"\ncapacity_J_per_K = 150e3\nroom_W_per_K = 8.0\n"
         "displacement_um_per_K = { x1_um = " +
         gain(-0.9) + ", x2_um = " + gain(-0.6) + ", z_um = " + gain(3.0) +
         " }\n"
         "[[link]]\nbetween = [\"spindle\", \"column\"]\nconductance_W_per_K = 10.0\n"
         "[[source]]\nnode = \"spindle\"\nsignal = \"spindle_rpm\"\nheat_W = 300.0\nat = 6000.0\n"
         "[[thermocouple]]\nname = \"spindle\"\nnode = \"spindle\"\nnoise_K = 0.05\n"
         "[[thermocouple]]\nname = \"room\"\nnode = \"room\"\nnoise_K = 0.05\n";
}

RunFile simulated(double noise_um, std::uint64_t seed, double share = 1.0) {
  return simulate(parse_machine(machine_text(noise_um, share), "machine.toml"), whole_s, seed);
}

TestOptions options_of(TestKind kind) {
  TestOptions options;
  options.kind = kind;
  options.distance_mm = distance_mm;
  return options;
}

/// Range of the truth, computed row by row independently of the report.
double true_range(const std::vector<double>& time_s, const std::vector<double>& values,
                  double from_s, double to_s) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    if (time_s[i] < from_s || time_s[i] > to_s) continue;
    low = std::min(low, values[i]);
    high = std::max(high, values[i]);
  }
  return high - low;
}

const AxisFigures& axis_called(const TestFigures& figures, const std::string& name) {
  for (const AxisFigures& axis : figures.axes)
    if (axis.name == name) return axis;
  throw std::runtime_error("no axis " + name);
}

struct Coverage {
  int figures{0};
  int within{0};
  double width_share{0.0};  ///< mean of interval / value
  void take(const Figure& figure, double truth) {
    REQUIRE(figure.is_there());
    ++figures;
    width_share += (figure.high - figure.low) / figure.value;
    if (figure.low <= truth && truth <= figure.high) ++within;
  }
};

std::vector<double> tilt_of(const RunFile& run) {
  std::vector<double> tilt;
  for (std::size_t i = 0; i < run.rows(); ++i)
    tilt.push_back((run.column("x1_um")[i] - run.column("x2_um")[i]) / distance_mm * 1000.0);
  return tilt;
}

void take_axis(Coverage& coverage, const AxisFigures& axis, const std::vector<double>& time_s,
               const std::vector<double>& truth) {
  constexpr double from_s = rest_s - 5.0;  // the last row before it ran
  constexpr double to_s = rest_s + running_s;
  const double first = true_range(time_s, truth, from_s, from_s + 3600.0);
  coverage.take(axis.first_hour, first);
  coverage.take(axis.until_end, true_range(time_s, truth, from_s, to_s));
  coverage.take(axis.cooling, true_range(time_s, truth, to_s, whole_s));
  coverage.take(axis.whole, true_range(time_s, truth, 0.0, whole_s));
  coverage.take(axis.last_by_first, true_range(time_s, truth, to_s - 3600.0, to_s) / first);
}

}  // namespace

TEST_CASE("the intervals of a noisy test cover the figures of the machine without noise",
          "[thermal_test]") {
  Coverage coverage;
  Coverage of_z;  // moves by much more than its noise
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const RunFile truth = simulated(0.0, seed);
    const TestFigures figures =
        figures_of(test_data(simulated(0.4, seed), options_of(TestKind::spindle)));
    const auto& time_s = truth.time_s();
    take_axis(coverage, axis_called(figures, "X"), time_s, truth.column("x1_um"));
    take_axis(of_z, axis_called(figures, "Z"), time_s, truth.column("z_um"));
    take_axis(coverage, axis_called(figures, "B"), time_s, tilt_of(truth));
    CHECK(axis_called(figures, "Z").noise == Approx(0.4).epsilon(0.1));
    CHECK(axis_called(figures, "B").noise == Approx(0.4 * std::sqrt(2.0) * 10.0).epsilon(0.1));
  }
  INFO(coverage.within + of_z.within << " of " << coverage.figures + of_z.figures
                                     << " within; of Z, mean width by value "
                                     << of_z.width_share / of_z.figures);
  CHECK(coverage.within == coverage.figures);
  CHECK(of_z.within == of_z.figures);
  // Rejects intervals so wide that they cover everything.
  CHECK(of_z.width_share / of_z.figures < 0.2);
}

TEST_CASE("the intervals of ratios and of the combined drift cover the truth", "[thermal_test]") {
  Coverage ratios;
  Coverage of_z;
  Coverage together;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const RunFile before = simulated(0.0, seed);
    const RunFile after = simulated(0.0, seed + 100, 0.25);
    const TestAnswer answer =
        answer_of(test_data(simulated(0.4, seed), options_of(TestKind::spindle)),
                  test_data(simulated(0.4, seed + 100, 0.25), options_of(TestKind::spindle)));
    const auto& time_s = before.time_s();
    constexpr double from_s = rest_s - 5.0;
    constexpr double to_s = rest_s + running_s;
    for (const AxisRatio& ratio : answer.ratios) {
      const std::string column = ratio.name == "X" ? "x1_um" : "z_um";
      if (ratio.name == "B") continue;
      Coverage& coverage = ratio.name == "Z" ? of_z : ratios;
      coverage.take(ratio.until_end, true_range(time_s, after.column(column), from_s, to_s) /
                                         true_range(time_s, before.column(column), from_s, to_s));
    }
    double farthest = 0.0;
    const auto& x = before.column("x1_um");
    const auto& z = before.column("z_um");
    for (std::size_t i = 0; i < before.rows(); i += 12)
      for (std::size_t j = 0; j < i; j += 12)
        if (time_s[j] >= from_s && time_s[i] <= to_s)
          farthest = std::max(farthest, std::hypot(x[i] - x[j], z[i] - z[j]));
    together.take(answer.before_figures.combined_until_end, farthest);
  }
  CHECK(ratios.within + of_z.within == ratios.figures + of_z.figures);
  CHECK(together.within == together.figures);
  CHECK(of_z.width_share / of_z.figures < 0.3);
}

TEST_CASE("whether a machine has settled is judged by its last hour's share", "[thermal_test]") {
  const auto data = [](double tau_s, double noise_um) {
    RunFile run;
    run.name = "exponential";
    run.columns = {"time_s", "spindle_rpm", "z_um"};
    run.values.resize(3);
    std::uint64_t state = 7;
    for (int i = 0; i <= 1440; ++i) {
      const double time_s = 15.0 * i;
      state = state * 6364136223846793005ULL + 1442695040888963407ULL;
      const double noise = noise_um * (static_cast<double>(state >> 11) / 9007199254740992.0 - 0.5);
      run.values[0].push_back(time_s);
      run.values[1].push_back(i == 0 ? 0.0 : 4000.0);
      run.values[2].push_back(30.0 * (1.0 - std::exp(-time_s / tau_s)) + noise);
    }
    run.selected_end = run.rows();
    return test_data(run, options_of(TestKind::spindle));
  };
  const AxisFigures quick = figures_of(data(3600.0, 0.2)).axes.at(0);
  REQUIRE(quick.settled);
  CHECK(*quick.settled);
  const AxisFigures slow = figures_of(data(20000.0, 0.2)).axes.at(0);
  REQUIRE(slow.settled);
  CHECK_FALSE(*slow.settled);
  // exp(-5 h / tau) = 0.15: within the noise, so undecided.
  CHECK_FALSE(figures_of(data(18000.0 / std::log(1.0 / 0.15), 1.0)).axes.at(0).settled);
  CHECK_THAT(axis_sentence(slow, data(20000.0, 0.2).phases), Contains("had not settled"));
}

TEST_CASE("rare probings also give figures, with their own noise", "[thermal_test]") {
  RunFile run = simulated(0.0, 3);
  auto& z = run.values[*run.find("z_um")];
  for (std::size_t i = 0; i < z.size(); ++i)
    if (i % 240 != 119) z[i] = std::nan("");  // one in 20 min
  TestOptions options = options_of(TestKind::spindle);
  options.axes = {"z=z_um"};
  options.noise_um = 0.5;
  const AxisFigures axis = figures_of(test_data(run, options)).axes.at(0);
  CHECK_FALSE(axis.smoothed);
  CHECK(axis.noise == 0.5);
  CHECK(axis.until_end.high - axis.until_end.value == Approx(2.576 * std::sqrt(2.0) * 0.5));
}

TEST_CASE("values that are hours apart give no figure of an hour", "[thermal_test]") {
  RunFile run = simulated(0.0, 3);
  auto& z = run.values[*run.find("z_um")];
  const auto keep_every = [&](std::size_t rows) {
    for (std::size_t i = 0; i < z.size(); ++i)
      if (i % rows != 0) z[i] = std::nan("");
    TestOptions options = options_of(TestKind::environment);
    options.axes = {"z=z_um"};
    options.noise_um = 0.1;
    return figures_of(test_data(run, options)).axes.at(0);
  };
  CHECK(keep_every(60).largest_hour.is_there());  // five minutes
  const AxisFigures rare = keep_every(1800);      // two and a half hours
  CHECK_FALSE(rare.largest_hour.is_there());
  CHECK(rare.whole.is_there());
}

TEST_CASE("an axis by a formula of two probes equals the tilt by names", "[thermal_test]") {
  const RunFile run = simulated(0.1, 5);
  TestOptions options = options_of(TestKind::spindle);
  const TestData named = test_data(run, options);
  options.axes = {"b=x1_um-x2_um/100mm"};
  const TestData given = test_data(run, options);
  REQUIRE(given.axes.size() == 1);
  CHECK(given.axes[0].measured.value == named.axes.back().measured.value);
  CHECK(given.axes[0].unit == "urad");
}

TEST_CASE("unmeasured axes of a history are left out", "[thermal_test]") {
  RunFile run = simulated(0.0, 3);
  run.columns[*run.find("x1_um")] = "x_measured_um";
  run.columns[*run.find("x2_um")] = "z_measured_um";
  const std::size_t x = *run.find("x_measured_um");
  const std::size_t z = *run.find("z_measured_um");
  for (std::size_t row = 0; row < run.rows(); ++row) {
    run.values[x][row] = std::nan("");
    if (row % 500 != 10) run.values[z][row] = std::nan("");
  }
  const TestData data = test_data(run, options_of(TestKind::spindle));
  REQUIRE(data.axes.size() == 1);
  CHECK(data.axes[0].from == "z_measured_um");
  // Without measured values, the displacement of that name is used.
  for (double& value : run.values[z]) value = std::nan("");
  CHECK(test_data(run, options_of(TestKind::spindle)).axes.at(0).from == "z_um");
  for (double& value : run.values[*run.find("z_um")]) value = std::nan("");
  CHECK_THROWS_WITH(test_data(run, options_of(TestKind::spindle)),
                    Contains("has two values") && Contains("thermocomp measured AXIS UM"));
}

TEST_CASE("an ambiguous record is refused with the option that resolves it", "[thermal_test]") {
  RunFile run = simulated(0.1, 1);
  TestOptions options = options_of(TestKind::spindle);
  options.axes = {"z=z_mm"};
  CHECK_THROWS_WITH(test_data(run, options), Contains("is not a column of the file; it has x1_um"));
  options.axes = {"w=z_um"};
  CHECK_THROWS_WITH(test_data(run, options), Contains("must be AXIS=COLUMN"));
  options.axes = {"z=z_um", "z=x1_um"};
  CHECK_THROWS_WITH(test_data(run, options), Contains("repeats the axis of another --axis"));
  options = options_of(TestKind::axis);
  CHECK_THROWS_WITH(test_data(run, options), Contains("--running COLUMN or --running T0:T1"));
  options = options_of(TestKind::spindle);
  options.running = "900:800";
  CHECK_THROWS_WITH(test_data(run, options), Contains("must be within the record"));
  options.running = "";
  options.room = "oil";
  CHECK_THROWS_WITH(test_data(run, options), Contains("must be a column of the file in degC"));
  run.columns[*run.find("z_um")] = "ch5_um";
  run.columns[*run.find("x1_um")] = "ch1_um";
  run.columns[*run.find("x2_um")] = "ch2_um";
  CHECK_THROWS_WITH(test_data(run, options_of(TestKind::spindle)),
                    Contains("it has ch1_um, ch2_um, ch5_um: assign columns with --axis z=COLUMN"));
}

TEST_CASE("a linear axis: positions by names, and the growth of their distance", "[thermal_test]") {
  RunFile run = simulated(0.1, 2);
  TestOptions options = options_of(TestKind::axis);
  options.running = "595:15000";
  const TestData data = test_data(run, options);
  REQUIRE(data.axes.size() == 4);
  CHECK(data.axes[0].name == "X at position 1");
  CHECK(data.axes[3].name == "X, growth from position 1 to 2");
  CHECK(data.axes[3].measured.value[50] ==
        Approx(run.column("x2_um")[50] - run.column("x1_um")[50]));
}

TEST_CASE("the environment: the whole record and the hour with the largest range",
          "[thermal_test]") {
  const RunFile run = simulated(0.2, 9);
  const TestAnswer answer = answer_of(test_data(run, options_of(TestKind::environment)), {});
  const AxisFigures& z = axis_called(answer.before_figures, "Z");
  CHECK_FALSE(z.first_hour.is_there());
  CHECK(z.largest_hour.value <= z.whole.value);
  CHECK(z.largest_hour.value > 0.3 * z.whole.value);
  CHECK_THAT(report_html(answer), Contains("largest hour"));
}

TEST_CASE("a comparison says whether an offset was in effect and the machine as cold",
          "[thermal_test]") {
  const auto answer = [](double before_um, double after_um, double warmer_K) {
    const auto test_of = [](double offset_um, double temp_degC) {
      RunFile run = simulated(0.2, 9);
      run.columns.insert(run.columns.end(), {"z_applied_um", "head_degC"});
      run.values.emplace_back(run.rows(), offset_um);
      run.values.emplace_back(run.rows(), temp_degC);
      return test_data(run, options_of(TestKind::environment));
    };
    std::string notes;
    for (const std::string& note :
         answer_of(test_of(before_um, 20.0), test_of(after_um, 20.0 + warmer_K)).notes)
      notes += note;
    return notes;
  };
  CHECK(answer(0.0, 12.0, 0.0).empty());
  CHECK_THAT(answer(0.0, 0.0, 0.0), Contains("No offset was in effect in the second test"));
  CHECK_THAT(answer(5.0, 12.0, 0.0), Contains("in both tests"));
  CHECK_THAT(answer(0.0, 12.0, 9.0), Contains("K warmer at the start of the second test"));
}

TEST_CASE("a completed sheet is read unchanged", "[thermal_test]") {
  SheetOptions sheet;
  sheet.rpm_max = 8000.0;
  sheet.steps = true;
  std::string text = sheet_csv(sheet);
  std::string filled;
  int row = 0;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = text.find('\n', at);
    std::string line = text.substr(at, end - at);
    at = end + 1;
    if (!line.starts_with('#') && !line.starts_with("time")) {
      while (line.ends_with(',')) line.pop_back();
      for (int i = 0; i < 8; ++i) line.append(",").append(std::to_string(20 + 0.1 * ++row));
    }
    filled.append(line).append("\n");
  }
  const TestData data = test_data(parse_run(filled, "sheet.csv"), options_of(TestKind::spindle));
  CHECK(data.phases.running_from_s == Approx(10.0 * 60.0));
  CHECK(data.phases.running_to_s == Approx((15.0 + 240.0) * 60.0 - 300.0));
  CHECK(data.axes.size() == 5);
  CHECK(sheet_steps(sheet).size() == 10);
  CHECK_THROWS_WITH(sheet_csv(SheetOptions{}), Contains("--rpm-max"));
  CHECK_THAT(sheet_html(sheet), Contains("Schedule"));
}

TEST_CASE("page and JSON contain the figures in words, and load nothing from elsewhere",
          "[thermal_test]") {
  const TestAnswer answer =
      answer_of(test_data(simulated(0.4, 1), options_of(TestKind::spindle)),
                test_data(simulated(0.4, 2, 0.25), options_of(TestKind::spindle)));
  const std::string html = report_html(answer);
  CHECK_THAT(html, Contains("after ISO 230-3"));
  CHECK_THAT(html, Contains("moved by"));
  CHECK_THAT(html, Contains("Before against after"));
  CHECK(html.find("http") == std::string::npos);
  CHECK(html.find("nan") == std::string::npos);
  const std::string json = report_json(answer);
  CHECK_THAT(json, Contains("\"range_first_60_min\""));
  CHECK_THAT(json, Contains("\"after_by_before\""));
}
