#include "modelling/identification/measured_tests.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "config/runs/model_inputs.hpp"
#include "config/runs/robust.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "estimator/types.hpp"
#include "modelling/identification/printed.hpp"

namespace thermocomp::identification {
namespace {

constexpr std::size_t rows_min = 3;  // of a test
/// A place with a smaller share of values would remove the rows of the other places too.
constexpr double share_present_min = 0.5;
/// A signal has moved if its deviation within the runs exceeds this share of its RMS.
constexpr double still_share = 0.03;
/// Smaller movements of a temperature are rounding of its text.
constexpr double still_K = 1e-6;
/// Smaller variations, as a share of a signal's magnitude, are rounding of its text.
constexpr double rounding_share = 1e-9;
/// Smaller reversals, as a share of a signal's range, are ignored.
constexpr double reversal_share = 0.1;
/// A signal with a larger step between two rows, as a share of its range, is not gradual.
constexpr double gradual_share = 0.25;

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

constexpr double spike_K_min = 10.0;
constexpr double usual_steps = 30.0;
constexpr std::size_t near = 5;

/// True if the value differs from the median of itself and its four neighbours by more than the
/// limit.
bool is_spike(const std::vector<double>& values, std::size_t row, double limit_K) {
  std::array<double, near> five{};
  std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(row - 2), near, five.begin());
  if (std::any_of(five.begin(), five.end(), [](double each) { return std::isnan(each); }))
    return false;
  std::nth_element(five.begin(), five.begin() + 2, five.end());
  return std::abs(values[row] - five[2]) > limit_K;
}

/// 10 K, or 30 times the reading's median step if that is more; NaN without steps.
double spike_limit_K(const std::vector<double>& values) {
  std::vector<double> steps_K;
  for (std::size_t row = 1; row < values.size(); ++row)
    if (std::isfinite(values[row] - values[row - 1]))
      steps_K.push_back(std::abs(values[row] - values[row - 1]));
  if (steps_K.empty()) return not_a_number;
  const auto middle = steps_K.begin() + static_cast<std::ptrdiff_t>(steps_K.size() / 2);
  std::nth_element(steps_K.begin(), middle, steps_K.end());
  return std::max(spike_K_min, usual_steps * *middle);
}

/// Replaces by NaN spikes, which are faster than any structure, and values beyond the reading's
/// range: of an open sensor, and at an end of the run. The first row is the reference of all rises,
/// where a smaller spike looks like a heater that was just switched on.
void leave_out_spikes(RunFile& run, std::vector<std::string>& notes) {
  for (std::size_t i = 0; i < run.columns.size() && run.rows() >= near; ++i) {
    if (!is_temperature(run.columns[i])) continue;
    const std::vector<double> read = run.values[i];
    const double limit_K = spike_limit_K(read);
    const auto [least, most] = range_of_reading(read);
    std::size_t spikes = 0;
    for (std::size_t row = 0; row < read.size(); ++row) {
      const bool at_end = row < 2 || row + 2 >= read.size();
      if (!(read[row] < least || read[row] > most || (!at_end && is_spike(read, row, limit_K))))
        continue;
      run.values[i][row] = not_a_number;
      ++spikes;
    }
    if (spikes > 0)
      notes.push_back(run.name + ": " + run.columns[i] + ": " + std::to_string(spikes) +
                      (spikes == 1 ? " reading is" : " readings are") + " left out: more than " +
                      number_text(limit_K) +
                      " K from the neighbouring rows, or far from all others");
  }
}

/// Replaces stray values of signals, such as a controller's error codes, by NaN.
void leave_out_stray_values(RunFile& run, std::vector<std::string>& notes) {
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (!is_operating(run.columns[i]) || run.columns[i] == "time_s") continue;
    const std::vector<std::size_t> rows = stray_rows(run.values[i]);
    for (const std::size_t row : rows) run.values[i][row] = not_a_number;
    if (!rows.empty())
      notes.push_back(run.name + ": " + run.columns[i] + ": " + std::to_string(rows.size()) +
                      (rows.size() == 1 ? " row is" : " rows are") +
                      " left out: beyond five times all other values");
  }
}

