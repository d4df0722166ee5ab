#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "modelling/diagnosis/answer/diagnosis_report.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "report/svg_plot.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

constexpr Eigen::Index rows_shown = 120;
const std::string rude = "run <b>&\"1\".csv";

Column wave(double size, double turn) {
  Column values(rows_shown);
  for (Eigen::Index i = 0; i < rows_shown; ++i)
    values[i] = size * std::sin(turn * static_cast<double>(i));
  return values;
}

ReportData one_run() {
  ReportData data{{"z_um"}, {"spindle_rpm"}, {"t1_degC"}, {}};
  ReportRun run{rude,
                true,
                Column::LinSpaced(rows_shown, 0.0, 60.0 * (rows_shown - 1)),
                std::vector<Phase>(rows_shown, Phase::heating),
                {wave(20.0, 0.02)},
                {wave(5.0, 0.1)},
                {wave(1.0, 0.3)},
                {wave(3000.0, 0.05)},
                {wave(8.0, 0.1)}};
  run.before_um[0][7] = NAN;  // a missing value
  data.runs.push_back(std::move(run));
  return data;
}

Diagnosis none() {
  Diagnosis diagnosis;
  diagnosis.verdict = "none";
  diagnosis.outputs["z_um"] = {5.0, 5.1, 9.0, 5.1, 9.0, 1.0};
  return diagnosis;
}

Diagnosis with_findings() {
  Diagnosis diagnosis = none();
  diagnosis.verdict = "effect";
  diagnosis.findings.push_back({"missing_heat_source",
                                "a<b&c_rpm",
                                {"z_um"},
                                {{"tau_s", {{"", 1810.0}}, {{"", {1650.0, 2000.0}}}}},
                                {},
                                "takes 61 % of the RMS",
                                {{"thermal_lag", "t1_degC", 0.4}},
                                {{"z_um", {6.7, 2.4, 0.64, {0.55, 0.71}}}}});
  diagnosis.findings.push_back({"sensor_step", "t1_degC", {}, {}, rude, "", {}, {}});
  return diagnosis;
}

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t found = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1))
    ++found;
  return found;
}

bool has(const std::string& text, const std::string& what) {
  return count(text, what) > 0;
}

}  // namespace

TEST_CASE("a finding that the test runs contradict is not recommended", "[diagnosis]") {
  Diagnosis diagnosis = with_findings();
  NamedFinding& finding = diagnosis.findings.front();
  const std::string usual = what_to_do(finding);
  REQUIRE_FALSE(fails_on_test_runs(finding));
  finding.test["z_um"] = {2.4, 3.0, -0.25, {-0.4, -0.1}};
  CHECK(fails_on_test_runs(finding));
  CHECK(sentence_of(finding).find(
            "Error on the test runs without and with it: z 2.4 and 3.0 (larger)") !=
        std::string::npos);
  CHECK(what_to_do(finding).starts_with("Do not use it yet"));
  CHECK(what_to_do(finding).ends_with(usual));
  finding.test["x_um"] = {2.0, 1.0, 0.5, {0.4, 0.6}};
  CHECK(what_to_do(finding) == usual);
}

TEST_CASE("the report is self-contained", "[diagnosis][report]") {
  for (const Diagnosis& diagnosis : {none(), with_findings()}) {
    const std::string html = report_html(diagnosis, one_run());
    for (const char* outside : {"http", "src=", "href=", "@import", "url(", "<script", "<link"})
      CHECK_FALSE(has(html, outside));
    CHECK(html.starts_with("<!DOCTYPE html>"));
    CHECK(has(html, "</html>"));
    for (const auto& [open, close] : {std::pair{"<html", "</html"}, std::pair{"<body", "</body"},
                                      std::pair{"<table", "</table"}, std::pair{"<svg", "</svg"},
                                      std::pair{"<h1", "</h1"}, std::pair{"<h2", "</h2"}})
      CHECK(count(html, open) == count(html, close));
  }
}

