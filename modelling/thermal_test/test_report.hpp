/// Report of a thermal test: HTML page, and JSON.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "modelling/thermal_test/drift_figures.hpp"
#include "modelling/thermal_test/test_data.hpp"

namespace thermocomp::thermal_test {

/// An axis of both tests, compared up to the end of the shorter one.
struct AxisRatio {
  std::string name;
  std::string unit;
  Figure before;  ///< range until then; in a test of the environment, of the whole record
  Figure after;
  Figure first_hour;  ///< this and the following: after / before
  Figure until_end;
  Figure whole;
};

struct TestAnswer {
  TestKind kind{TestKind::spindle};
  TestData before;
  TestFigures before_figures;
  std::optional<TestData> after;
  std::optional<TestFigures> after_figures;
  std::vector<AxisRatio> ratios;
  std::vector<std::string> notes;  ///< caveats of the comparison
};

/// Figures and, for two tests, their ratios.
[[nodiscard]] TestAnswer answer_of(TestData before, std::optional<TestData> after);

[[nodiscard]] std::string report_html(const TestAnswer& answer);
[[nodiscard]] std::string report_json(const TestAnswer& answer);

/// "31.2 um (30.8 to 31.4)"
[[nodiscard]] std::string figure_words(const Figure& figure, const std::string& unit);
/// "15 % (11 to 19)"
[[nodiscard]] std::string percent_words(const Figure& ratio);
[[nodiscard]] std::string axis_sentence(const AxisFigures& axis, const TestPhases& phases);

}  // namespace thermocomp::thermal_test