/// Share of rows with a value in the run, or in all parts of its file.
double share_in_file(const std::vector<RunFile>& runs, const RunFile& run,
                     const std::string& column) {
  if (!run.is_part) return share_present(run, run.column(column));
  double present = 0.0;
  double rows = 0.0;
  for (const RunFile& each : runs) {
    if (!each.is_part || file_of(each) != file_of(run)) continue;
    const auto count = static_cast<double>(each.rows());
    present += count * share_present(each, each.column(column));
    rows += count;
  }
  return present / rows;
}

/// Columns that every run has with enough values. Rows in which one is missing are left out:
/// `predict` and the daemon have no value there.
template <class Wanted>
std::vector<std::string> usable(const std::vector<RunFile>& runs, Wanted wanted,
                                std::vector<std::string>& notes) {
  std::vector<std::string> names;
  for (const std::string& column : runs.front().columns) {
    if (!wanted(column)) continue;
    const auto sparse = [&](const RunFile& run) {
      return share_in_file(runs, run, column) < share_present_min;
    };
    if (!in_all(runs, column))
      notes.push_back(column + " is left out: not every run has it");
    else if (std::any_of(runs.begin(), runs.end(), sparse))
      notes.push_back(column + " is left out: most of its values are missing");
    else
      names.push_back(column);
  }
  return names;
}

/// The first notes as a clause.
std::string reasons(const std::vector<std::string>& notes) {
  constexpr std::size_t shown_max = 4;
  std::string text;
  for (std::size_t i = 0; i < std::min(notes.size(), shown_max); ++i)
    text += (i == 0 ? ": " : "; ") + notes[i];
  return text;
}

/// True if the column varies by more than the rounding of a converted or summed position.
bool varies(const std::vector<RunFile>& runs, const std::string& column) {
  double least = std::numeric_limits<double>::infinity();
  double most = -least;
  for (const RunFile& run : runs)
    for (const double each : run.column(column)) {
      least = std::fmin(least, each);
      most = std::fmax(most, each);
    }
  return most - least > rounding_share * std::max(std::abs(least), std::abs(most));
}

TestRun make_run(const RunFile& run, const std::vector<std::string>& places,
                 const std::vector<std::string>& outputs, const std::vector<std::string>& signals,
                 bool between_probings) {
  std::vector<const std::vector<double>*> columns;
  columns.reserve(places.size() + outputs.size());
  for (const auto& name : places) columns.push_back(&run.column(name));
  for (const auto& name : outputs) columns.push_back(&run.column(name));
  std::vector<const std::vector<double>*> seen(columns.begin(),
                                               columns.end() - std::ssize(outputs));
  for (const auto& name : signals) seen.push_back(&run.column(name));
  const std::vector<const std::vector<double>*> probed(columns.end() - std::ssize(outputs),
                                                       columns.end());
  std::vector<std::size_t> rows;
  std::optional<std::size_t> first_probed;
  std::size_t begin = 0;
  std::size_t complete = 0;
  for (std::size_t row = 0; row < run.selected_end; ++row) {
    const auto is_there = [row](const auto* column) { return std::isfinite((*column)[row]); };
    if (!std::all_of(seen.begin(), seen.end(), is_there)) continue;
    const bool is_complete = std::all_of(probed.begin(), probed.end(), is_there);
    if (!is_complete && !between_probings) continue;
    if (is_complete && !first_probed) first_probed = row;
    if (row < run.selected_begin)
      ++begin;
    else if (is_complete)
      ++complete;
    rows.push_back(row);
  }
  if (complete < rows_min)
    refuse(run.name, "", "has fewer than 3 selected rows in which no value is missing");
  TestRun test;
  test.name = selected_name(run);
  test.begin = static_cast<Eigen::Index>(begin);
  const auto count = static_cast<Eigen::Index>(rows.size());
  test.time_s.resize(count);
  test.places_K.resize(count, static_cast<Eigen::Index>(places.size()));
  test.outputs_um.resize(count, static_cast<Eigen::Index>(outputs.size()));
  test.signals.resize(count, static_cast<Eigen::Index>(signals.size()));
  test.reference_degC.resize(static_cast<Eigen::Index>(places.size()));
  for (std::size_t j = 0; j < places.size(); ++j)
    test.reference_degC[static_cast<Eigen::Index>(j)] = (*columns[j])[rows.front()];
  for (std::size_t j = 0; j < signals.size(); ++j) {
    const std::vector<double>& values = run.column(signals[j]);
    for (Eigen::Index i = 0; i < count; ++i)
      test.signals(i, static_cast<Eigen::Index>(j)) = values[rows[static_cast<std::size_t>(i)]];
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    const std::size_t row = rows[static_cast<std::size_t>(i)];
    test.time_s[i] = run.time_s()[row];
    for (std::size_t j = 0; j < columns.size(); ++j) {
      const auto column = static_cast<Eigen::Index>(j);
      const std::vector<double>& values = *columns[j];
      if (j < places.size())
        test.places_K(i, column) = values[row] - values[rows.front()];
      else
        test.outputs_um(i, column - static_cast<Eigen::Index>(places.size())) =
            values[row] - values[*first_probed];
    }
  }
  return test;
}

