/// What a test of thermal behaviour showed: a page, and JSON for programs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "modelling/thermal_test/drift_figures.hpp"
#include "modelling/thermal_test/test_data.hpp"

namespace thermocomp::thermal_test {

/// An axis that both tests have. Where one ran shorter, both until then.
struct AxisRatio {
  std::string name;
  std::string unit;
  Figure before;  ///< range until then, or of the whole record of the surroundings
  Figure after;
  Figure first_hour;  ///< of here on: after by before
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
  std::vector<std::string> notes;  ///< what to bear in mind in a comparison
};

/// Figures and, of two tests, their ratios.
[[nodiscard]] TestAnswer answer_of(TestData before, std::optional<TestData> after);

[[nodiscard]] std::string report_html(const TestAnswer& answer);
[[nodiscard]] std::string report_json(const TestAnswer& answer);

/// "31.2 um (30.8 to 31.4)"
[[nodiscard]] std::string figure_words(const Figure& figure, const std::string& unit);
/// "15 % (11 to 19)"
[[nodiscard]] std::string percent_words(const Figure& ratio);
/// A sentence or two on an axis, for a person.
[[nodiscard]] std::string axis_sentence(const AxisFigures& axis, const TestPhases& phases);

}  // namespace thermocomp::thermal_test
