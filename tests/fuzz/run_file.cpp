/// Run files: loaded ones are the same when written and read again; refusals name their cause.
#include "config/runs/run_file.hpp"

#include <bit>
#include <cmath>
#include <string>

#include "common/fuzz.hpp"

using namespace thermocomp;

namespace {

constexpr const char* run_name = "run.csv";

void check_loaded(const RunFile& run) {
  FUZZ_REQUIRE(run.rows() > 0);
  FUZZ_REQUIRE(run.values.size() == run.columns.size());
  for (const auto& column : run.values) {
    FUZZ_REQUIRE(column.size() == run.rows());
    for (const double value : column) FUZZ_REQUIRE(!std::isinf(value));
  }
  const auto& time_s = run.time_s();
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    FUZZ_REQUIRE(std::isfinite(time_s[i]) && (i == 0 || time_s[i] > time_s[i - 1]));
  }
  FUZZ_REQUIRE(run.selected_begin < run.selected_end && run.selected_end <= run.rows());
}

void check_written(const RunFile& run) {
  const RunFile again = parse_run(write_run(run), run_name);
  FUZZ_REQUIRE(again.columns == run.columns && again.rows() == run.rows());
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    for (std::size_t row = 0; row < run.rows(); ++row) {
      const double a = run.values[i][row];
      const double b = again.values[i][row];
      FUZZ_REQUIRE(std::isnan(a)
                       ? std::isnan(b)
                       : std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b));
    }
  }
}

/// The first line is also the argument of a command, `FILE@T0:T1`.
RunSelection selection_from(std::string_view text) {
  try {
    const RunSelection selection = parse_selection(text.substr(0, text.find('\n')));
    FUZZ_REQUIRE(selection.from_s < selection.to_s && !selection.file.empty());
    return selection;
  } catch (const ConfigurationError& error) {
    for (const Problem& problem : error.problems()) FUZZ_REQUIRE(!problem.rule.empty());
    return {};
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const fuzz::NamedText files[] = {{run_name, text}};
  bool loads = false;
  try {
    const RunFile run = parse_run(text, run_name);
    loads = true;
    check_loaded(run);
    check_written(run);
  } catch (const ConfigurationError& error) {
    FUZZ_REQUIRE(!loads);
    FUZZ_REQUIRE(error.problems().size() <= 100);
    fuzz::check_problems(error.problems(), files);
  }
  if (!loads) return 0;
  try {
    check_loaded(parse_run(text, run_name, selection_from(text)));
  } catch (const ConfigurationError& error) {
    fuzz::check_problems(error.problems(), files);
  }
  return 0;
}
