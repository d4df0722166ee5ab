#include "modelling/identification/measured_tests.hpp"

#include <algorithm>
#include <cmath>

#include "config/number_text.hpp"
#include "config/units.hpp"

namespace thermocomp::identification {
namespace {

constexpr std::size_t rows_min = 3;  // of a test; fewer say nothing of a course
/// A place that has fewer of its values than this would take the other places' rows with it.
constexpr double share_present_min = 0.5;

[[noreturn]] void refuse(const std::string& file, const std::string& key, const std::string& rule) {
  throw ConfigurationError({Problem{file, 0, key, "", rule}});
}

double share_present(const RunFile& run, const std::vector<double>& column) {
  const auto present = std::count_if(column.begin(), column.end(),
                                     [](double value) { return std::isfinite(value); });
  return static_cast<double>(present) / static_cast<double>(run.rows());
}

bool in_all(const std::vector<RunFile>& runs, const std::string& column) {
  return std::all_of(runs.begin(), runs.end(),
                     [&](const RunFile& run) { return run.find(column).has_value(); });
}

/// Temperatures that all runs have, apart from those that hold too little.
std::vector<std::string> usable_places(const std::vector<RunFile>& runs,
                                       std::vector<std::string>& notes) {
  std::vector<std::string> places;
  for (const std::string& column : runs.front().columns) {
    if (!is_temperature(column)) continue;
    if (!in_all(runs, column)) {
      notes.push_back(std::string(column).append(" is left out: not every run has it"));
      continue;
    }
    const bool sparse = std::any_of(runs.begin(), runs.end(), [&](const RunFile& run) {
      return share_present(run, run.column(column)) < share_present_min;
    });
    if (sparse) {
      notes.push_back(std::string(column).append(" is left out: most of its values are missing"));
      continue;
    }
    places.push_back(column);
  }
  return places;
}

TestRun make_run(const RunFile& run, const std::vector<std::string>& places,
                 const std::vector<std::string>& outputs) {
  std::vector<const std::vector<double>*> columns;
  columns.reserve(places.size() + outputs.size());
  for (const auto& name : places) columns.push_back(&run.column(name));
  for (const auto& name : outputs) columns.push_back(&run.column(name));
  std::vector<std::size_t> rows;
  std::size_t begin = 0;
  for (std::size_t row = 0; row < run.selected_end; ++row) {
    if (!std::all_of(columns.begin(), columns.end(),
                     [&](const auto* column) { return std::isfinite((*column)[row]); }))
      continue;
    if (row < run.selected_begin) ++begin;
    rows.push_back(row);
  }
  if (rows.size() < begin + rows_min)
    refuse(run.name, "", "has fewer than 3 selected rows in which no value is missing");
  TestRun test;
  test.name = run.name;
  test.begin = static_cast<Eigen::Index>(begin);
  const auto count = static_cast<Eigen::Index>(rows.size());
  test.time_s.resize(count);
  test.places_K.resize(count, static_cast<Eigen::Index>(places.size()));
  test.outputs_um.resize(count, static_cast<Eigen::Index>(outputs.size()));
  for (Eigen::Index i = 0; i < count; ++i) {
    const std::size_t row = rows[static_cast<std::size_t>(i)];
    test.time_s[i] = run.time_s()[row];
    for (std::size_t j = 0; j < columns.size(); ++j) {
      const double change = (*columns[j])[row] - (*columns[j])[rows.front()];
      const auto column = static_cast<Eigen::Index>(j);
      if (j < places.size())
        test.places_K(i, column) = change;
      else
        test.outputs_um(i, column - static_cast<Eigen::Index>(places.size())) = change;
    }
  }
  return test;
}

/// Takes out of `tests` what moves nowhere: it has no shape to be like another's.
void leave_out_still_places(MeasuredTests& tests) {
  std::vector<Eigen::Index> kept;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < tests.places.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const bool moves = std::any_of(tests.runs.begin(), tests.runs.end(), [&](const TestRun& run) {
      return run.places_K.col(column).tail(run.places_K.rows() - run.begin).cwiseAbs().maxCoeff() >
             0;
    });
    if (moves) {
      kept.push_back(column);
      names.push_back(tests.places[i]);
    } else {
      tests.notes.push_back(tests.places[i] + " is left out: it never moves");
    }
  }
  if (kept.size() == tests.places.size()) return;
  for (TestRun& run : tests.runs) run.places_K = run.places_K(Eigen::all, kept).eval();
  tests.places = names;
}

std::vector<Fold> make_folds(const std::vector<TestRun>& runs, std::size_t stretches) {
  std::vector<Fold> folds;
  if (runs.size() > 1) {
    for (std::size_t i = 0; i < runs.size(); ++i)
      folds.push_back({i, runs[i].begin, runs[i].time_s.size()});
    return folds;
  }
  const Eigen::Index rows = runs[0].time_s.size() - runs[0].begin;
  const auto count = std::min<Eigen::Index>(static_cast<Eigen::Index>(stretches), rows);
  for (Eigen::Index i = 0; i < count; ++i)
    folds.push_back({0, runs[0].begin + rows * i / count, runs[0].begin + rows * (i + 1) / count});
  return folds;
}

HotHalf hot_half(const std::vector<TestRun>& runs) {
  HotHalf hot;
  if (runs.size() > 1) return hot;
  const TestRun& run = runs[0];
  const Eigen::Index count = run.time_s.size() - run.begin;
  const Eigen::VectorXd heat = run.places_K.bottomRows(count).cwiseAbs().rowwise().sum();
  std::vector<double> sorted(heat.data(), heat.data() + count);
  std::nth_element(sorted.begin(), sorted.begin() + count / 2, sorted.end());
  const double median = sorted[static_cast<std::size_t>(count / 2)];
  for (Eigen::Index i = 0; i < count; ++i)
    if (heat[i] > median) hot.rows.push_back(run.begin + i);
  return hot;
}

}  // namespace

Eigen::Index MeasuredTests::rows() const {
  Eigen::Index count = 0;
  for (const TestRun& run : runs) count += run.time_s.size() - run.begin;
  return count;
}

std::string MeasuredTests::fold_name(std::size_t fold) const {
  const Fold& each = folds[fold];
  std::string text = runs[each.run].name;
  if (runs.size() > 1) return text;
  const Eigen::VectorXd& time_s = runs[each.run].time_s;
  text.append("@").append(number_text(time_s[each.begin])).append(":");
  if (each.end < time_s.size()) text.append(number_text(time_s[each.end]));
  return text;
}

MeasuredTests measured_tests(const std::vector<RunFile>& runs, const TestOptions& options) {
  MeasuredTests tests;
  for (const std::string& name : options.places)
    if (!is_temperature(name)) refuse("", name, "must be a temperature (*_degC, *_K)");
  for (const std::string& name : options.outputs)
    if (!is_output(name)) refuse("", name, "must be a displacement (*_um) or a tilt (*_urad)");
  tests.places = options.places.empty() ? usable_places(runs, tests.notes) : options.places;
  tests.outputs = options.outputs;
  for (const RunFile& run : runs) tests.runs.push_back(make_run(run, tests.places, tests.outputs));
  leave_out_still_places(tests);
  if (tests.places.empty()) refuse(runs.front().name, "", "has no temperature that can be used");
  tests.folds = make_folds(tests.runs, options.folds_of_one_run);
  tests.hot = hot_half(tests.runs);
  return tests;
}

}  // namespace thermocomp::identification
