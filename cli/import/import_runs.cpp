#include "cli/import/import_runs.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "config/run_forms/row_order.hpp"
#include "config/runs/robust.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"
#include "config/text/units.hpp"

namespace thermocomp::cli {
namespace {

constexpr std::size_t points_max = 2000;
constexpr std::ptrdiff_t points_min = 20;
constexpr std::size_t columns_max = 16;
constexpr double correlation_min = 0.8;
constexpr double lead_min = 0.15;

/// Changes of a column over `lag` steps of a grid that begins with the run's first row; a longer
/// lag reduces the noise's share.
std::vector<double> changes(const RunFile& run, std::size_t column, double step_s,
                            std::size_t lag) {
  std::vector<double> time_s;
  std::vector<double> values;
  for (std::size_t row = 0; row < run.rows(); ++row) {
    if (!std::isfinite(run.values[column][row])) continue;
    time_s.push_back(run.time_s()[row] - run.time_s().front());
    values.push_back(run.values[column][row]);
  }
  std::vector<double> changes;
  if (values.size() < 3) return changes;
  const double end_s = run.time_s().back() - run.time_s().front();
  std::vector<double> on_grid;
  std::size_t i = 0;
  for (double at_s = 0.0; at_s <= end_s; at_s += step_s) {
    while (i + 1 < time_s.size() && time_s[i + 1] <= at_s) ++i;
    double value = values[i];
    if (i + 1 < time_s.size() && at_s > time_s[i])
      value += (values[i + 1] - values[i]) * (at_s - time_s[i]) / (time_s[i + 1] - time_s[i]);
    on_grid.push_back(value);
  }
  for (std::size_t k = lag; k < on_grid.size(); ++k)
    changes.push_back(on_grid[k] - on_grid[k - lag]);
  return changes;
}

/// Correlation coefficient of a_i and b_(i - shift), without removing means.
double correlation(const std::vector<double>& a, const std::vector<double>& b,
                   std::ptrdiff_t shift) {
  const auto size_a = static_cast<std::ptrdiff_t>(a.size());
  const auto size_b = static_cast<std::ptrdiff_t>(b.size());
  double both = 0.0;
  double of_a = 0.0;
  double of_b = 0.0;
  for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, shift); i < std::min(size_a, size_b + shift);
       ++i) {
    const double x = a[static_cast<std::size_t>(i)];
    const double y = b[static_cast<std::size_t>(i - shift)];
    both += x * y;
    of_a += x * x;
    of_b += y * y;
  }
  // Parts covered by only one recording are weighted by half.
  double all_a = 0.0;
  double all_b = 0.0;
  for (const double x : a) all_a += x * x;
  for (const double y : b) all_b += y * y;
  const double weight_a = 0.5 * (of_a + all_a);
  const double weight_b = 0.5 * (of_b + all_b);
  return weight_a > 0 && weight_b > 0 ? both / std::sqrt(weight_a * weight_b) : 0.0;
}

void try_pair(const std::vector<double>& a, const std::vector<double>& b, double offset_s,
              double expected_s, const std::string& columns, ClockShift& best) {
  const auto size_a = static_cast<std::ptrdiff_t>(a.size());
  const auto size_b = static_cast<std::ptrdiff_t>(b.size());
  const std::ptrdiff_t common = std::max(points_min, std::min(size_a, size_b) / 3);
  std::vector<double> by_shift;
  std::ptrdiff_t strongest = 0;
  for (std::ptrdiff_t shift = common - size_b; shift <= size_a - common; ++shift) {
    by_shift.push_back(std::abs(correlation(a, b, shift)));
    const auto here = static_cast<std::ptrdiff_t>(by_shift.size()) - 1;
    if (by_shift.back() > by_shift[static_cast<std::size_t>(strongest)]) strongest = here;
  }
  if (by_shift.empty() || !(by_shift[static_cast<std::size_t>(strongest)] > best.correlation))
    return;
  best.correlation = by_shift[static_cast<std::size_t>(strongest)];
  const auto expected = std::lround((expected_s - offset_s) / best.step_s) - common + size_b;
  best.at_expected = expected >= 0 && expected < std::ssize(by_shift)
                         ? by_shift[static_cast<std::size_t>(expected)]
                         : 0.0;
  best.shift_s = offset_s + best.step_s * static_cast<double>(strongest + common - size_b);
  best.columns = columns;
  // r falls on both sides of its peak; where it rises by more than 0.05, another peak follows.
  best.next = 0.0;
  for (const std::ptrdiff_t way : {-1, 1}) {
    double lowest = best.correlation;
    const auto end = static_cast<std::ptrdiff_t>(by_shift.size());
    for (std::ptrdiff_t i = strongest + way; i >= 0 && i < end; i += way) {
      const double r = by_shift[static_cast<std::size_t>(i)];
      lowest = std::min(lowest, r);
      if (r > lowest + 0.05) best.next = std::max(best.next, r);
    }
  }
}

}  // namespace

