#include "config/model/model_file.hpp"

#include <cmath>
#include <iostream>
#include <limits>
#include <set>

#include "config/runs/run_file.hpp"
#include "estimator/model/displacement_model.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

const std::string good = R"(format = 1
inputs = ["a_degC", "b_degC"]
outputs = ["z_um", "c_urad"]
reference = [20.0, 21.0]
matrix_um_per_K = [[1.0, 2.0], [3.0, 4.0]]
[guideway.slide]
axis = "x_mm"
positions_mm = [0.0, 100.0]
rows_um_per_K.z_um = [[0.5, 0.0], [0.0, 0.5]]
[[term]]
kind = "thermal_lag"
subject = "a_degC"
tau_s = 900.0
gain_um_per_K = { z_um = 1.2 }
[[term]]
kind = "missing_heat_source"
subject = "spindle_rpm"
tau_s = 1800.0
power = 2
gain_um_per_unit = { z_um = 1e-7 }
[[term]]
kind = "missing_temperature"
subject = "oil_degC"
tau_s = 0.0
gain_um_per_K = { z_um = 0.1, c_urad = 0.2 }
[covariance]
matrix_K2 = [[4.0, 1.0], [1.0, 9.0]]
)";

const std::string with_more_terms = good + R"([[term]]
kind = "slow_sensor"
subject = "b_degC"
tau_s = 60.0
[[term]]
kind = "sensor_swap"
subject = "a_degC|b_degC"
[[term]]
kind = "position_dependence"
subject = "oil_degC|x_mm"
p0_mm = 50.0
gain_um_per_K_mm = { z_um = 0.01 }
[[term]]
kind = "hysteresis"
subject = "c_urad"
width_um = 2.0
[[term]]
kind = "hysteresis"
subject = "a_degC"
width_K = 0.5
[[term]]
kind = "nonlinear_expansion"
subject = "oil_degC"
gain_um_per_K2 = { z_um = 0.1 }
[[term]]
kind = "wrong_coefficient"
subject = "b_degC"
delta_um_per_K = { c_urad = 0.4 }
[[term]]
kind = "start_dependence"
subject = "speed_rpm|oil_degC"
at_start = 1
place0_degC = 20.0
tau_s = 780.0
gain_um_per_unit_K = { z_um = 0.0002 }
)";