TEST_CASE("the report has sentence, advice and experiment of each finding", "[diagnosis][report]") {
  const Diagnosis diagnosis = with_findings();
  const std::string html = report_html(diagnosis, one_run());
  for (const NamedFinding& finding : diagnosis.findings) {
    const std::string sentence = sentence_of(finding);
    CHECK(sentence.ends_with("."));
    CHECK(has(html, xml_text(sentence)));
    CHECK_FALSE(what_to_do(finding).empty());
    CHECK(has(html, xml_text(what_to_do(finding))));
  }
  CHECK(has(html, "time constant 30 min (28 min to 33 min)"));
  CHECK(has(html, "Heat that no sensor sees"));
  CHECK(has(html, "6.7 and 2.4"));
  CHECK(has(html, xml_text(experiment_between(
                      {diagnosis.findings[0].cause, diagnosis.findings[0].subject, 1.0},
                      diagnosis.findings[0].alternatives[0]))));
}

TEST_CASE("names are escaped in the report", "[diagnosis][report]") {
  const std::string html = report_html(with_findings(), one_run());
  CHECK_FALSE(has(html, "<b>&"));
  CHECK_FALSE(has(html, "a<b&c"));
  CHECK(has(html, xml_text(rude)));
  CHECK(has(html, xml_text("a<b&c_rpm")));
}

TEST_CASE("the plots are there with and without a finding", "[diagnosis][report]") {
  const std::string silent = report_html(none(), one_run());
  const std::string named = report_html(with_findings(), one_run());
  // The course over signals and temperatures, and what the error goes with.
  CHECK(count(silent, "<svg") == 2);
  CHECK(count(named, "<svg") == 2);
  for (const std::string& html : {silent, named}) {
    CHECK(count(html, "d=\"M") >= 3);
    CHECK_FALSE(has(html, "nan"));
    CHECK(has(html, "heating"));
  }
  CHECK(count(silent, "<h3>") == 0);
  CHECK(has(silent, "Nothing worth saying"));
  CHECK(count(named, "<h3>") == 2);
}

TEST_CASE("numbers have two digits, three if the first is 1, and durations a suitable unit",
          "[diagnosis][report]") {
  CHECK(figure(0.0039628) == "0.0040");
  CHECK(figure(5.653) == "5.7");
  CHECK(figure(1.8104) == "1.81");
  CHECK(figure(-92.6) == "-93");
  CHECK(figure(1234.0) == "1230");
  CHECK(figure(9.97) == "10.0");
  CHECK(figure(0.0) == "0");
  CHECK(figure(NAN) == "-");
  CHECK(duration(45.0) == "45 s");
  CHECK(duration(3162.6) == "53 min");
  CHECK(duration(9000.0) == "2.5 h");
}

TEST_CASE(
    "a parameter is reported in words with its unit, an interval only where it says something",
    "[diagnosis][report]") {
  const Parameter heat{"gain_um_per_unit", {{"z_um", 0.0039628}}, {{"z_um", {0.00396, 0.00397}}}};
  CHECK(parameter_words("missing_heat_source", heat, "spindle_rpm") ==
        "effect 4.0 µm/(1000 rpm) in z");
  CHECK(parameter_words("missing_heat_source", heat, "x_mm_per_min") ==
        "effect 0.0040 µm/(mm/min) in z");
  const Parameter growth{"gain_um_per_unit2", {{"z_um", 2.5}}, {}};
  CHECK(parameter_words("speed_growth", growth, "x_mm_per_min") == "effect 2.5 µm/(mm/min)^2 in z");
  CHECK(parameter_words("speed_growth", growth, "cos_elevation") ==
        "effect 2.5 µm/cos_elevation^2 in z");
  const Parameter lag{"tau_s", {{"", 3162.6}}, {{"", {2800.0, 3500.0}}}};
  CHECK(parameter_words("thermal_lag", lag, "t1_degC") ==
        "time constant 53 min (47 min to 58 min)");
  CHECK(parameter_words("missing_heat_source", {"power", {{"", 2.0}}, {}}, "x") ==
        "with the square of the signal");
  CHECK(parameter_words("displacement_step", {"step_um", {{"", -2.5}}, {}}, "z_um") ==
        "jump -2.5 µm");
  CHECK(parameter_words("displacement_step", {"news", {{"", 3.0}}, {}}, "z_um") == "news 3.0");
  CHECK(parameter_words("sensor_loose", {"gain", {{"", 0.5}}, {}}, "t1_degC") ==
        "of its motion left: 0.50");
}

