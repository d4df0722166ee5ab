#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <span>

#include "config/runs/robust.hpp"
#include "config/text/units.hpp"
#include "estimator/types.hpp"
#include "modelling/inspection/checks.hpp"

namespace thermocomp::inspection {
namespace {

constexpr std::size_t half_window = 3;
constexpr std::size_t bends_min = 9;
// Jumps of a row that have other causes: tolerance of a thermocouple or a probing.
constexpr double leap_K_min = 0.5;
constexpr double leap_um_min = 1.0;
constexpr double leap_deviations_min = 8.0;
constexpr double leap_steps_min = 1.5;  ///< least steps of the column, if it changes thrice
constexpr std::size_t nearby = 15;      // rows on each side that give the local deviation
constexpr double coarse_K_min = 0.2;    // half of it is 0.1 K, about 1 um on a machine
constexpr double coarse_um_min = 1.0;
constexpr std::size_t stuck_rows_min = 10;
constexpr double others_moved_K_min = 1.0;
constexpr double stuck_steps_min = 3.0;  ///< least expected motion, in least steps of the reading
constexpr std::size_t copy_values_min = 20;  // distinct values; fewer agree by chance

Suspicion suspicion(const std::string& kind, const std::string& column, std::size_t run,
                    double at_s, double until_s, double size, double score) {
  Suspicion made;
  made.finding.kind = kind;
  made.finding.column = column;
  made.finding.run = run;
  made.finding.at_s = at_s;
  made.finding.until_s = until_s;
  made.finding.size = size;
  made.finding.unit = unit_of(column).symbol == "degC" ? "K" : std::string(unit_of(column).symbol);
  made.score = score;
  return made;
}

/// True if another temperature jumps likewise in that row, so that the place changed, not the
/// sensor.
bool others_leap(const RunFile& run, std::size_t column, std::size_t row, double leap) {
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (i == column || !is_temperature(run.columns[i])) continue;
    const double other = run.values[i][row] - median_around(run.values[i], row, half_window);
    if (other / leap > 0.3) return true;
  }
  return false;
}

/// True if the column returns: it changes by less than the jump.
bool returns(const std::vector<double>& values, std::size_t row, double leap) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(row);
  const auto before = static_cast<std::ptrdiff_t>(std::min(half_window, row));
  const auto after = static_cast<std::ptrdiff_t>(std::min(half_window, values.size() - 1 - row));
  return std::abs(median({at + 1, at + 1 + after}) - median({at - before, at})) < std::abs(leap);
}

/// True if the value is on a line through those before or after it: a corner of the course.
bool continues(const std::vector<double>& values, std::size_t row, double leap) {
  for (const bool after : {false, true}) {
    const double off = values[row] - line_beside(values, row, half_window, after);
    if (off / leap < 0.5) return true;
  }
  return false;
}

/// Standard deviation of the noise in the `reach` rows on each side: the larger of the estimates
/// from the distances to the neighbours' median, which is 0 on a slope, and from second
/// differences. One outlier affects three of the latter, which therefore need more rows.
double noise(const std::vector<double>& leaps, const std::vector<double>& bends, std::size_t row,
             std::size_t reach) {
  const std::size_t begin = row - std::min(reach, row);
  const std::size_t count = std::min(leaps.size(), row + reach + 1) - begin;
  const double of_leaps = robust_deviation(std::span(leaps).subspan(begin, count));
  if (count < bends_min) return of_leaps;
  return std::max(of_leaps,
                  robust_deviation(std::span(bends).subspan(begin, count)) / std::sqrt(6.0));
}

/// Changes between neighbouring rows, without 0.
std::vector<double> moves_of(const std::vector<double>& values) {
  std::vector<double> steps;
  for (std::size_t row = 1; row < values.size(); ++row) {
    const double step = std::abs(values[row] - values[row - 1]);
    if (std::isfinite(step) && step > 0) steps.push_back(step);
  }
  return steps;
}