/// Moves displacements that were probed one after another, each axis separately, into the last row
/// of their set, since only rows with every output are fitted.
void gather_probings(RunFile& run, const std::vector<std::string>& outputs,
                     std::vector<std::string>& notes) {
  constexpr double set_s_max = 120.0;
  if (outputs.size() < 2) return;
  std::vector<std::vector<double>*> columns;
  for (const std::string& name : outputs) {
    const auto found = run.find(name);
    if (!found || share_present(run, run.values[*found]) >= share_present_min) return;
    columns.push_back(&run.values[*found]);
  }
  std::vector<std::optional<std::size_t>> set(columns.size());  // row of each value
  std::size_t moved = 0;
  std::size_t alone = 0;
  const auto leave_alone = [&alone](std::optional<std::size_t>& row) {
    if (row) ++alone;
    row.reset();
  };
  for (std::size_t row = 0; row < run.rows(); ++row) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (!std::isfinite((*columns[i])[row])) continue;
      leave_alone(set[i]);
      set[i] = row;
    }
    for (std::optional<std::size_t>& each : set)
      if (each && run.time_s()[row] - run.time_s()[*each] > set_s_max) leave_alone(each);
    if (!std::all_of(set.begin(), set.end(), [](const auto& each) { return each.has_value(); }))
      continue;
    bool is_moved = false;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const std::size_t from = *std::exchange(set[i], std::nullopt);
      if (from == row) continue;
      (*columns[i])[row] = std::exchange((*columns[i])[from], not_a_number);
      is_moved = true;
    }
    if (is_moved) ++moved;
  }
  for (std::optional<std::size_t>& each : set) leave_alone(each);
  if (moved > 0)
    notes.push_back(run.name + ": " + joined(outputs) + ": " + std::to_string(moved) +
                    " sets of probings within 2 min of each other count as one row each");
  if (alone > 0)
    notes.push_back(run.name + ": " + std::to_string(alone) +
                    " values without one of every other output within 2 min are left out; fitted "
                    "one output at a time, all count");
}

/// Selected rows with every place, output and signal.
std::size_t complete_rows(const RunFile& run, const MeasuredTests& tests) {
  std::vector<const std::vector<double>*> columns;
  for (const std::vector<std::string>* names : {&tests.places, &tests.outputs, &tests.signals})
    for (const std::string& name : *names) columns.push_back(&run.column(name));
  std::size_t complete = 0;
  for (std::size_t row = run.selected_begin; row < run.selected_end; ++row)
    if (std::all_of(columns.begin(), columns.end(),
                    [row](const auto* column) { return std::isfinite((*column)[row]); }))
      ++complete;
  return complete;
}

