#include "cli/import/joined_runs.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "cli/import/clock_shift.hpp"
#include "config/runs/robust.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"
#include "config/text/units.hpp"

namespace thermocomp::cli {
namespace {

/// Rows that are closer are one moment.
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

/// The two recordings may have seen the same events.
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

Shift shift_of(const RunFile& first, const RunFile& second, std::optional<double> shift_s) {
  if (shift_s) return {*shift_s, "as --shift-s says"};
  std::string why;
  for (const RunFile* run : {&second, &first})
    if (!run->wall_zero)
      why = run->name + " has no dates, so nothing says how the two clocks belong together";
  if (why.empty() && first.wall_zero->is_utc != second.wall_zero->is_utc)
    why = "one of the two says its time zone and the other does not";
  if (why.empty()) return {second.wall_zero->seconds - first.wall_zero->seconds, "by their dates"};
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

/// The value of a column of the first file at a moment between its rows `after` - 1 and `after`.
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
      if (first.find(second.columns[i]))
        refuse(second, second.columns[i], "(twice)",
               "is a column of " + first.name +
                   " too: give one of them another name in the file "
                   "of --columns");
      run_.columns.push_back(second.columns[i]);
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
             "lies outside of " + first_.name + ", which is " + range(a, 0.0) +
                 ": the clocks differ; write --shift-s S, where the second file's time_s plus S is "
                 "the first one's");
    run_.selected_end = run_.rows();
    say();
    return std::move(run_);
  }

 private:
  static std::string range(const std::vector<double>& time_s, double shift_s) {
    return number_text(time_s.front() + shift_s) + " to " + number_text(time_s.back() + shift_s) +
           " s";
  }

  void add_row(double at_s, std::size_t i, bool takes_a, std::size_t j, bool takes_b) {
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

  void say() {
    const std::size_t rows = second_.rows();
    run_.understood.push_back(second_.name + ": its time_s plus " + number_text(shift_s_) +
                              " s is that of " + first_.name + ", " + why_);
    run_.understood.push_back(
        std::to_string(inside_) + " of its " + std::to_string(rows) +
        " rows lie within; temperatures and positions between two rows are on the line between "
        "them, over at most " +
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

}  // namespace thermocomp::cli
