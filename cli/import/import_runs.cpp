#include "cli/import/import_runs.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/row_order.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/runs/robust.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"
#include "config/text/units.hpp"
#include "estimator/types.hpp"

namespace thermocomp::cli {
namespace {

constexpr std::size_t points_max = 2000;
constexpr Eigen::Index points_min = 20;
constexpr std::size_t columns_max = 16;
constexpr double correlation_min = 0.8;
constexpr double lead_min = 0.15;

using Eigen::Index;
using Eigen::VectorXd;

/// Changes of a column over `lag` steps of a grid that begins with the run's first row; a longer
/// lag reduces the noise's share. Empty: there are none.
VectorXd changes(const RunFile& run, std::size_t column, double step_s, Index lag) {
  std::vector<double> time_s;
  std::vector<double> values;
  for (std::size_t row = 0; row < run.rows(); ++row) {
    if (!std::isfinite(run.values[column][row])) continue;
    time_s.push_back(run.time_s()[row] - run.time_s().front());
    values.push_back(run.values[column][row]);
  }
  if (run.columns[column] == "time_s" || values.size() < 3) return {};
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
  const Eigen::Map<const VectorXd> grid(on_grid.data(), std::ssize(on_grid));
  const Index count = std::max<Index>(0, grid.size() - lag);
  return grid.tail(count) - grid.head(count);
}

/// Correlation coefficient of a_i and b_(i - shift), without removing means.
double correlation(const VectorXd& a, const VectorXd& b, Index shift) {
  const Index begin = std::max<Index>(0, shift);
  const Index size = std::min(a.size(), b.size() + shift) - begin;
  const auto of_a = a.segment(begin, size);
  const auto of_b = b.segment(begin - shift, size);
  // Parts covered by only one recording are weighted by half.
  const double weight_a = 0.5 * (of_a.squaredNorm() + a.squaredNorm());
  const double weight_b = 0.5 * (of_b.squaredNorm() + b.squaredNorm());
  return weight_a > 0 && weight_b > 0 ? of_a.dot(of_b) / std::sqrt(weight_a * weight_b) : 0.0;
}

void try_pair(const VectorXd& a, const VectorXd& b, double offset_s, double expected_s,
              const std::string& columns, ClockShift& best) {
  const Index common = std::max(points_min, std::min(a.size(), b.size()) / 3);
  const Index first = common - b.size();
  const Index shifts = a.size() - common - first + 1;
  if (std::min({a.size(), b.size(), shifts}) <= 0) return;
  VectorXd by_shift(shifts);
  for (Index i = 0; i < shifts; ++i) by_shift[i] = std::abs(correlation(a, b, first + i));
  Index strongest = 0;
  if (!(by_shift.maxCoeff(&strongest) > best.correlation)) return;
  best.correlation = by_shift[strongest];
  const Index expected = std::lround((expected_s - offset_s) / best.step_s) - first;
  best.at_expected = expected >= 0 && expected < shifts ? by_shift[expected] : 0.0;
  best.shift_s = offset_s + best.step_s * static_cast<double>(first + strongest);
  best.columns = columns;
  // r falls on both sides of its peak; where it rises by more than 0.05, another peak follows.
  best.next = 0.0;
  for (const Index way : {-1, 1}) {
    double lowest = best.correlation;
    for (Index i = strongest + way; i >= 0 && i < shifts; i += way) {
      lowest = std::min(lowest, by_shift[i]);
      if (by_shift[i] > lowest + 0.05) best.next = std::max(best.next, by_shift[i]);
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
  const auto lag = static_cast<Index>(std::max(1.0, shorter_s / best.step_s / 40));
  const double offset_s = first.time_s().front() - second.time_s().front();
  std::vector<VectorXd> of_second;
  for (std::size_t j = 0; j < std::min(second.columns.size(), columns_max); ++j)
    of_second.push_back(changes(second, j, best.step_s, lag));
  for (std::size_t i = 0; i < std::min(first.columns.size(), columns_max); ++i) {
    const VectorXd of_first = changes(first, i, best.step_s, lag);
    for (std::size_t j = 0; j < of_second.size(); ++j)
      try_pair(of_first, of_second[j], offset_s, expected_s,
               fmt::format("'{}' and '{}'", first.columns[i], second.columns[j]), best);
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

/// Estimates the shift from events in both recordings.
ClockShift seen_shift(const RunFile& first, const RunFile& second, const std::string& why) {
  const auto shift = clock_shift(first, second);
  if (shift && shift->is_sure()) return *shift;
  std::string rule =
      why + ": write --shift-s S, where the second file's time_s plus S is the first one's";
  if (shift)
    rule += fmt::format(
        "; the best that their values show is {}, where {} change alike (correlation {:.2f}, at "
        "another shift {:.2f}), which is not sure",
        number_text(shift->shift_s), shift->columns, shift->correlation, shift->next);
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
  const std::string alike = fmt::format(
      "{} change alike at {} s (correlation {:.2f}, by the dates {:.2f}, at most {:.2f} at other "
      "shifts)",
      seen->columns, number_text(shift_s), seen->correlation, seen->at_expected, seen->next);
  if (!seen->is_sure()) return {by_dates_s, "by their dates; but " + alike + ", which is not sure"};
  refuse(second, "--shift-s", "(missing)",
         fmt::format("the dates give {0} s, but {1}: one clock seems to be set differently; write "
                     "--shift-s {2}, or --shift-s {0} if the dates are right",
                     number_text(by_dates_s), alike, number_text(shift_s)));
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
  const ClockShift seen = seen_shift(first, second, why);
  return {seen.shift_s, fmt::format("since {} change alike there (correlation {:.2f}, at most "
                                    "{:.2f} at other shifts), to about {} s",
                                    seen.columns, seen.correlation, seen.next,
                                    number_text(std::round(seen.step_s * 10) / 10))};
}

double usual_step_s(const std::vector<double>& time_s) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time_s.size(); ++i) steps.push_back(time_s[i] - time_s[i - 1]);
  return steps.empty() ? 0.0 : median(std::move(steps));
}

/// Value of a column between its rows `after` - 1 and `after`; NaN for outputs and across gaps.
double value_between(const RunFile& run, std::size_t column, std::size_t after, double at_s,
                     double gap_s) {
  const auto& time_s = run.time_s();
  const auto& values = run.values[column];
  const std::string& name = run.columns[column];
  if (after == 0 || after == time_s.size() || is_output(name) ||
      time_s[after] - time_s[after - 1] > gap_s)
    return not_a_number;
  const bool is_steady = is_temperature(name) || kind_of(name) == QuantityKind::position;
  if (!is_steady) return values[after - 1];
  const double share = (at_s - time_s[after - 1]) / (time_s[after] - time_s[after - 1]);
  return values[after - 1] + share * (values[after] - values[after - 1]);
}

class Join {
 public:
  Join(const RunFile& first, const RunFile& second, const Shift& shift)
      : first_(first), second_(second), shift_(shift) {
    gap_s_ = std::max(gap_s_min, gap_steps * usual_step_s(first.time_s()));
    run_.name = first.name;
    run_.wall_zero = first.wall_zero;
    run_.columns = {"time_s"};
    for (const std::size_t i : from_first_) run_.columns.push_back(first.columns[i]);
    for (const std::size_t i : from_second_) run_.columns.push_back(new_name(second.columns[i]));
    run_.values.resize(run_.columns.size());
  }

  RunFile run() {
    const auto& a = first_.time_s();
    const auto& b = second_.time_s();
    std::size_t i = 0;
    std::size_t j = 0;
    while (i < a.size() || j < b.size()) {
      const double next_a = i < a.size() ? a[i] : INFINITY;
      const double next_b = j < b.size() ? b[j] + shift_.shift_s : INFINITY;
      const bool takes_a = next_a <= next_b + same_moment_s;
      const bool takes_b = next_b <= next_a + same_moment_s;
      add_row(takes_a ? next_a : next_b, i, takes_a, j, takes_b);
      if (takes_a) ++i;
      if (takes_b) ++j;
    }
    if (inside_ == 0)
      refuse(second_, "--join", range(b, shift_.shift_s),
             fmt::format("is outside {}, which is {}: the clocks differ; give --shift-s S, where "
                         "the second file's time_s plus S is the first one's",
                         first_.name, range(a, 0.0)));
    run_.selected_end = run_.rows();
    note_shift();
    return std::move(run_);
  }

 private:
  static std::vector<std::size_t> columns_beside_time(const RunFile& run) {
    std::vector<std::size_t> columns;
    for (std::size_t i = 0; i < run.columns.size(); ++i)
      if (run.columns[i] != "time_s") columns.push_back(i);
    return columns;
  }

  /// A column of both files gets a number: bed_2_degC.
  std::string new_name(const std::string& column) {
    const std::string name =
        unused_name(column, [&](const std::string& each) { return run_.find(each).has_value(); });
    if (name != column)
      run_.understood.push_back(fmt::format("{} of {} is {}, since {} has a column of that name",
                                            column, second_.name, name, first_.name));
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
      run_.values[column++].push_back(takes_b ? second_.values[of][j] : not_a_number);
    const auto& a = first_.time_s();
    if (takes_b && at_s >= a.front() && at_s <= a.back()) ++inside_;
  }

  void note_shift() {
    run_.understood.push_back(fmt::format("{}: its time_s plus {} s is that of {}, {}",
                                          second_.name, number_text(shift_.shift_s), first_.name,
                                          shift_.why));
    run_.understood.push_back(
        fmt::format("{} of its {} rows are within; temperatures and positions are interpolated "
                    "between rows, over at most {} s",
                    inside_, second_.rows(), number_text(gap_s_)));
  }

  const RunFile& first_;
  const RunFile& second_;
  Shift shift_;
  double gap_s_{0.0};
  std::vector<std::size_t> from_first_{columns_beside_time(first_)};
  std::vector<std::size_t> from_second_{columns_beside_time(second_)};
  std::size_t inside_{0};
  RunFile run_;
};

}  // namespace

RunFile joined_runs(const RunFile& first, const RunFile& second, std::optional<double> shift_s) {
  return Join(first, second, shift_of(first, second, shift_s)).run();
}

bool has_axes(const RunFile& run) {
  return std::ranges::any_of(
      run.columns, [](const std::string& column) { return is_axis_letter(without_unit(column)); });
}

RunFile displacements_of(RunFile corrections, CorrectionEntry entry) {
  bool has_axis = false;
  const bool are_steps = entry == CorrectionEntry::step;
  for (std::size_t i = 0; i < corrections.columns.size(); ++i) {
    const std::string was = corrections.columns[i];
    if (!is_axis_letter(without_unit(was))) continue;
    const bool is_mm = kind_of(was) == QuantityKind::position;
    if (!is_mm && !is_output(was))
      refuse(corrections, was, "",
             "has no unit of a correction: name the column of the values with it (\"value [mm]\"), "
             "or write it under [columns] in the file of --columns");
    const std::string axis = small_letters(without_unit(was));
    const std::string name = axis + (is_mm ? "_um" : std::string(unit_of(was).suffix));
    if (name != was && corrections.find(name))
      refuse(corrections, was, "", "is a second column of corrections of axis " + axis);
    corrections.columns[i] = name;
    double sum = 0.0;
    for (double& value : corrections.values[i]) {
      if (std::isnan(value)) continue;
      const double entered = is_mm ? 1e3 * value : value;
      sum = are_steps ? sum + entered : entered;
      value = -sum;
    }
    corrections.understood.push_back(fmt::format("{}: less the {} of {}, what was corrected", name,
                                                 are_steps ? "sum" : "last", was));
    has_axis = true;
  }
  if (!has_axis)
    refuse(corrections, "", "",
           "no column is named like an axis (x, y, z, a, b, c); several tools or places need a log "
           "each");
  return corrections;
}

}  // namespace thermocomp::cli