bool ClockShift::is_sure() const noexcept {
  return correlation >= correlation_min && correlation - next >= lead_min;
}

std::optional<ClockShift> clock_shift(const RunFile& first, const RunFile& second,
                                      double expected_s) {
  const auto length_s = [](const RunFile& run) { return run.time_s().back() - run.time_s()[0]; };
  const auto step_s = [&](const RunFile& run) {
    return length_s(run) / static_cast<double>(std::max<std::size_t>(run.rows(), 2) - 1);
  };
  ClockShift best;
  best.step_s = std::max(
      {step_s(first), step_s(second), std::max(length_s(first), length_s(second)) / points_max});
  if (!(best.step_s > 0)) return std::nullopt;
  const double shorter_s = std::min(length_s(first), length_s(second));
  const auto lag = static_cast<std::size_t>(std::max(1.0, shorter_s / best.step_s / 40));
  const double offset_s = first.time_s().front() - second.time_s().front();
  std::vector<std::vector<double>> of_second;
  for (std::size_t j = 0; j < std::min(second.columns.size(), columns_max); ++j)
    of_second.push_back(second.columns[j] == "time_s" ? std::vector<double>{}
                                                      : changes(second, j, best.step_s, lag));
  for (std::size_t i = 0; i < std::min(first.columns.size(), columns_max); ++i) {
    if (first.columns[i] == "time_s") continue;
    const std::vector<double> a = changes(first, i, best.step_s, lag);
    for (std::size_t j = 0; j < of_second.size(); ++j)
      if (!a.empty() && !of_second[j].empty())
        try_pair(a, of_second[j], offset_s, expected_s,
                 "'" + first.columns[i] + "' and '" + second.columns[j] + "'", best);
  }
  return best.columns.empty() ? std::nullopt : std::optional(best);
}

namespace {

constexpr double same_moment_s = 0.001;
constexpr double gap_s_min = 60.0;
constexpr double gap_steps = 3.0;

[[noreturn]] void refuse(const RunFile& run, const std::string& key, const std::string& value,
                         std::string rule) {
  throw ConfigurationError({Problem{run.name, 0, key, value, std::move(rule)}});
}

std::string two_digits(double value) {
  char text[16];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

/// Estimates the shift from events in both recordings.
std::optional<ClockShift> seen_shift(const RunFile& first, const RunFile& second,
                                     const std::string& why) {
  const auto shift = clock_shift(first, second);
  if (shift && shift->is_sure()) return shift;
  std::string rule = why +
                     ": write --shift-s S, where the second file's time_s plus S is the first "
                     "one's";
  if (shift)
    rule += "; the best that their values show is " + number_text(shift->shift_s) + ", where " +
            shift->columns + " change alike (correlation " + two_digits(shift->correlation) +
            ", at another shift " + two_digits(shift->next) + "), which is not sure";
  refuse(second, "--shift-s", "(missing)", rule);
}

struct Shift {
  double shift_s{0.0};
  std::string why;
};

/// Refuses dates if the columns change alike at quite another shift: a clock on another zone, or
/// not changed to summer time.
Shift shift_by_dates(const RunFile& first, const RunFile& second) {
  constexpr double lag_s_max = 1800.0;  // a displacement may follow a temperature so late
  const double by_dates_s = second.wall_zero->seconds - first.wall_zero->seconds;
  const auto seen = clock_shift(first, second, by_dates_s);
  const double apart_s = seen ? seen->shift_s - by_dates_s : 0.0;
  if (!seen || !(std::abs(apart_s) > lag_s_max) || seen->correlation < correlation_min ||
      seen->correlation - seen->at_expected < lead_min)
    return {by_dates_s, "by their dates"};
  // Clocks differ by whole hours, and the shift is known to a step of the grid.
  const double hours_s = 3600.0 * std::round(apart_s / 3600.0);
  const double shift_s =
      by_dates_s + (std::abs(apart_s - hours_s) <= seen->step_s ? hours_s : std::round(apart_s));
  const std::string alike = seen->columns + " change alike at " + number_text(shift_s) +
                            " s (correlation " + two_digits(seen->correlation) + ", by the dates " +
                            two_digits(seen->at_expected) + ", at most " + two_digits(seen->next) +
                            " at other shifts)";
  if (!seen->is_sure()) return {by_dates_s, "by their dates; but " + alike + ", which is not sure"};
  refuse(second, "--shift-s", "(missing)",
         "the dates give " + number_text(by_dates_s) + " s, but " + alike +
             ": one clock seems to be set differently; write --shift-s " + number_text(shift_s) +
             ", or --shift-s " + number_text(by_dates_s) + " if the dates are right");
}

Shift shift_of(const RunFile& first, const RunFile& second, std::optional<double> shift_s) {
  if (shift_s) return {*shift_s, "given by --shift-s"};
  std::string why;
  for (const RunFile* run : {&second, &first})
    if (!run->wall_zero)
      why = run->name + " has no dates, so the shift between the two clocks is unknown";
  if (why.empty() && first.wall_zero->is_utc != second.wall_zero->is_utc)
    why = "only one of the two gives its time zone";
  if (why.empty()) return shift_by_dates(first, second);
  const auto seen = seen_shift(first, second, why);
  return {seen->shift_s, "since " + seen->columns + " change alike there (correlation " +
                             two_digits(seen->correlation) + ", at most " + two_digits(seen->next) +
                             " at other shifts), to about " +
                             number_text(std::round(seen->step_s * 10) / 10) + " s"};
}

double usual_step_s(const std::vector<double>& time_s) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time_s.size(); ++i) steps.push_back(time_s[i] - time_s[i - 1]);
  return steps.empty() ? 0.0 : median(std::move(steps));
}

