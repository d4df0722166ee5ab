#include "config/run_forms/row_order.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>

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
void follow_summer_time(const TextTable& table, std::vector<double>& time_s, RunFile& run) {
  constexpr double hour_s = 3600.0;
  constexpr double steps_max = 3.0;
  if (!run.wall_zero || run.wall_zero->is_utc) return;
  double added_s = 0.0;
  double step_s = 0.0;  // between the two rows before
  double last = time_s.front();
  for (std::size_t row = 1; row < time_s.size(); ++row) {
    const double now = time_s[row];
    const double before_s = std::exchange(step_s, now - last);
    const double wall_s = run.wall_zero->seconds + last;
    const double hours = std::floor((wall_s + step_s) / hour_s) - std::floor(wall_s / hour_s);
    const double change_s = step_s <= 0.0 ? hour_s : -hour_s;
    const bool is_change = step_s <= 0.0 || (hours == 2.0 && steps_max * before_s <= hour_s);
    if (is_change && step_s + change_s > 0.0 && step_s + change_s <= steps_max * before_s &&
        may_be_clock_change(wall_s)) {
      added_s += change_s;
      step_s += change_s;
      run.understood.push_back(
          std::string("summer time: the clock was set ") + (change_s > 0.0 ? "back" : "forward") +
          " by an hour before line " + std::to_string(table.lines[row]) +
          (change_s > 0.0 ? ": an hour is added" : ": an hour is taken off") + " from there on");
    }
    last = now;
    time_s[row] += added_s;
  }
}

void turn_rows(TextTable& table, std::vector<double>& time_s, RunFile& run) {
  const double earliest = time_s.back();
  std::reverse(time_s.begin(), time_s.end());
  for (double& at : time_s) at -= earliest;
  if (run.wall_zero) run.wall_zero->seconds += earliest;
  std::reverse(table.lines.begin(), table.lines.end());
  std::reverse(table.fields.begin(), table.fields.end());
  for (auto row = table.fields.begin(); row != table.fields.end();) {
    const auto end = row + static_cast<std::ptrdiff_t>(table.columns());
    std::reverse(row, end);
    row = end;
  }
  run.understood.emplace_back("the newest row is first: order reversed");
}

}  // namespace

void order_in_time(TextTable& table, std::vector<double>& time_s, RunFile& run) {
  std::ptrdiff_t falling = 0;
  for (std::size_t row = 1; row < time_s.size(); ++row)
    falling += (time_s[row] < time_s[row - 1] ? 1 : 0) - (time_s[row] > time_s[row - 1] ? 1 : 0);
  if (falling > 0) turn_rows(table, time_s, run);
  follow_summer_time(table, time_s, run);
}

}  // namespace thermocomp