/// The smallest change of a column; 0 with fewer changes than needed to show it.
double least_step(const std::vector<double>& values, std::size_t steps_min) {
  const std::vector<double> steps = moves_of(values);
  return steps.size() < steps_min ? 0.0 : *std::min_element(steps.begin(), steps.end());
}

/// Sets values beyond the reading's range, as of an open sensor, to missing.
void leave_out_impossible(std::vector<double>& values,
                          const std::function<void(std::size_t, double)>& note) {
  const auto [least, most] = range_of_reading(values);
  const auto is_impossible = [least = least, most = most](double value) {
    return value < least || value > most;
  };
  std::vector<double> possible = values;
  std::erase_if(possible, is_impossible);
  const double usual = median(std::move(possible));
  for (std::size_t row = 0; row < values.size(); ++row) {
    if (!is_impossible(values[row])) continue;
    note(row, values[row] - usual);
    values[row] = not_a_number;
  }
}

/// Sets stretches of one value that the reading jumps to and back from to missing: a code, such as
/// 85.0 of a sensor that was reset.
void leave_out_codes(std::vector<double>& values,
                     const std::function<void(std::size_t, double)>& note) {
  constexpr double leap_K = 5.0;
  constexpr double leap_moves = 20.0;  // usual changes from row to row
  constexpr std::size_t rows_max_share = 4;
  std::vector<double> moves;
  for (std::size_t row = 1; row < values.size(); ++row)
    moves.push_back(std::abs(values[row] - values[row - 1]));
  const double usual = median(std::move(moves));
  if (!(usual > 0)) return;  // a setpoint
  const double least = std::max(leap_K, leap_moves * usual);
  for (std::size_t begin = 1; begin + 1 < values.size(); ++begin) {
    std::size_t end = begin + 1;
    while (end < values.size() && values[end] == values[begin]) ++end;
    const double in = values[begin] - values[begin - 1];
    const double out = end < values.size() ? values[begin] - values[end] : 0.0;
    const bool is_code = end - begin > 1 && rows_max_share * (end - begin) < values.size() &&
                         std::min(std::abs(in), std::abs(out)) > least && out / in > 0.5 &&
                         out / in < 2.0;
    for (std::size_t row = begin; is_code && row < end; ++row) {
      note(row, in);
      values[row] = not_a_number;
    }
    begin = end - 1;
  }
}

void check_leaps(RunFile& run, std::size_t index, std::size_t column, Suspicions& found) {
  std::vector<double>& values = run.values[column];
  const bool output = is_output(run.columns[column]);
  Suspicion made =
      suspicion(output ? "outliers" : "spikes", run.columns[column], index, 0, 0, 0, 0);
  const auto note = [&](std::size_t row, double leap) {
    made.finding.times_s.push_back(run.time_s()[row]);
    if (std::abs(leap) > std::abs(made.finding.size)) made.finding.size = leap;
  };
  if (!output) leave_out_impossible(values, note);
  if (!output) leave_out_codes(values, note);
  std::vector<double> around(values.size());
  std::vector<double> leaps(values.size());
  std::vector<double> bends(values.size());
  for (std::size_t row = 0; row < values.size(); ++row) {
    around[row] = median_around(values, row, half_window);
    leaps[row] = values[row] - around[row];
    if (row > 0 && row + 1 < values.size())
      bends[row] = values[row - 1] - 2.0 * values[row] + values[row + 1];
  }
  double deviation = noise(leaps, bends, 0, values.size());
  // If most rows are constant or on slopes, the others give the deviation.
  if (!(robust_deviation(leaps) > 0)) {
    std::vector<double> moving;
    for (const double leap : leaps)
      if (std::isfinite(leap) && leap != 0) moving.push_back(std::abs(leap));
    if (moving.size() > values.size() / 50)
      deviation = std::max(deviation, median(std::move(moving)));
  }
  const double least =
      std::max({leap_deviations_min * deviation, leap_steps_min * least_step(values, 3),
                output ? leap_um_min : leap_K_min});
  std::vector<std::size_t> leapt;
  for (std::size_t row = 1; row + 1 < values.size(); ++row) {
    const double leap = leaps[row];
    if (!(std::abs(leap) > least) || !returns(values, row, leap) || continues(values, row, leap) ||
        !(std::abs(leap) > leap_deviations_min * noise(leaps, bends, row, nearby)) ||
        others_leap(run, column, row, leap))
      continue;
    note(row, leap);
    leapt.push_back(row);
  }
  if (made.finding.times_s.empty()) return;
  for (const std::size_t row : leapt) values[row] = around[row];
  std::sort(made.finding.times_s.begin(), made.finding.times_s.end());
  made.finding.at_s = made.finding.times_s.front();
  made.finding.until_s = made.finding.times_s.back();
  made.score = std::abs(made.finding.size) / std::max(least, 1e-12);
  found.push_back(made);
}