// NOLINTNEXTLINE(readability-function-size): a table
const std::vector<Broken>& broken_models() {
  static const std::vector<Broken> table = {
      {"unknown key", "reference =", "refrence = 1\nreference =", "", "refrence",
       "did you mean \"reference\"?"},
      {"format missing", "format = 1\n", "", "inputs", "format", "must be given"},
      {"format of the future", "format = 1\n", "format = 2\n", "", "format", "[1, 1]"},
      {"format a string", "format = 1\n", "format = \"1\"\n", "", "format", "whole number"},
      {"inputs missing", "inputs = [\"a_degC\", \"b_degC\"]\n", "", "format", "inputs",
       "must be given"},
      {"no input", "inputs = [\"a_degC\", \"b_degC\"]", "inputs = []", "", "inputs",
       "at least one"},
      {"input twice", "\"b_degC\"]", "\"a_degC\"]", "", "inputs", "named twice"},
      {"input no temperature", "inputs = [\"a_degC\", \"b_degC\"]",
       "inputs = [\"a_degC\", \"b_rpm\"]", "", "inputs", "must be a temperature"},
      {"input no string", "\"b_degC\"]", "5]", "", "inputs", "must be a string"},
      {"input with a comma", "\"b_degC\"]", "\"b,_degC\"]", "", "inputs", "comma"},
      {"reference too short", "reference = [20.0, 21.0]", "reference = [20.0]", "", "reference",
       "one value per input (2)"},
      {"reference not a number", "reference = [20.0, 21.0]", "reference = [20.0, nan]", "",
       "reference", "finite"},
      {"reference unknown word", "reference = [20.0, 21.0]", "reference = \"last_sample\"", "",
       "reference", "first_sample"},
      {"reference missing", "reference = [20.0, 21.0]\n", "", "format", "reference",
       "must be given"},
      {"matrix missing", "matrix_um_per_K = [[1.0, 2.0], [3.0, 4.0]]\n", "", "format",
       "matrix_um_per_K", "must be given"},
      {"matrix with a short row", "[[1.0, 2.0], [3.0, 4.0]]", "[[1.0], [3.0, 4.0]]", "",
       "matrix_um_per_K", "row 1 must have 2"},
      {"matrix with too many rows", "[[1.0, 2.0], [3.0, 4.0]]", "[[1, 2], [3, 4], [5, 6]]", "",
       "matrix_um_per_K", "must have 2"},
      {"matrix with NaN", "[[1.0, 2.0], [3.0, 4.0]]", "[[1.0, nan], [3.0, 4.0]]", "",
       "matrix_um_per_K", "row 1 column 2 must be a finite number"},
      {"matrix with infinity", "[[1.0, 2.0], [3.0, 4.0]]", "[[1.0, 2.0], [inf, 4.0]]", "",
       "matrix_um_per_K", "row 2 column 1"},
      {"matrix with text", "[[1.0, 2.0], [3.0, 4.0]]", "[[1.0, \"2\"], [3.0, 4.0]]", "",
       "matrix_um_per_K", "must be a number"},
      {"guideway axis no position", "axis = \"x_mm\"", "axis = \"x_um\"", "", "guideway.slide.axis",
       "*_mm"},
      {"guideway positions fall", "positions_mm = [0.0, 100.0]", "positions_mm = [100.0, 0.0]", "",
       "guideway.slide.positions_mm", "strictly increasing"},
      {"guideway positions equal", "positions_mm = [0.0, 100.0]", "positions_mm = [5.0, 5.0]", "",
       "guideway.slide.positions_mm", "strictly increasing"},
      {"guideway rows too few", "[[0.5, 0.0], [0.0, 0.5]]", "[[0.5, 0.0]]", "",
       "guideway.slide.rows_um_per_K.z_um", "must have 2"},
      {"guideway of an unknown output", "rows_um_per_K.z_um", "rows_um_per_K.w_um",
       "rows_um_per_K.w_um", "guideway.slide.rows_um_per_K.w_um", "one of the outputs"},
      {"guideway with an unknown key", "axis = \"x_mm\"", "axis = \"x_mm\"\nspeed = 3", "speed = 3",
       "guideway.slide.speed", "unknown key"},
      {"term of an unknown kind", "kind = \"thermal_lag\"", "kind = \"thermal_leg\"", "",
       "term[1].kind", "must be one of: thermal_lag"},
      {"lag of what is no input", "subject = \"a_degC\"", "subject = \"x_degC\"", "",
       "term[1].subject", "one of the inputs: a_degC, b_degC"},
      {"heat source from a temperature", "subject = \"spindle_rpm\"", "subject = \"x_degC\"", "",
       "term[2].subject", "not a temperature"},
      {"other temperature that is an input", "subject = \"oil_degC\"", "subject = \"b_degC\"", "",
       "term[3].subject", "not among the inputs"},
      {"other temperature that is a signal", "subject = \"oil_degC\"", "subject = \"oil_rpm\"", "",
       "term[3].subject", "must be a temperature"},
      {"parameter missing", "tau_s = 900.0\n", "", "[[term]]", "term[1].tau_s", "must be given"},
      {"parameter out of range", "tau_s = 900.0", "tau_s = 0.0", "", "term[1].tau_s", "[0.001"},
      {"parameter unknown", "tau_s = 900.0", "tau_s = 900.0\nphase = 3", "phase = 3",
       "term[1].phase", "unknown key"},
      {"parameter not whole", "power = 2", "power = 1.5", "", "term[2].power", "whole number"},
      {"parameter beyond", "power = 2", "power = 3", "", "term[2].power", "[1, 2]"},
      {"gain of an unknown output", "{ z_um = 1.2 }", "{ w_um = 1.2 }", "",
       "term[1].gain_um_per_K.w_um", "one of the outputs"},
      {"gain without a table", "{ z_um = 1.2 }", "1.2", "gain_um_per_K = 1.2",
       "term[1].gain_um_per_K", "must be a table"},
      {"gain of no output", "{ z_um = 1.2 }", "{ }", "", "term[1].gain_um_per_K", "at least one"},
      {"gain not a number", "{ z_um = 1.2 }", "{ z_um = nan }", "", "term[1].gain_um_per_K.z_um",
       "finite"},
      {"covariance not symmetric", "[[4.0, 1.0], [1.0, 9.0]]", "[[4.0, 1.0], [2.0, 9.0]]", "",
       "covariance.matrix_K2", "symmetric"},
      {"covariance not positive", "[[4.0, 1.0], [1.0, 9.0]]", "[[4.0, 7.0], [7.0, 9.0]]", "",
       "covariance.matrix_K2", "positive semidefinite"},
      {"covariance with a factor too few", "[covariance]", "[covariance]\ndrift_factor = [1.0]",
       "drift_factor = [1.0]", "covariance.drift_factor", "must have one value per input"},
      {"covariance with a factor below 0", "[covariance]",
       "[covariance]\nscatter_factor = [1.0, -1.0]", "scatter_factor", "covariance.scatter_factor",
       "must be in [0, "},
      {"covariance without noise", "[covariance]", "[covariance]\nnoise_K = 0.0", "noise_K",
       "covariance.noise_K", "must be in (0, 10]"},
      {"covariance with an unknown key", "[covariance]", "[covariance]\nunit = \"K2\"",
       "unit = \"K2\"", "covariance.unit", "unknown key"},
  };
  return table;
}

