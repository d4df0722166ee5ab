#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <catch2/catch.hpp>

#include "modelling/diagnosis/report_data.hpp"
#include "modelling/diagnosis/report_texts.hpp"
#include "modelling/markup/xml_text.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

constexpr Eigen::Index rows = 120;
const std::string rude = "run <b>&\"1\".csv";

Column wave(double size, double turn) {
  Column values(rows);
  for (Eigen::Index i = 0; i < rows; ++i)
    values[i] = size * std::sin(turn * static_cast<double>(i));
  return values;
}

ReportData one_run() {
  ReportData data{{"z_um"}, {"spindle_rpm"}, {"t1_degC"}, {}};
  ReportRun run{rude,
                true,
                Column::LinSpaced(rows, 0.0, 60.0 * (rows - 1)),
                std::vector<Phase>(rows, Phase::heating),
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

TEST_CASE("a finding that the test runs do not bear out is not recommended", "[diagnosis]") {
  Diagnosis diagnosis = with_findings();
  NamedFinding& finding = diagnosis.findings.front();
  const std::string usual = what_to_do(finding);
  REQUIRE_FALSE(fails_on_test_runs(finding));
  finding.test["z_um"] = {2.4, 3.0, -0.25, {-0.4, -0.1}};
  CHECK(fails_on_test_runs(finding));
  CHECK(sentence_of(finding).find("makes the error larger: that of z_um goes from 2.4 to 3") !=
        std::string::npos);
  CHECK(what_to_do(finding).starts_with("Do not use it yet"));
  CHECK(what_to_do(finding).ends_with(usual));
  finding.test["x_um"] = {2.0, 1.0, 0.5, {0.4, 0.6}};
  CHECK(what_to_do(finding) == usual);
}

TEST_CASE("the report needs nothing but itself", "[diagnosis][report]") {
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

TEST_CASE("each finding is a sentence with its figures, what to do and what would tell",
          "[diagnosis][report]") {
  const Diagnosis diagnosis = with_findings();
  const std::string html = report_html(diagnosis, one_run());
  for (const NamedFinding& finding : diagnosis.findings) {
    const std::string sentence = sentence_of(finding);
    CHECK(sentence.ends_with("."));
    CHECK(has(html, xml_text(sentence)));
    CHECK_FALSE(what_to_do(finding).empty());
    CHECK(has(html, xml_text(what_to_do(finding))));
  }
  CHECK(has(html, "1810 (1650 to 2000)"));
  CHECK(has(html, "from 6.7 to 2.4"));
  CHECK(has(html, xml_text(experiment_for(diagnosis.findings[0],
                                          diagnosis.findings[0].alternatives[0]))));
}

TEST_CASE("names are shown as they are, whatever is in them", "[diagnosis][report]") {
  const std::string html = report_html(with_findings(), one_run());
  CHECK_FALSE(has(html, "<b>&"));
  CHECK_FALSE(has(html, "a<b&c"));
  CHECK(has(html, xml_text(rude)));
  CHECK(has(html, xml_text("a<b&c_rpm")));
}

TEST_CASE("the plots are there with and without a finding", "[diagnosis][report]") {
  const std::string silent = report_html(none(), one_run());
  const std::string named = report_html(with_findings(), one_run());
  // The residual, what it goes with, the signal.
  CHECK(count(silent, "<svg") == 3);
  CHECK(count(named, "<svg") == 3);
  for (const std::string& html : {silent, named}) {
    CHECK(count(html, "d=\"M") >= 3);
    CHECK_FALSE(has(html, "nan"));
    CHECK(has(html, "heating"));
  }
  CHECK(count(silent, "<h3>") == 0);
  CHECK(has(silent, "Nothing worth saying"));
  CHECK(count(named, "<h3>") == 2);
}

TEST_CASE("every cause that can be named has words of its own", "[diagnosis][report]") {
  for (const char* cause : {"thermal_lag",
                            "slow_sensor",
                            "time_shift",
                            "missing_heat_source",
                            "speed_growth",
                            "missing_temperature",
                            "wrong_coefficient",
                            "nonlinear_expansion",
                            "position_dependence",
                            "hysteresis",
                            "periodic_disturbance",
                            "displacement_step",
                            "displacement_drift",
                            "sensor_drift",
                            "sensor_step",
                            "sensor_loose",
                            "sensor_swap",
                            "wrong_heat_source",
                            "wrong_film_coefficient",
                            "wrong_conductance",
                            "wrong_heat_capacity",
                            "wrong_ambient"}) {
    const NamedFinding finding{cause, "spindle_rpm", {}, {}, {}, {}, {}, {}};
    CAPTURE(cause);
    CHECK_FALSE(what_to_do(finding).empty());
    CHECK_FALSE(has(sentence_of(finding), cause));
  }
}