bool is_steady(const std::string& column) {
  return is_temperature(column) || kind_of(column) == QuantityKind::position;
}

/// Value of a column between its rows `after` - 1 and `after`; NaN for outputs and across gaps.
double value_between(const RunFile& run, std::size_t column, std::size_t after, double at_s,
                     double gap_s) {
  const auto& time_s = run.time_s();
  const auto& values = run.values[column];
  const double missing = std::numeric_limits<double>::quiet_NaN();
  if (after == 0 || after == time_s.size()) return missing;
  if (is_output(run.columns[column]) || time_s[after] - time_s[after - 1] > gap_s) return missing;
  if (!is_steady(run.columns[column])) return values[after - 1];
  const double share = (at_s - time_s[after - 1]) / (time_s[after] - time_s[after - 1]);
  return values[after - 1] + share * (values[after] - values[after - 1]);
}

class Join {
 public:
  Join(const RunFile& first, const RunFile& second, const Shift& shift)
      : first_(first), second_(second), shift_s_(shift.shift_s), why_(shift.why) {
    gap_s_ = std::max(gap_s_min, gap_steps * usual_step_s(first.time_s()));
    run_.name = first.name;
    run_.wall_zero = first.wall_zero;
    for (std::size_t i = 0; i < first.columns.size(); ++i)
      if (first.columns[i] != "time_s") from_first_.push_back(i);
    for (std::size_t i = 0; i < second.columns.size(); ++i)
      if (second.columns[i] != "time_s") from_second_.push_back(i);
    run_.columns = {"time_s"};
    for (const std::size_t i : from_first_) run_.columns.push_back(first.columns[i]);
    for (const std::size_t i : from_second_) {
      run_.columns.push_back(new_name(second.columns[i]));
    }
    run_.values.resize(run_.columns.size());
  }

  RunFile run() {
    const auto& a = first_.time_s();
    const auto& b = second_.time_s();
    std::size_t i = 0;
    std::size_t j = 0;
    while (i < a.size() || j < b.size()) {
      const double next_a = i < a.size() ? a[i] : std::numeric_limits<double>::infinity();
      const double next_b =
          j < b.size() ? b[j] + shift_s_ : std::numeric_limits<double>::infinity();
      const bool takes_a = next_a <= next_b + same_moment_s;
      const bool takes_b = next_b <= next_a + same_moment_s;
      add_row(takes_a ? next_a : next_b, i, takes_a, j, takes_b);
      if (takes_a) ++i;
      if (takes_b) ++j;
    }
    if (inside_ == 0)
      refuse(second_, "--join", range(second_.time_s(), shift_s_),
             "is outside " + first_.name + ", which is " + range(a, 0.0) +
                 ": the clocks differ; give --shift-s S, where the second file's time_s plus S is "
                 "the first one's");
    run_.selected_end = run_.rows();
    note_shift();
    return std::move(run_);
  }