const std::vector<Broken>& broken_terms() {
  static const std::vector<Broken> table = {
      {"swap of one channel", "subject = \"a_degC|b_degC\"", "subject = \"a_degC\" # one", "",
       "term[5].subject", "two of the inputs"},
      {"swap in the wrong order", "\"a_degC|b_degC\"", "\"b_degC|a_degC\"", "", "term[5].subject",
       "lexical order"},
      {"swap with itself", "\"a_degC|b_degC\"", "\"a_degC|a_degC\"", "", "term[5].subject",
       "two of the inputs"},
      {"position with a signal", "\"oil_degC|x_mm\"", "\"oil_degC|x_rpm\"", "", "term[6].subject",
       "a temperature and a position"},
      {"position of nothing", "\"oil_degC|x_mm\"", "\"oil_degC|\"", "", "term[6].subject",
       "a temperature and a position"},
      {"position of three", "\"oil_degC|x_mm\"", "\"oil_degC|x_mm|y_mm\"", "", "term[6].subject",
       "a temperature and a position"},
      {"play of an unknown output", "subject = \"c_urad\"", "subject = \"d_urad\"", "",
       "term[7].subject", "one of the outputs"},
      {"play of an output in K too", "width_um = 2.0", "width_um = 2.0\nwidth_K = 2.0",
       "width_K = 2.0", "term[7].width_K", "unknown key"},
      {"play of a temperature in um too", "width_K = 0.5", "width_K = 0.5\nwidth_um = 0.5",
       "width_um = 0.5", "term[8].width_um", "unknown key"},
      {"play of a negative width", "width_K = 0.5", "width_K = -0.5", "", "term[8].width_K", "[0"},
      {"square of a signal", "subject = \"oil_degC\"\ngain_um_per_K2",
       "subject = \"oil_rpm\"\ngain_um_per_K2", "subject = \"oil_rpm\"", "term[9].subject",
       "must be a temperature"},
      {"a day that begins by a signal", "\"speed_rpm|oil_degC\"", "\"oil_degC|speed_rpm\"", "",
       "term[11].subject", "must be a cause"},
      {"what acts alone", "\"speed_rpm|oil_degC\"", "\"speed_rpm\" # one", "", "term[11].subject",
       "must be a cause"},
      {"half at the start", "at_start = 1", "at_start = 2", "", "term[11].at_start", "[0, 1]"},
  };
  return table;
}

std::filesystem::path spindle_data() {
  const char* given = std::getenv("THERMOCOMP_DATA");
  const std::filesystem::path data =
      given != nullptr ? std::filesystem::path(given)
                       : std::filesystem::path(THERMOCOMP_SOURCE).parent_path() / "shared" / "data";
  return data / "spindle_46h";
}

}  // namespace

TEST_CASE("each broken model is refused with file, line, key, value and rule", "[config][model]") {
  CHECK(broken_models().size() >= 30);
  for (const Broken& broken : broken_models()) {
    check_refused(broken, good, "model.toml",
                  [](const std::string& text) { return parse_model(text, "model.toml"); });
  }
}