TEST_CASE("an axis has round ticks within its range", "[diagnosis][report]") {
  CHECK(round_ticks(0.0, 10.0, 5) == std::vector<double>{0, 2, 4, 6, 8, 10});
  const std::vector<double> small = round_ticks(-0.013, 0.021, 4);
  REQUIRE(small.size() == 4);
  CHECK(small[1] == 0.0);
  CHECK(small[3] == Approx(0.02));
  CHECK(round_ticks(3.0, 3.0, 5).empty());
  CHECK(round_ticks(24.1, 32.2, 10).front() == Approx(25.0));
}

TEST_CASE("advice is first and sorted by gain", "[diagnosis][report]") {
  Diagnosis diagnosis = with_findings();
  diagnosis.remainder.emplace();
  diagnosis.remainder->test["z_um"] = {12.0, 2.0, 0.83, {0.7, 0.9}};
  diagnosis.remainder->term.bank.gain_um_per_unit["z_um"] = {};
  const std::string html = report_html(diagnosis, one_run());
  const std::size_t bank = html.find("What can be predicted and has no name (up to 10.0 µm");
  const std::size_t heat = html.find("(up to 4.3 µm RMS less). Use the extended model");
  REQUIRE(bank != std::string::npos);
  REQUIRE(heat != std::string::npos);
  CHECK(bank < heat);
  CHECK(heat < html.find("<h2>What was found"));
  diagnosis.remainder->term.bank.gain_um_per_unit.clear();
  const std::string without = report_html(diagnosis, one_run());
  CHECK(without.find("The extended model carries it by readings") == std::string::npos);
  CHECK(without.find("the extended model goes without it") != std::string::npos);
}

TEST_CASE("what is left is reported beside what moved, and folded but for the first test run",
          "[diagnosis][report]") {
  ReportData data = one_run();
  data.runs.push_back(data.runs.front());
  data.runs.back().name = "second.csv";
  const std::string html = report_html(with_findings(), data);
  // 20 sin(0.02 i), i < 120: RMS 15.5
  CHECK(has(html, "z: 5.1 of 15.5 µm (RMS) is left on the test rows (33 %)"));
  CHECK(html.find("<h2>" + xml_text(rude)) != std::string::npos);
  CHECK(has(html, "<details><summary>second.csv (test: nothing was fitted to these rows)"));
  CHECK(count(html, "<details") == count(html, "</details>"));
  CHECK_FALSE(has(html, " um"));
}

TEST_CASE("a test run that the model was fitted to is not called unseen", "[diagnosis][report]") {
  ReportData data = one_run();
  data.runs.front().of_the_model = true;
  const std::string html = report_html(none(), data);
  CHECK_FALSE(has(html, "nothing was fitted to these rows"));
  CHECK(has(html, "The model was fitted to rows of " + xml_text(rude)));
  MeasuredData measured;
  measured.model.outputs = {"z_um"};
  measured.model.made_from = MadeFrom{};
  measured.model.made_from->runs = {"days/friday.csv@0:3600"};
  for (const char* name : {"friday.csv", "monday.csv", "friday.csv@3600:", "friday.csv@3000:"}) {
    MeasuredRun run;
    run.name = name;
    run.time_s = Column::LinSpaced(rows_shown, 0.0, 60.0 * (rows_shown - 1));
    run.measured_um = {wave(20.0, 0.02)};
    measured.runs.push_back(run);
  }
  const std::vector<Residuals> left{
      {wave(1.0, 0.1), wave(1.0, 0.1), wave(1.0, 0.1), wave(1.0, 0.1)}};
  ReportData read;
  add_runs(read, none(), measured, left, left, true);
  CHECK(read.runs[0].of_the_model);
  CHECK_FALSE(read.runs[1].of_the_model);
  CHECK_FALSE(read.runs[2].of_the_model);  // other rows of the same file
  CHECK(read.runs[3].of_the_model);
}

TEST_CASE("there is no advice for the verdict none", "[diagnosis][report]") {
  Diagnosis diagnosis = none();
  diagnosis.outputs["z_um"].headroom = Headroom{0.1, 0.0, 0.0, 0.9};
  CHECK_FALSE(has(report_html(diagnosis, one_run()), "What to do"));
  diagnosis.verdict = "unexplained";
  const std::string html = report_html(diagnosis, one_run());
  CHECK(has(html, "What to do"));
  CHECK_FALSE(has(html, "Nothing worth saying"));
}

