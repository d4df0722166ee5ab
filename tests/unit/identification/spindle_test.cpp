// Tests on measured spindle data outside the project, in the folder of THERMOCOMP_DATA.
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include <catch2/catch.hpp>

#include "modelling/identification/equation/fit.hpp"
#include "modelling/identification/families/families.hpp"

namespace thermocomp::identification {
namespace {

/// RMS remainder of the equation on the selected rows; reference: the file's first row.
double rms_on(const MeasuredTests& rows, const Fit& fit) {
  const TestRun& run = rows.runs[0];
  Eigen::VectorXd left = run.outputs_um.col(0);
  for (std::size_t i = 0; i < fit.columns.size(); ++i)
    left -=
        fit.outputs[0].coefficients[static_cast<Eigen::Index>(i)] * column_of(run, fit.columns[i]);
  const auto selected = left.tail(left.size() - run.begin);
  return std::sqrt(selected.squaredNorm() / static_cast<double>(selected.size()));
}

std::filesystem::path recording() {
  const char* named = std::getenv("THERMOCOMP_DATA");
  return std::filesystem::path(named != nullptr ? named : THERMOCOMP_DATA_DEFAULT) / "spindle_46h" /
         "hours_00_32.csv";
}

/// Rows of these hours as a file; one row per minute.
RunFile hours_of(const RunFile& run, double from_h, double to_h) {
  RunFile part = run;
  part.name = std::to_string(from_h);
  for (auto& column : part.values) column.clear();
  for (std::size_t row = 0; row < run.values[0].size(); row += 4)
    if (run.values[0][row] >= from_h * 3600.0 && run.values[0][row] < to_h * 3600.0)
      for (std::size_t i = 0; i < run.values.size(); ++i)
        part.values[i].push_back(run.values[i][row]);
  part.selected_begin = 0;
  part.selected_end = part.values[0].size();
  return part;
}

TEST_CASE("four sensors with lags predict hours not fitted better than sixteen without",
          "[fit][data]") {
  const std::filesystem::path run = recording();
  if (!std::filesystem::exists(run)) {
    WARN("skipped: " << run << " is not here");
    return;
  }
  // Static model of all sixteen, as stated by its makers.
  const std::vector<std::pair<std::string, double>> sixteen{{"ch1_um", 5.653},
                                                            {"ch2_um", 5.087},
                                                            {"ch3_um", 9.193},
                                                            {"ch4_um", 9.005},
                                                            {"ch5_um", 5.002}};
  const RunFile train = load_run(parse_selection(run.string().append("@:86760")));
  const RunFile later = load_run(parse_selection(run.string().append("@86760:")));
  FitOptions options;
  options.terms_min = options.terms_max = 4;
  options.lags = true;
  for (const auto& [channel, static_rms_um] : sixteen) {
    const MeasuredTests tests = measured_tests({train}, {{}, {channel}, 6});
    const Fit fit = fit_equation(tests, options);
    CAPTURE(channel);
    CHECK(fit.places.size() == 4);
    CHECK(rms_on(measured_tests({later}, {{}, {channel}, 6}), fit) < static_rms_um);
  }
}

TEST_CASE("five runs of different size get the model that predicts them best", "[families][data]") {
  const std::filesystem::path file = recording();
  if (!std::filesystem::exists(file)) {
    WARN("skipped: " << file << " is not here");
    return;
  }
  const RunFile whole = load_run(parse_selection(file.string()));
  std::vector<RunFile> runs;
  for (double from_h = 0.0; from_h < 15.0; from_h += 3.0)
    runs.push_back(hours_of(whole, from_h, from_h + 3.0));
  TestOptions options;
  options.outputs = {"ch1_um", "ch2_um", "ch3_um", "ch4_um", "ch5_um"};
  options.signals = true;
  const MeasuredTests tests = measured_tests(runs, options);
  CHECK(fit_families(tests, {}, std::nullopt, [](double) {}).chosen == Family::lag_bank);
}

}  // namespace
}  // namespace thermocomp::identification