TEST_CASE("each broken term is refused with file, line, key, value and rule", "[config][model]") {
  for (const Broken& broken : broken_terms()) {
    check_refused(broken, with_more_terms, "model.toml",
                  [](const std::string& text) { return parse_model(text, "model.toml"); });
  }
}

TEST_CASE("all problems of a model are reported at once", "[config][model]") {
  std::string text = edited(good, "[[1.0, 2.0], [3.0, 4.0]]", "[[nan, 2.0], [3.0, \"x\"]]");
  text = edited(text, "power = 2", "power = 7");
  text = edited(text, "axis = \"x_mm\"", "axis = \"x\"");
  text = edited(text, "reference = [20.0, 21.0]", "reference = []");
  CHECK(problems_of([&] { return parse_model(text, "m"); }).size() == 5);
}

TEST_CASE("a model is loaded as in its file", "[config][model]") {
  const ThermalModel model = parse_model(good, "model.toml");
  CHECK(model.inputs == std::vector<std::string>{"a_degC", "b_degC"});
  CHECK(model.reference_degC == std::vector<double>{20, 21});
  CHECK(model.matrix_um_per_K[1][0] == 3.0);
  REQUIRE(model.guideways.size() == 1);
  CHECK(model.guideways[0].rows_um_per_K.at("z_um")[1][1] == 0.5);
  REQUIRE(model.terms.size() == 3);
  CHECK(model.terms[1].shared.at("power") == 2.0);
  CHECK(model.terms[2].per_output.at("gain_um_per_K").at("c_urad") == 0.2);
  CHECK(model.covariance_K2[0][1] == 1.0);
  CHECK(parse_model(edited(good, "[20.0, 21.0]", "\"first_sample\""), "m").reference_degC.empty());
}

TEST_CASE("writing then reading a model preserves every bit", "[config][model]") {
  ThermalModel model = parse_model(with_more_terms, "model.toml");
  REQUIRE(model.terms.size() == 11);
  model.matrix_um_per_K = {{1.0 / 3.0, -0.0}, {5e-324, 1.7976931348623157e308}};
  model.reference_degC = {20.000000000000004, 1e-5};
  model.guideways[0].name = "slide \"one\"";
  const ThermalModel back = parse_model(write_model(model), "written");
  CHECK(back.matrix_um_per_K == model.matrix_um_per_K);
  CHECK(std::signbit(back.matrix_um_per_K[0][1]));
  CHECK(back.reference_degC == model.reference_degC);
  CHECK(back.guideways[0].name == model.guideways[0].name);
  CHECK(back.terms[1].shared == model.terms[1].shared);
  CHECK(back.terms[2].per_output == model.terms[2].per_output);
  for (std::size_t i = 0; i < model.terms.size(); ++i) {
    CHECK(back.terms[i].kind == model.terms[i].kind);
    CHECK(back.terms[i].subject == model.terms[i].subject);
    CHECK(back.terms[i].shared == model.terms[i].shared);
  }
  CHECK(back.covariance_K2 == model.covariance_K2);
  CHECK(write_model(back) == write_model(model));
}

TEST_CASE("every kind of term has an example, which is read, written and evaluated",
          "[config][model]") {
  const std::filesystem::path folder =
      std::filesystem::path(THERMOCOMP_SOURCE) / "tests/example_terms";
  const std::string before = text_of(folder / "model.toml");
  std::set<const TermKind*> kinds;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().filename() == "model.toml") continue;
    INFO(entry.path());
    const ThermalModel model = parse_model(before + text_of(entry.path()), "model.toml");
    REQUIRE(model.terms.size() == 1);
    const TermSpec& term = model.terms[0];
    kinds.insert(find_term_kind(term.kind, term.subject));
    CHECK_FALSE(term.subjects().empty());
    const ThermalModel back = parse_model(write_model(model), "written");
    CHECK(back.terms[0].kind == term.kind);
    CHECK(back.terms[0].subject == term.subject);
    CHECK(back.terms[0].shared == term.shared);
    CHECK(back.terms[0].per_output == term.per_output);
    CHECK(back.terms[0].bank == term.bank);
    CHECK_NOTHROW(DisplacementModel(model));
  }
  CHECK(kinds.size() == term_kinds().size());
}

