#include "config/run_forms/row_order.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>

#include "config/run_forms/column_roles.hpp"
#include "config/run_forms/field_text.hpp"

namespace thermocomp {
namespace {

/// Summer time begins and ends before 3 o'clock on a Sunday of March, April, September, October or
/// November.
bool may_be_clock_change(double wall_s) {
  const auto hour = static_cast<int>(std::floor(wall_s / 3600.0));
  const auto days = std::chrono::floor<std::chrono::days>(std::chrono::hours{hour});
  const std::chrono::sys_days day{days};
  const auto month = static_cast<unsigned>(std::chrono::year_month_day{day}.month());
  return std::chrono::weekday{day} == std::chrono::Sunday && hour - 24 * days.count() < 3 &&
         (month == 3 || month == 4 || (month >= 9 && month <= 11));
}

/// A local clock is set forward by an hour in a night of spring, and back in one of autumn, while
/// the rows continue.
void follow_summer_time(TextTable& table, RunTime& time) {
  constexpr double hour_s = 3600.0;
  constexpr double steps_max = 3.0;
  if (!time.wall_zero || time.wall_zero->is_utc) return;
  std::vector<double>& time_s = time.time_s;
  double added_s = 0.0;
  double step_s = 0.0;  // between the two rows before
  double last = time_s.front();
  for (std::size_t row = 1; row < time_s.size(); ++row) {
    const double now = time_s[row];
    const double before_s = std::exchange(step_s, now - last);
    const double wall_s = time.wall_zero->seconds + last;
    const double hours = std::floor((wall_s + step_s) / hour_s) - std::floor(wall_s / hour_s);
    const double change_s = step_s <= 0.0 ? hour_s : -hour_s;
    const bool is_change = step_s <= 0.0 || (hours == 2.0 && steps_max * before_s <= hour_s);
    if (is_change && step_s + change_s > 0.0 && step_s + change_s <= steps_max * before_s &&
        may_be_clock_change(wall_s)) {
      added_s += change_s;
      step_s += change_s;
      const bool is_back = change_s > 0.0;
      table.notes.push_back(std::string("summer time: the clock was set ") +
                            (is_back ? "back" : "forward") + " by an hour before line " +
                            std::to_string(table.lines[row]) + ": an hour is " +
                            (is_back ? "added" : "taken off") + " from there on");
    }
    last = now;
    time_s[row] += added_s;
  }
}

void turn_rows(TextTable& table, RunTime& time) {
  const double earliest = time.time_s.back();
  std::ranges::reverse(time.time_s);
  for (double& at : time.time_s) at -= earliest;
  if (time.wall_zero) time.wall_zero->seconds += earliest;
  std::ranges::reverse(table.lines);
  for (TextColumn& column : table.columns) std::ranges::reverse(column.fields);
  table.notes.emplace_back("the newest row is first: order reversed");
}

/// Whether a column could name the series of a row's value.
bool has_text(const TextTable& table, std::size_t row) {
  return std::ranges::any_of(table.columns, [row](const TextColumn& column) {
    return !column.is_time && is_text(column) && !column.fields[row].empty();
  });
}

/// How to mend a time that is not later than that of the row before.
std::string remedy(const TextTable& table, const std::vector<double>& time_s, std::size_t row) {
  if (has_text(table, row))
    return "for one row per value write pivot = \"the column that names the series\" in the file "
           "of --columns";
  if (time_s[row] == time_s[row - 1])
    return "delete one of the two lines, or write the time with its fraction of a second";
  if (row == 1 && table.lines[0] < table.lines[1])
    return "delete line " + std::to_string(table.lines[0]) +
           " if it belongs to the header, or put the rows in the order of time";
  return "put the rows in the order of time; where the clock was set, delete the lines before or "
         "after it";
}

}  // namespace

void order_in_time(TextTable& table, RunTime& time, std::size_t column) {
  const std::vector<double>& time_s = time.time_s;
  std::ptrdiff_t falling = 0;
  for (std::size_t row = 1; row < time_s.size(); ++row)
    falling += (time_s[row] < time_s[row - 1] ? 1 : 0) - (time_s[row] > time_s[row - 1] ? 1 : 0);
  if (falling > 0) turn_rows(table, time);
  follow_summer_time(table, time);
  const auto at = std::ranges::adjacent_find(time_s, [](double a, double b) { return !(b > a); });
  if (at == time_s.end()) return;
  const auto row = static_cast<std::size_t>(at - time_s.begin()) + 1;
  table.refuse_field(row, column,
                     "must be later than in line " + std::to_string(table.lines[row - 1]) + " (" +
                         shortened(table.columns[column].fields[row - 1]) +
                         "): " + remedy(table, time_s, row));
}

}  // namespace thermocomp
