#include <cstdio>
#include <fstream>

#include "config/model/model_file.hpp"
#include "config/runs/model_inputs.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

const std::string good_tables = R"(format = 1
inputs = ["a_degC", "b_degC"]
outputs = ["z_um", "c_urad"]
reference = "first_sample"
matrix_um_per_K = [[1.0, 2.0], [3.0, 4.0]]
[[term]]
kind = "lag_bank"
subjects = ["a_degC", "spindle_rpm", "spindle_rpm", "oil_degC"]
powers = [1, 1, 2, 1]
tau_s = [0, 300.0, 900.0]
gain_um_per_unit.z_um = [[0, 0.1, 0.2], [1e-4, 2e-4, 0], [0, 0, 1e-8], [0.3, 0.2, 0.1]]
[made_from]
runs = ["monday.csv", "tuesday.csv"]
rows = 1200
hours = 20.0
within_one_run = false
columns = ["a_degC", "spindle_rpm"]
low = [18.0, 0.0]
high = [31.0, 5000.0]
tau_s = [0.0]
mean = [24.0, 3.0, 1500.0]
covariance = [[9.0, 1.0, 0.0], [1.0, 4.0, 0.0], [0.0, 0.0, 1e6]]
distance_max = 2.5
[made_from.output.z_um]
remainder_rms_um = 1.1
noise_um = 0.4
noise_time_s = 1800.0
left_out_rms_um = 1.9
no_model_rms_um = 17.0
freedom = 20.0
)";

// NOLINTNEXTLINE(readability-function-size): a table
const std::vector<Broken>& broken_tables() {
  static const std::vector<Broken> table = {
      {"bank of a displacement", "\"oil_degC\"]", "\"z_um\"]", "", "term[1].subjects",
       "must be a temperature"},
      {"bank with a subject twice", "\"oil_degC\"]", "\"a_degC\"]", "", "term[1].subjects",
       "named twice with the same power"},
      {"bank with a power too few", "powers = [1, 1, 2, 1]", "powers = [1, 1, 2]", "",
       "term[1].powers", "one value per subject"},
      {"bank with half a power", "powers = [1, 1, 2, 1]", "powers = [1, 1, 1.5, 1]", "",
       "term[1].powers", "1 or 2"},
      {"bank with falling lags", "tau_s = [0, 300.0, 900.0]", "tau_s = [0, 900.0, 300.0]", "",
       "term[1].tau_s", "strictly increasing"},
      {"bank with a negative lag", "tau_s = [0, 300.0, 900.0]", "tau_s = [-1.0, 300.0, 900.0]", "",
       "term[1].tau_s", "[0"},
      {"bank with a row too few", ", [0.3, 0.2, 0.1]]", "]", "gain_um_per_unit",
       "term[1].gain_um_per_unit.z_um", "must have 4"},
      {"bank with a short row", "[0.3, 0.2, 0.1]", "[0.3, 0.2]", "",
       "term[1].gain_um_per_unit.z_um", "row 4 must have 3"},
      {"bank with a gain beyond", "[0.3, 0.2, 0.1]", "[0.3, 0.2, 1e7]", "",
       "term[1].gain_um_per_unit.z_um", "[-1e6, 1e6]"},
      {"bank of an unknown output", "gain_um_per_unit.z_um", "gain_um_per_unit.w_um", "",
       "term[1].gain_um_per_unit.w_um", "one of the outputs"},
      {"bank with a subject of its own", "powers =", "subject = \"a_degC\"\npowers =",
       "subject = \"a_degC\"", "term[1].subject", "unknown key"},
      {"made from a column that is not read", "columns = [\"a_degC\", \"spindle_rpm\"]",
       "columns = [\"a_degC\", \"feed_rpm\"]", "", "made_from.columns", "that the model reads"},
      {"made from a column twice", "columns = [\"a_degC\", \"spindle_rpm\"]",
       "columns = [\"a_degC\", \"a_degC\"]", "", "made_from.columns", "named twice"},
      {"made from an upside-down range", "high = [31.0, 5000.0]", "high = [11.0, 5000.0]", "",
       "made_from.high", "below low"},
      {"made from a mean too few", "mean = [24.0, 3.0, 1500.0]", "mean = [24.0, 3.0]", "",
       "made_from.mean", "one value per feature (3)"},
      {"made from no covariance", "[1.0, 4.0, 0.0]", "[9.0, 1.0, 0.0]",
       "covariance =", "made_from.covariance", "positive definite"},
      {"made from a flat covariance", "[0.0, 0.0, 1e6]", "[0.0, 0.0, 0.0]",
       "covariance =", "made_from.covariance", "positive definite"},
      {"no distance", "distance_max = 2.5", "distance_max = 0.0", "", "made_from.distance_max",
       "must be in (0"},
      {"figures of an unknown output", "[made_from.output.z_um]", "[made_from.output.w_um]", "",
       "made_from.output.w_um", "an output of the model"},
      {"a figure below 0", "noise_um = 0.4", "noise_um = -0.4", "",
       "made_from.output.z_um.noise_um", "[0"},
      {"an unknown figure", "freedom = 20.0", "freedom = 20.0\nluck = 1.0", "luck = 1.0",
       "made_from.output.z_um.luck", "unknown key"},
  };
  return table;
}

}  // namespace