namespace {

const char* const with_course =
    "format = 1\ninputs = [\"a_degC\", \"b_degC\"]\noutputs = [\"z_um\"]\n"
    "reference = \"first_sample\"\nmatrix_um_per_K = [[1.0, 2.0]]\n[course]\nruns = [\"day.csv\"]\n"
    "bandwidth = 0.25\n[[course.group]]\ninputs = [\"a_degC\"]\n[[course.group]]\n"
    "inputs = [\"b_degC\"]\n[course.output.z_um]\nphase = [\"heating\", \"cooling\"]\n"
    "since_s = [60.0, 1e3]\nrise_K = [[0.1, 0.3333333333333333], [2.0, 1.0]]\n"
    "gain = [[1.1, 1.0], [1.2, 0.9]]\ngain_sd = [[0.1, 0.3], [0.1, 0.05]]\n";

}  // namespace

TEST_CASE("a model that is too expensive for the daemon is refused", "[config][model]") {
  std::string text = good;
  for (int i = 0; i < 2000; ++i)
    text +=
        "[[term]]\nkind = \"thermal_lag\"\nsubject = \"a_degC\"\ntau_s = " + std::to_string(i + 1) +
        "\ngain_um_per_K = { z_um = 0.001 }\n";
  const std::vector<Problem> many = read_model_text(text, "m.toml").problems;
  REQUIRE(many.size() == 1);
  CHECK(many.front().key == "term");
  CHECK(many.front().value == "2003 terms");
  CHECK(many.front().rule == "must be at most 2000");

  // 16 time constants and 256 columns each, with gains for both outputs.
  text = good;
  std::string columns;
  std::string rows;
  for (int i = 0; i < 256; ++i) {
    columns += (i > 0 ? ", \"s" : "\"s") + std::to_string(i) + "_rpm\"";
    rows += (i > 0 ? ", [" : "[") + std::string("0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]");
  }
  for (int i = 0; i < 82; ++i)
    text += "[[term]]\nkind = \"lag_bank\"\nsubjects = [" + columns +
            "]\ntau_s = [1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16]\n"
            "gain_um_per_unit = { z_um = [" +
            rows + "], c_urad = [" + rows + "] }\n";
  const ModelReading reading = read_model_text(text, "m.toml");
  const double operations = model_operations(reading.model);
  CHECK(operations > 82 * 256 * 16 * 3);
  REQUIRE(reading.problems.size() == 1);
  CHECK_THAT(reading.problems.front().rule, Catch::Contains("must take at most 1000000"));
}

TEST_CASE("a recorded course is read and written bit for bit", "[config][model]") {
  const ThermalModel model = parse_model(with_course, "model.toml");
  REQUIRE(model.course);
  CHECK(model.course->bandwidth == 0.25);
  REQUIRE(model.course->outputs.at("z_um").size() == 2);
  CHECK(model.course->outputs.at("z_um")[1].phase == CoursePhase::cooling);
  CHECK(model.course->outputs.at("z_um")[0].rise_K == std::vector<double>{0.1, 1.0 / 3.0});
  const ThermalModel back = parse_model(write_model(model), "written");
  CHECK(back.course == model.course);
  CHECK(write_model(back) == write_model(model));
}

TEST_CASE("a broken course is named by key and rule", "[config][model]") {
  const auto [from, to, message] = GENERATE(table<std::string, std::string, std::string>(
      {{"\"cooling\"", "\"cold\"", "must be \"heating\", \"turned\" or \"cooling\""},
       {"since_s = [60.0, 1e3]", "since_s = [60.0]", "must have one value per point (2)"},
       {"[1.2, 0.9]", "[1.2, 1e308]", "must be in [0, 10]"},
       {"[2.0, 1.0]]", "[2.0]]", "must have 2"},
       {"[0.1, 0.05]]", "[0.1, nan]]", "finite"},
       {"inputs = [\"b_degC\"]", "inputs = [\"a_degC\"]", "is named already"},
       {"output.z_um", "output.y_um", "must be an output of the model"},
       {"bandwidth = 0.25", "bandwidth = 0.0", "bandwidth"},
       {"[[course.group]]\ninputs = [\"a_degC\"]\n[[course.group]]\ninputs = [\"b_degC\"]\n", "",
        "must be 1 to 4 groups"}}));
  std::string text = with_course;
  const auto at = text.find(from);
  REQUIRE(at != std::string::npos);
  text.replace(at, from.size(), to);
  CHECK_THROWS_WITH(parse_model(text, "model.toml"), Catch::Contains(message));
}