TEST_CASE("unlikely candidates are not listed", "[diagnosis][report]") {
  Diagnosis diagnosis = none();
  diagnosis.weighed = {{"speed_growth", "spindle_rpm", {}, 0.3, 0.1},
                       {"thermal_lag", "t1_degC", {}, 0.04, 0.1}};
  const std::string html = report_html(diagnosis, one_run());
  CHECK(has(html, "Growth with speed"));
  CHECK_FALSE(has(html, "t1_degC"));
  diagnosis.weighed.erase(diagnosis.weighed.begin());
  CHECK_FALSE(has(report_html(diagnosis, one_run()), "What it may be"));
}

TEST_CASE("the experiment for two places names both and warms no room", "[diagnosis][report]") {
  const auto between = [](const char* one, const char* other) {
    return experiment_between({"missing_temperature", one, 1.0},
                              {"missing_temperature", other, 0.5});
  };
  CHECK(between("bed_degC", "ram_degC").starts_with("Warm the place of bed_degC alone"));
  CHECK(has(between("bed_degC", "ram_degC"), "while ram_degC stays"));
  CHECK(between("room_degC", "bed_degC").starts_with("Warm the place of bed_degC alone"));
  CHECK_FALSE(has(between("spindle_rpm", "x_mm_per_min"), "heating pad"));
}

TEST_CASE("a constant is drawn flat, whatever its rounding", "[diagnosis][report]") {
  const std::vector<double> time_s{0.0, 3600.0, 7200.0};
  const std::vector<double> constant{-150.0, -150.00000000000003, -150.0};
  const std::string svg = panels_plot(time_s, {{"z", "mm", {{"", "red", constant}}}});
  const std::size_t at = svg.find(" d=\"M", svg.find("stroke=\"red"));
  std::vector<std::string> heights;
  std::istringstream path(svg.substr(at + 5, svg.find('"', at + 5) - at - 5));
  for (std::string x, y; std::getline(path, x, ' ') && std::getline(path, y, 'L');)
    heights.push_back(y);
  REQUIRE(heights.size() == 3);
  CHECK(heights[0] == heights[1]);
  CHECK(heights[1] == heights[2]);
}

TEST_CASE("each of many curves has its name and a stroke of its own", "[diagnosis][report]") {
  const std::vector<double> values{0.0, 1.0, 3.0};
  std::vector<PlotLine> lines;
  for (std::size_t i = 0; i < 30; ++i)
    lines.push_back(numbered_line("sensor" + std::to_string(i), i, values));
  const std::string svg = panels_plot(values, {{"temperatures", "K", lines}});
  for (const PlotLine& line : lines) {
    CHECK(count(svg, ">" + line.label + "</text>") == 1);
    CHECK(std::count_if(lines.begin(), lines.end(), [&](const PlotLine& other) {
            return other.colour == line.colour && other.dashes == line.dashes;
          }) == 1);
  }
}

TEST_CASE("only signals in units of speed are called speed", "[diagnosis][report]") {
  NamedFinding finding;
  finding.cause = "speed_growth";
  for (const char* speed : {"spindle_rpm", "x_mm_per_min"}) {
    finding.subject = speed;
    CHECK(title_of(finding.cause, finding.subject) ==
          std::string("Growth with speed, not with heat: ") + speed);
  }
  finding.subject = "cos_elevation";
  CHECK(title_of(finding.cause, finding.subject) ==
        "Growth with the square of a signal, not with heat: cos_elevation");
  CHECK(sentence_of(finding) ==
        "cos_elevation: the displacement jumps with the square of this signal.");
  CHECK_FALSE(what_to_do(finding).empty());
}

TEST_CASE("every cause has its own texts", "[diagnosis][report]") {
  for (const Cause& each : all_causes()) {
    const std::string& cause = each.name;
    const NamedFinding finding{cause, "spindle_rpm", {}, {}, {}, {}, {}, {}};
    CAPTURE(cause);
    CHECK_FALSE(what_to_do(finding).empty());
    CHECK_FALSE(has(sentence_of(finding), cause));
  }
}
