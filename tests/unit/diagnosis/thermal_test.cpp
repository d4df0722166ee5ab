#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>

#include <catch2/catch.hpp>

#include "config/text/problems.hpp"
#include "modelling/diagnosis/answer/diagnosis_report.hpp"
#include "modelling/diagnosis/network/network_simulation.hpp"
#include "modelling/diagnosis/thermal_diagnosis.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "thermocomp-XXXXXX").string();
    if (mkdtemp(name.data()) != nullptr) path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  [[nodiscard]] std::filesystem::path file(const std::string& text) const {
    std::ofstream(path_ / "machine.toml") << text;
    return path_ / "machine.toml";
  }

 private:
  std::filesystem::path path_;
};

const std::string network = R"(
format = 1
[plant]
[[signal]]
name = "spindle_rpm"
kind = "steps"
times_s = [0]
values = [0]
[[node]]
name = "head"
capacity_J_per_K = 20e3
room_W_per_K = 8.0
[[node]]
name = "column"
capacity_J_per_K = 40e3
room_W_per_K = 6.0
[[link]]
between = ["head", "column"]
conductance_W_per_K = 10.0
[[source]]
node = "head"
signal = "spindle_rpm"
heat_W = 200.0
at = 6000.0
[[thermocouple]]
name = "head"
node = "head"
[[thermocouple]]
name = "column"
node = "column"
)";
const std::string room = "[[thermocouple]]\nname = \"room\"\nnode = \"room\"\n";

/// A run of the network, a row a minute, by small explicit steps.
RunFile run_of(unsigned seed, int minutes) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.02);
  std::uniform_int_distribution<int> speed(0, 3);
  RunFile run;
  run.name = "run.csv";
  run.columns = {"time_s", "spindle_rpm", "room_degC", "head_degC", "column_degC"};
  run.values.resize(5);
  double head = 21.0;
  double column = 21.0;
  double rpm = 0.0;
  for (int row = 0; row < minutes; ++row) {
    if (row % 60 == 20) rpm = 2000.0 * speed(random);
    const double air = 21.0 + 0.8 * std::sin(row / 200.0);
    const double values[] = {60.0 * row, rpm, air, head + noise(random), column + noise(random)};
    for (std::size_t i = 0; i < 5; ++i) run.values[i].push_back(values[i]);
    for (int step = 0; step < 60; ++step) {
      const double across_W = 10.0 * (head - column);
      head += (200.0 * rpm / 6000.0 - across_W - 8.0 * (head - air)) / 20e3;
      column += (across_W - 6.0 * (column - air)) / 40e3;
    }
  }
  run.selected_end = run.rows();
  return run;
}

}  // namespace

TEST_CASE("quantisation steps are noise, not structure", "[diagnosis][thermal]") {
  const TemporaryFolder folder;
  const ThermalPlant plant = load_thermal_plant(folder.file(network + room));
  RunFile train = run_of(1, 600);
  RunFile test = run_of(2, 400);
  for (RunFile* run : {&train, &test})
    for (const std::size_t column : {3U, 4U})
      for (double& value : run->values[column]) value = std::round(2.0 * value) / 2.0;
  CHECK(diagnose_thermal(plant, {train}, {test}).verdict == "none");
}

TEST_CASE("runs without columns of the thermal network are refused", "[diagnosis][thermal]") {
  const TemporaryFolder folder;
  CHECK_THROWS_AS(load_thermal_plant(folder.file(network)), ConfigurationError);
  CHECK_THROWS_AS(load_thermal_plant(folder.file("format = 1\n")), ConfigurationError);
  const ThermalPlant plant = load_thermal_plant(folder.file(network + room));
  const RunFile good = run_of(1, 100);
  for (const char* missing : {"spindle_rpm", "room_degC"}) {
    RunFile bad = good;
    for (std::string& column : bad.columns)
      if (column == missing) column = "other_on";
    CAPTURE(missing);
    CHECK_THROWS_AS(diagnose_thermal(plant, {good}, {bad}), ConfigurationError);
  }
  RunFile blind = good;
  for (const std::size_t column : {3U, 4U})
    for (double& value : blind.values[column]) value = NAN;
  CHECK_THROWS_AS(diagnose_thermal(plant, {blind}, {good}), ConfigurationError);
}

TEST_CASE("the corrected machine file has the findings, and comments for the others",
          "[diagnosis][thermal]") {
  const auto found = [](const char* cause, const char* subject,
                        const std::map<std::string, double>& values) {
    NamedFinding finding;
    finding.cause = cause;
    finding.subject = subject;
    for (const auto& [name, value] : values)
      finding.parameters.push_back({name, {{"", value}}, {}});
    return finding;
  };
  const TemporaryFolder folder;
  const auto text =
      corrected_machine(folder.file(network + room),
                        {found("wrong_film_coefficient", "column|room", {{"factor", 1.5}}),
                         found("missing_heat_source", "feed_mm_per_min|column",
                               {{"heat_W", 30.0}, {"at", 5000.0}, {"power", 2.0}}),
                         found("wrong_conductance", "column|head", {{"factor", 0.25}}),
                         found("slow_sensor", "head_degC", {{"tau_s", 300.0}}),
                         found("wrong_ambient", "head|room", {{"offset_K", 2.0}})});
  REQUIRE(text.has_value());
  CHECK(text->find("# No key carries wrong_ambient of head|room.") != std::string::npos);
  const HeatNetwork corrected = load_thermal_plant(folder.file(*text)).network;
  CHECK(corrected.room_inflow[1] == Approx(9.0));
  CHECK(corrected.conductance(0, 1) == Approx(-2.5));
  CHECK(corrected.sensors[0].lag_s == Approx(300.0));
  REQUIRE(corrected.sources.size() == 2);
  CHECK(corrected.sources[1].signal == "feed_mm_per_min");
  CHECK(corrected.sources[1].heat_W == Approx(30.0));
  CHECK(corrected.sources[1].exponent == Approx(2.0));
  CHECK(corrected.sources[1].inflow[1] == 1.0);
  CHECK_FALSE(corrected_machine(folder.file("[plant]\nbody = \"body.toml\"\n"), {}).has_value());
}

TEST_CASE("rows may come at any times and readings may be missing", "[diagnosis][thermal]") {
  const TemporaryFolder folder;
  const ThermalPlant plant = load_thermal_plant(folder.file(network + room));
  RunFile run = run_of(3, 300);
  RunFile thinned = run;
  for (std::vector<double>& values : thinned.values) {
    std::vector<double> kept;
    for (std::size_t row = 0; row < values.size(); ++row)
      if (row < 40 || row % 7 != 3) kept.push_back(values[row]);
    values = kept;
  }
  thinned.selected_end = thinned.rows();
  thinned.values[3][10] = NAN;
  const ThermalRuns runs = thermal_runs(plant, {run, thinned}, {"spindle_rpm"});
  const NetworkSimulation simulation(plant.network);
  CHECK(simulation.readings_degC(runs, 0)[0].tail(1)[0] ==
        Approx(simulation.readings_degC(runs, 1)[0].tail(1)[0]).margin(0.15));
}