TEST_CASE("the uncertainty growth of estimates is read and written bit for bit",
          "[config][model]") {
  const std::string text =
      "format = 1\ninputs = [\"a_degC\", \"b_degC\"]\noutputs = [\"z_um\"]\n"
      "reference = \"first_sample\"\nmatrix_um_per_K = [[1.0, 2.0]]\n[covariance]\n"
      "matrix_K2 = [[4.0, 1.0], [1.0, 9.0]]\nnoise_K = 0.05\ndrift_factor = [3.1, 0.1]\n"
      "drift_time_s = 7200\nscatter_factor = [0.3, 0.0]\nscatter_time_s = 71.3\n";
  const ThermalModel model = parse_model(text, "m");
  CHECK(model.covariance_growth.drift_factor == std::vector<double>{3.1, 0.1});
  CHECK(model.covariance_growth.noise_K == 0.05);
  const ThermalModel back = parse_model(write_model(model), "back");
  CHECK(back.covariance_growth.noise_K == model.covariance_growth.noise_K);
  CHECK(back.covariance_growth.drift_factor == model.covariance_growth.drift_factor);
  CHECK(back.covariance_growth.drift_time_s == 7200.0);
  CHECK(back.covariance_growth.scatter_factor == model.covariance_growth.scatter_factor);
  CHECK(back.covariance_growth.scatter_time_s == 71.3);
}

TEST_CASE("a barely semidefinite covariance is accepted", "[config][model]") {
  CHECK_NOTHROW(parse_model(edited(good, "[[4.0, 1.0], [1.0, 9.0]]", "[[4, 6], [6, 9]]"), "m"));
  CHECK_NOTHROW(parse_model(edited(good, "[[4.0, 1.0], [1.0, 9.0]]", "[[0, 0], [0, 0]]"), "m"));
}

TEST_CASE("the checksum is SHA-256 (FIPS 180-4, examples)", "[config][model]") {
  CHECK(sha256_hex("") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  CHECK(sha256_hex("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST_CASE("the spindle model and its run load", "[config][model][data]") {
  const auto folder = spindle_data();
  if (!std::filesystem::exists(folder / "static_model.toml")) {
    std::cout << "skipped: no data in " << folder << '\n';
    return;
  }
  const ThermalModel model = load_model(folder / "static_model.toml");
  CHECK(model.inputs.size() == 16);
  CHECK(model.outputs.size() == 5);
  const RunFile run = load_run(parse_selection((folder / "hours_00_32.csv").string()));
  CHECK(run.rows() == 7705);
  for (const std::string& input : model.inputs) CHECK(run.find(input).has_value());
}

TEST_CASE("a diameter names one of the outputs once, and survives writing", "[model_file]") {
  const std::string text =
      "format = 1\ninputs = [\"t1_degC\"]\noutputs = [\"dia_um\"]\nreference = \"first_sample\"\n"
      "matrix_um_per_K = [[4.0]]\n";
  const std::string diameter = "[[diameter]]\noutput = \"dia_um\"\naxis = \"x\"\n";
  const ThermalModel model = parse_model(text + diameter, "m.toml");
  CHECK(model.diameters == std::vector<DiameterSpec>{{"dia_um", "x", 1.0}});
  CHECK(in_axis_units(model).matrix_um_per_K[0][0] == 2.0);
  CHECK(parse_model(write_model(model), "m.toml").diameters == model.diameters);
  const ThermalModel other = parse_model(text + diameter + "sign = \"-\"\n", "m.toml");
  CHECK(in_axis_units(other).matrix_um_per_K[0][0] == -2.0);
  CHECK(parse_model(write_model(other), "m.toml").diameters == other.diameters);
  CHECK_THROWS_WITH(parse_model(text + diameter + diameter, "m.toml"),
                    Catch::Contains("is a diameter already"));
  CHECK_THROWS_WITH(parse_model(text + "[[diameter]]\noutput = \"d_um\"\naxis = \"x\"\n", "m.toml"),
                    Catch::Contains("must be an output of the model"));
}