/// Stray values of a signal are taken out.
void check_stray(RunFile& run, std::size_t index, std::size_t column, Suspicions& found) {
  constexpr double score = 100.0;
  std::vector<double>& values = run.values[column];
  const std::vector<std::size_t> rows = stray_rows(values);
  if (rows.empty()) return;
  Suspicion made = suspicion("spikes", run.columns[column], index, run.time_s()[rows.front()],
                             run.time_s()[rows.back()], 0, score);
  for (const std::size_t row : rows) {
    made.finding.times_s.push_back(run.time_s()[row]);
    if (std::abs(values[row]) > std::abs(made.finding.size)) made.finding.size = values[row];
    values[row] = not_a_number;
  }
  found.push_back(made);
}

double range_of(const std::vector<double>& values, StillRows rows) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (std::size_t row = rows.begin; row < rows.end; ++row) {
    if (!std::isfinite(values[row])) continue;
    low = std::min(low, values[row]);
    high = std::max(high, values[row]);
  }
  return high > low ? high - low : 0.0;
}

/// True if a signal has the same value throughout: the reading is at a setpoint. 0 is too common to
/// count.
bool is_held(const RunFile& run, std::size_t column, StillRows rows) {
  const double value = run.values[column][rows.begin];
  return value != 0 && std::any_of(run.columns.begin(), run.columns.end(), [&](const auto& name) {
           const std::vector<double>& other = run.column(name);
           return is_operating(name) && other[rows.begin] == value && other[rows.end - 1] == value;
         });
}

/// True if nearly every row outside of the stretch differs from the one before: noise that ends.
bool is_lively(const std::vector<double>& values, StillRows still) {
  const auto finite = std::count_if(values.begin(), values.end(),
                                    [](double value) { return std::isfinite(value); });
  const auto others = static_cast<std::size_t>(finite) - still.rows();
  return others > still.rows() && 10 * moves_of(values).size() >= 9 * others;
}

void check_stuck(const RunFile& run, std::size_t index, std::size_t column, Suspicions& found) {
  const auto [longest, second] = longest_still(run.values[column]);
  if (longest.rows() < stuck_rows_min || is_held(run, column, longest)) return;
  const StillRows all{0, run.rows()};
  const bool throughout = longest.rows() == run.rows();
  double step_K = least_step(run.values[column], 1);
  std::vector<double> others;
  std::vector<double> shares;
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    const double range_K = range_of(run.values[i], all);
    if (i == column || !is_temperature(run.columns[i]) || !(range_K > 0)) continue;
    others.push_back(range_of(run.values[i], longest));
    shares.push_back(others.back() / range_K);
    // A column without any change has the step of the coarsest neighbour.
    if (throughout) step_K = std::max(step_K, least_step(run.values[i], 1));
  }
  if (others.empty()) return;
  const double moved = median(others);
  const double longer = static_cast<double>(longest.rows()) / static_cast<double>(second);
  const auto offer = [&](double score) {
    found.push_back(suspicion("stuck", run.columns[column], index, run.time_s()[longest.begin],
                              run.time_s()[longest.end - 1], moved, score));
    found.back().finding.unit = "K";
  };
  if (is_output(run.columns[column]) && is_lively(run.values[column], longest)) {
    offer(longer / 3.0);
    return;
  }
  // A working reading moves by the same share of its range as the others do of theirs.
  const double expected = throughout ? *std::min_element(others.begin(), others.end())
                                     : median(shares) * range_of(run.values[column], all);
  if (!(moved > others_moved_K_min) || !(expected > stuck_steps_min * step_K)) return;
  const double score = throughout ? moved : std::min(longer, 5.0 * moved);
  if (!throughout && longer < 3.0) return;
  offer(score);
}