 private:
  /// A column of both files gets a number: bed_2_degC.
  std::string new_name(const std::string& column) {
    const auto is_taken = [&](const std::string& name) {
      return std::ranges::find(run_.columns, name) != run_.columns.end();
    };
    const std::string suffix(unit_of(column).suffix);
    const std::string base = column.substr(0, column.size() - suffix.size());
    std::string name = column;
    for (int i = 2; is_taken(name); ++i)
      name = std::string(base).append("_").append(std::to_string(i)).append(suffix);
    if (name != column)
      run_.understood.push_back(column + " of " + second_.name + " is " + name + ", since " +
                                first_.name + " has a column of that name");
    return name;
  }

  static std::string range(const std::vector<double>& time_s, double shift_s) {
    return number_text(time_s.front() + shift_s) + " to " + number_text(time_s.back() + shift_s) +
           " s";
  }

  void add_row(double at_s, std::size_t i, bool takes_a, std::size_t j, bool takes_b) {
    if (takes_a && std::ranges::binary_search(first_.references, i))
      run_.references.push_back(run_.values[0].size());
    run_.values[0].push_back(at_s);
    std::size_t column = 1;
    for (const std::size_t of : from_first_)
      run_.values[column++].push_back(takes_a ? first_.values[of][i]
                                              : value_between(first_, of, i, at_s, gap_s_));
    for (const std::size_t of : from_second_)
      run_.values[column++].push_back(takes_b ? second_.values[of][j]
                                              : std::numeric_limits<double>::quiet_NaN());
    const auto& a = first_.time_s();
    if (takes_b && at_s >= a.front() && at_s <= a.back()) ++inside_;
  }

  void note_shift() {
    const std::size_t rows = second_.rows();
    run_.understood.push_back(second_.name + ": its time_s plus " + number_text(shift_s_) +
                              " s is that of " + first_.name + ", " + why_);
    run_.understood.push_back(
        std::to_string(inside_) + " of its " + std::to_string(rows) +
        " rows are within; temperatures and positions are interpolated between rows, over at "
        "most " +
        number_text(gap_s_) + " s");
  }

  const RunFile& first_;
  const RunFile& second_;
  double shift_s_;
  std::string why_;
  double gap_s_{0.0};
  std::vector<std::size_t> from_first_;
  std::vector<std::size_t> from_second_;
  std::size_t inside_{0};
  RunFile run_;
};

}  // namespace

RunFile joined_runs(const RunFile& first, const RunFile& second, std::optional<double> shift_s) {
  return Join(first, second, shift_of(first, second, shift_s)).run();
}

bool has_axes(const RunFile& run) {
  return std::ranges::any_of(run.columns, [](const std::string& column) {
    return is_axis_letter(column.substr(0, column.size() - unit_of(column).suffix.size()));
  });
}

RunFile displacements_of(RunFile corrections, CorrectionEntry entry) {
  bool has_axis = false;
  for (std::size_t i = 0; i < corrections.columns.size(); ++i) {
    std::string& name = corrections.columns[i];
    const Unit unit = unit_of(name);
    std::string axis = name.substr(0, name.size() - unit.suffix.size());
    if (!is_axis_letter(axis)) continue;
    const bool is_mm = unit.kind == QuantityKind::position;
    if (!is_mm && !is_output(name))
      throw ConfigurationError(
          {Problem{corrections.name, 0, name, "",
                   "has no unit of a correction: name the column of the values with it (\"value "
                   "[mm]\"), or write it under [columns] in the file of --columns"}});
    axis[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(axis[0])));
    const std::string was = name;
    const std::string displacement = axis + (is_mm ? "_um" : std::string(unit.suffix));
    if (displacement != was && corrections.find(displacement))
      throw ConfigurationError({Problem{corrections.name, 0, was, "",
                                        "is a second column of corrections of axis " + axis}});
    name = displacement;
    double sum = 0.0;
    for (double& value : corrections.values[i]) {
      if (std::isnan(value)) continue;
      const double entered = is_mm ? 1e3 * value : value;
      sum = entry == CorrectionEntry::step ? sum + entered : entered;
      value = -sum;
    }
    corrections.understood.push_back(name + ": less the " +
                                     (entry == CorrectionEntry::step ? "sum of " : "last of ") +
                                     was + ", what was corrected");
    has_axis = true;
  }
  if (!has_axis)
    throw ConfigurationError({Problem{corrections.name, 0, "", "",
                                      "no column is named like an axis (x, y, z, a, b, c); several "
                                      "tools or places need a log each"}});
  return corrections;
}

}  // namespace thermocomp::cli