/// A note if the temperatures had moved before the first displacement, else empty.
std::string late_displacement(const RunFile& run, const std::vector<std::string>& places,
                              const std::vector<std::string>& outputs) {
  constexpr double moved_K_min = 1.0;
  const auto first_row = [&](const std::vector<std::vector<std::string>>& groups) {
    std::size_t row = 0;
    const auto is_there = [&](const std::string& name) {
      return std::isfinite(run.column(name)[row]);
    };
    for (; row < run.rows(); ++row)
      if (std::all_of(groups.begin(), groups.end(), [&](const std::vector<std::string>& names) {
            return std::all_of(names.begin(), names.end(), is_there);
          }))
        break;
    return row;
  };
  const std::size_t first = first_row({places});
  const std::size_t probed = first_row({places, outputs});
  if (outputs.empty() || probed >= run.rows() || probed == first) return {};
  double moved_K = 0.0;
  for (const std::string& name : places)
    moved_K = std::max(moved_K, std::abs(run.column(name)[probed] - run.column(name)[first]));
  if (moved_K < moved_K_min) return {};
  return run.name + ": the first displacement is " +
         printed("%.0f", (run.time_s()[probed] - run.time_s()[first]) / 60.0) +
         " min after the first temperatures, which moved by " + printed("%.1f", moved_K) +
         " K until then. The model is fitted to the changes since then, and what came before is "
         "not measured. Begin each run with a displacement in the reference state (thermocomp "
         "measured AXIS 0)";
}

/// Removes places that never move: they have no shape to compare.
void leave_out_still_places(MeasuredTests& tests) {
  std::vector<Eigen::Index> kept;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < tests.places.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const bool moves = std::any_of(tests.runs.begin(), tests.runs.end(), [&](const TestRun& run) {
      return run.places_K.col(column).tail(run.places_K.rows() - run.begin).cwiseAbs().maxCoeff() >
             still_K;
    });
    if (moves) {
      kept.push_back(column);
      names.push_back(tests.places[i]);
    } else {
      tests.notes.push_back(tests.places[i] + " is left out: it never moves");
    }
  }
  if (kept.size() == tests.places.size()) return;
  for (std::vector<TestRun>* runs : {&tests.runs, &tests.between})
    for (TestRun& run : *runs) {
      run.places_K = run.places_K(Eigen::all, kept).eval();
      run.reference_degC = run.reference_degC(kept).eval();
    }
  tests.places = names;
}

/// Selected values of a signal up to the last row with an output; all without outputs.
Eigen::VectorXd until_last_probing(const TestRun& run, Eigen::Index signal) {
  Eigen::Index end = run.time_s.size();
  while (end > run.begin + 1 && run.outputs_um.cols() > 0 &&
         !run.outputs_um.row(end - 1).allFinite())
    --end;
  return run.signals.col(signal).segment(run.begin, end - run.begin);
}

bool is_constant(const MeasuredTests& tests, std::size_t signal) {
  double within = 0.0;
  double size = 0.0;
  for (const TestRun& run : tests.between) {
    const Eigen::ArrayXd column =
        until_last_probing(run, static_cast<Eigen::Index>(signal)).array();
    within += (column - column.mean()).square().sum();
    size += column.square().sum();
  }
  return !(within > still_share * still_share * size);
}

/// Course of a signal over the selected rows of all runs.
struct Reversals {
  int count{0};              ///< number of rises and falls
  double largest_step{0.0};  ///< between two rows, as a share of its range
};

Reversals reversals_of(const MeasuredTests& tests, std::size_t signal) {
  const auto column = static_cast<Eigen::Index>(signal);
  const auto selected = [column](const TestRun& run) { return until_last_probing(run, column); };
  double least = std::numeric_limits<double>::infinity();
  double most = -least;
  for (const TestRun& run : tests.between) {
    least = std::min(least, selected(run).minCoeff());
    most = std::max(most, selected(run).maxCoeff());
  }
  const double turn = reversal_share * (most - least);
  Reversals reversals;
  for (const TestRun& run : tests.between) {
    int way = 0;  // up: 1, down: -1
    const Eigen::VectorXd values = selected(run);
    double last = values[0];
    double low = last;
    double high = last;
    for (const double value : values) {
      reversals.largest_step =
          std::max(reversals.largest_step, std::abs(value - last) / (most - least));
      last = value;
      low = std::min(low, value);
      high = std::max(high, value);
      if (way != 1 && value > low + turn) {
        way = 1;
        high = value;
        ++reversals.count;
      } else if (way != -1 && value < high - turn) {
        way = -1;
        low = value;
        ++reversals.count;
      }
    }
  }
  return reversals;
}