void check_coarse(const RunFile& run, std::size_t index, std::size_t column, Suspicions& found) {
  const std::vector<double> steps = moves_of(run.values[column]);
  if (steps.size() < 5) return;
  const double least = *std::min_element(steps.begin(), steps.end());
  const bool output = is_output(run.columns[column]);
  if (least < (output ? coarse_um_min : coarse_K_min)) return;
  const auto on_grid = std::count_if(steps.begin(), steps.end(), [&](double step) {
    return std::abs(step / least - std::round(step / least)) < 0.05;
  });
  const double range = range_of(run.values[column], {0, run.rows()});
  if (on_grid < static_cast<std::ptrdiff_t>(steps.size()) || least < 0.02 * range) return;
  found.push_back(suspicion("coarse", run.columns[column], index, run.time_s().front(),
                            run.time_s().back(), least, 10.0));
}

void check_copies(const RunFile& run, std::size_t index, Suspicions& found) {
  for (std::size_t a = 0; a < run.columns.size(); ++a) {
    if (!is_temperature(run.columns[a])) continue;
    std::vector<double> different = run.values[a];
    std::erase_if(different, [](double value) { return !std::isfinite(value); });
    std::sort(different.begin(), different.end());
    const auto count = std::unique(different.begin(), different.end()) - different.begin();
    if (count < static_cast<std::ptrdiff_t>(copy_values_min)) continue;
    const double range = different.empty() ? 0.0 : range_of(run.values[a], {0, run.rows()});
    for (std::size_t b = a + 1; b < run.columns.size(); ++b) {
      if (!is_temperature(run.columns[b])) continue;
      std::size_t same = 0;
      std::size_t both = 0;
      for (std::size_t row = 0; row < run.rows(); ++row) {
        const double apart = run.values[a][row] - run.values[b][row];
        if (!std::isfinite(apart)) continue;
        ++both;
        if (std::abs(apart) <= 1e-6 * range) ++same;
      }
      if (both < copy_values_min || 20 * same < 19 * both) continue;
      Suspicion made = suspicion("copy", run.columns[b], index, run.time_s().front(),
                                 run.time_s().back(), 0.0, 10.0);
      made.finding.other = run.columns[a];
      made.finding.unit = std::string("K");
      found.push_back(made);
    }
  }
}

}  // namespace

void check_spikes(RunFile& run, std::size_t index, Suspicions& found) {
  for (std::size_t column = 0; column < run.columns.size(); ++column)
    if (is_temperature(run.columns[column]) || is_output(run.columns[column]))
      check_leaps(run, index, column, found);
    else if (is_operating(run.columns[column]) && run.columns[column] != "time_s")
      check_stray(run, index, column, found);
}

void check_values(const std::vector<RunFile>& runs, Suspicions& found) {
  for (std::size_t index = 0; index < runs.size(); ++index) {
    const RunFile& run = runs[index];
    for (std::size_t column = 0; column < run.columns.size(); ++column) {
      const bool reading = is_temperature(run.columns[column]);
      if (reading || is_output(run.columns[column])) check_stuck(run, index, column, found);
      if (reading || is_output(run.columns[column])) check_coarse(run, index, column, found);
    }
    check_copies(run, index, found);
  }
}

}  // namespace thermocomp::inspection