TEST_CASE("each broken bank or made_from is refused with file, line, key and rule",
          "[config][model]") {
  for (const Broken& broken : broken_tables()) {
    check_refused(broken, good_tables, "model.toml",
                  [](const std::string& text) { return parse_model(text, "model.toml"); });
  }
}

TEST_CASE("an empty bank is refused", "[config][model]") {
  const ModelReading reading = read_model_text(
      "format = 1\ninputs = [\"a_degC\"]\noutputs = [\"z_um\"]\nreference = \"first_sample\"\n"
      "matrix_um_per_K = [[1.0]]\n[[term]]\nkind = \"lag_bank\"\nsubjects = []\ntau_s = [0.0]\n"
      "gain_um_per_unit.z_um = [[0.1]]\n",
      "model.toml");
  REQUIRE(reading.problems.size() == 1);
  CHECK_THAT(reading.problems[0].rule, Catch::Contains("at least one"));
}

TEST_CASE("a bank and what a model was made from are read and written bit for bit",
          "[config][model]") {
  ThermalModel model = parse_model(good_tables, "model.toml");
  REQUIRE(model.terms.size() == 1);
  CHECK(model.terms[0].bank.taus_s == std::vector<double>{0.0, 300.0, 900.0});
  CHECK(model.temperature_columns() == std::vector<std::string>{"a_degC", "b_degC", "oil_degC"});
  CHECK(model.signal_columns() == std::vector<std::string>{"spindle_rpm"});
  REQUIRE(model.made_from);
  CHECK(model.made_from->outputs.at("z_um").freedom == 20.0);
  model.terms[0].bank.gain_um_per_unit["c_urad"] = {
      {1.0 / 3.0, -0.0, 5e-324}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  model.made_from->mean[1] = 1.0 / 3.0;
  const ThermalModel back = parse_model(write_model(model), "written");
  CHECK(back.terms[0].bank == model.terms[0].bank);
  CHECK(back.made_from == model.made_from);
  CHECK(write_model(back) == write_model(model));
}

TEST_CASE("a model is compared if each output has errors on rows left out", "[config][model]") {
  ThermalModel model = parse_model(good_tables, "model.toml");
  CHECK_FALSE(is_compared(model));  // no data on the second output
  model.made_from->outputs["c_urad"] = {};
  CHECK(is_compared(model));
  model.made_from.reset();  // an example, or computed from a structure
  CHECK_FALSE(is_compared(model));
}

TEST_CASE("a model moves the outputs that have a coefficient", "[config][model]") {
  ThermalModel model;
  model.inputs = {"bed_degC"};
  model.outputs = {"x_um", "z_um"};
  model.matrix_um_per_K = {{0.0}, {0.0}};
  CHECK_FALSE(has_gain(model));
  TermSpec term;
  term.kind = "speed_growth";
  term.per_output["gain_um_per_unit2"]["z_um"] = 1e-7;
  model.terms.push_back(term);
  CHECK(has_gain(model));
  CHECK(has_gain(model, "z_um"));
  CHECK_FALSE(has_gain(model, "x_um"));
  model.matrix_um_per_K[0][0] = -2.0;
  CHECK(has_gain(model, "x_um"));
}

TEST_CASE("the commented example of a bank of lags loads", "[config][model]") {
  const ThermalModel model =
      load_model(std::filesystem::path(THERMOCOMP_EXAMPLES) / "lag_bank_model.toml");
  CHECK(model.terms[0].bank.subjects.size() == 4);
  CHECK(model.made_from->columns.size() == 3);
}

TEST_CASE("a copy, and an export that overlaps another, are of one measurement", "[config][run]") {
  const auto course = [](int begin, int end, double shift_s, int seed) {
    std::string text = "time_s,a_degC,z_um\n";
    for (int row = begin; row < end; ++row)
      text += std::to_string(row + shift_s) + "," + std::to_string(20.0 + 0.1 * (row / 2 + seed)) +
              "," + std::to_string((row * 7 + seed) % 5) + "\n";
    return text;
  };
  const auto run = [&](const char* name, int begin, int end, double shift_s, int seed = 0) {
    return parse_run(course(begin, end, shift_s, seed), name);
  };
  const RunFile day = run("a.csv", 0, 100, 0.0);
  CHECK(share_rows(day, run("copy.csv", 0, 100, 0.0)));
  CHECK(share_rows(day, run("later.csv", 60, 200, -60.0)));
  CHECK(share_rows(run("later.csv", 60, 200, -60.0), day));
  CHECK_FALSE(share_rows(day, run("next.csv", 100, 200, 0.0)));
  CHECK_FALSE(share_rows(day, run("other.csv", 0, 100, 0.0, 3)));
  // Coarse steps of two warm-ups: the same values, at other times.
  std::string slow = "time_s,a_degC\n", fast = slow;
  for (int row = 0; row < 100; ++row) {
    const std::string value = std::to_string(20.0 + 0.1 * row) + "\n";
    slow += std::to_string(10 * row + row % 7) + "," + value;
    fast += std::to_string(9 * row + row % 3) + "," + value;
  }
  CHECK_FALSE(share_rows(parse_run(slow, "slow.csv"), parse_run(fast, "fast.csv")));
  CHECK_THROWS_WITH(refuse_overlap(std::vector<RunFile>{day, run("copy.csv", 0, 100, 0.0)}),
                    Catch::Contains("copy.csv") && Catch::Contains("a.csv"));
}

TEST_CASE("runs of the same file overlap if they have common rows", "[config][run]") {
  const std::string text = "time_s,a_degC\n0,1\n1,1\n2,1\n3,1\n";
  const auto run = [&](const char* name, double from_s, double to_s) {
    RunSelection selection;
    selection.from_s = from_s;
    selection.to_s = to_s;
    return parse_run(text, name, selection);
  };
  CHECK(share_rows(run("a.csv", 0, 3), run("a.csv", 2, 9)));
  CHECK_FALSE(share_rows(run("a.csv", 0, 2), run("a.csv", 2, 9)));
  CHECK_FALSE(share_rows(run("a.csv", 0, 3), run("b.csv", 0, 3)));
  const std::vector<RunFile> train{run("a.csv", 0, 2)};
  CHECK_NOTHROW(refuse_overlap(train, std::vector<RunFile>{run("a.csv", 2, 9)}));
  CHECK_THROWS_WITH(refuse_overlap(train, std::vector<RunFile>{run("a.csv", 1, 9)}),
                    Catch::StartsWith("a.csv: is judged") && Catch::Contains("must not overlap"));
  CHECK_THROWS_WITH(refuse_overlap(std::vector<RunFile>{run("a.csv", 0, 2), run("a.csv", 1, 3)}),
                    Catch::Contains("given twice"));
}