/// Fills `unmoved` and `gradual` from all rows of the courses, which the low passes see. The effect
/// of a signal that goes one way once cannot be separated from that of time.
void find_unmoved(MeasuredTests& tests) {
  for (std::size_t i = 0; i < tests.signals.size(); ++i) {
    if (is_constant(tests, i)) {
      tests.unmoved.push_back(tests.signals[i]);
      continue;
    }
    const Reversals reversals = reversals_of(tests, i);
    if (reversals.count > 1) continue;
    tests.unmoved.push_back(tests.signals[i]);
    if (reversals.largest_step < gradual_share) tests.gradual.push_back(tests.signals[i]);
  }
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
  const auto second = [](double value) { return printed("%.10g", value); };
  text.append("@").append(second(time_s[each.begin])).append(":");
  if (each.end < time_s.size()) text.append(second(time_s[each.end]));
  return text;
}

bool MeasuredTests::moved(const std::string& signal) const {
  return std::find(unmoved.begin(), unmoved.end(), signal) == unmoved.end();
}

const TestRun& MeasuredTests::course(std::size_t run) const {
  return between.empty() ? runs[run] : between[run];
}

std::vector<Eigen::Index> MeasuredTests::rows_in_course(std::size_t run) const {
  const Eigen::VectorXd& all_s = course(run).time_s;
  std::vector<Eigen::Index> rows;
  for (const double time_s : runs[run].time_s)
    rows.push_back(std::lower_bound(all_s.begin(), all_s.end(), time_s) - all_s.begin());
  return rows;
}

MeasuredTests measured_tests(const std::vector<RunFile>& given, const TestOptions& options) {
  MeasuredTests tests;
  refuse_overlap(given);
  std::vector<RunFile> runs = given;
  for (RunFile& run : runs) {
    leave_out_spikes(run, tests.notes);
    leave_out_stray_values(run, tests.notes);
    for (const Outliers& each : leave_out_outliers(run, options.outputs))
      tests.notes.push_back(run.name + ": " + each.text());
    gather_probings(run, options.outputs, tests.notes);
  }
  for (const std::string& name : options.places)
    if (!is_temperature(name)) refuse("", name, "must be a temperature (*_degC, *_K)");
  for (const std::string& name : options.outputs)
    if (!is_output(name)) refuse("", name, "must be a displacement (*_um) or a tilt (*_urad)");
  tests.places =
      options.places.empty() ? usable(runs, is_temperature, tests.notes) : options.places;
  tests.outputs = options.outputs;
  if (options.signals) {
    tests.signals = usable(
        runs, [](const auto& name) { return is_operating(name) && name != "time_s"; }, tests.notes);
    const auto constant =
        std::stable_partition(tests.signals.begin(), tests.signals.end(),
                              [&](const std::string& name) { return varies(runs, name); });
    tests.constant.assign(constant, tests.signals.end());
    tests.signals.erase(constant, tests.signals.end());
  }
  const auto is_short = [&tests](const RunFile& run) {
    return run.is_part && complete_rows(run, tests) < rows_min;
  };
  const bool all_short = std::all_of(runs.begin(), runs.end(), is_short);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const RunFile& run = runs[i];
    if (!all_short && is_short(run)) {
      tests.notes.push_back(run.name + " is left out: fewer than 3 of its rows are complete");
      continue;
    }
    if (const std::string late = late_displacement(run, tests.places, tests.outputs); !late.empty())
      tests.notes.push_back(late);
    const auto of_run = [&](bool between_probings) {
      return make_run(run, tests.places, tests.outputs, tests.signals, between_probings);
    };
    tests.runs.push_back(of_run(options.between_probings));
    tests.between.push_back(of_run(true));
    tests.given.push_back(i);
  }
  find_unmoved(tests);
  leave_out_still_places(tests);
  if (tests.places.empty())
    refuse(runs.front().name, "", "has no temperature that can be used" + reasons(tests.notes));
  tests.folds = make_folds(tests.runs, options.folds_of_one_run);
  tests.hot = hot_half(tests.runs);
  return tests;
}

}  // namespace thermocomp::identification
