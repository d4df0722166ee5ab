#include "config/run_forms/number_epoch.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace thermocomp {
namespace {

constexpr double s_per_day = 86400.0;

constexpr std::array<Epoch, 8> epochs{{
    {"s since 1970", 1e9, 2.5e9, 1, 0, false, true},
    {"ms since 1970", 1e12, 2.5e12, 1e3, 0, false, true},
    {"us since 1970", 1e15, 2.5e15, 1e6, 0, false, true},
    {"ns since 1970", 1e18, 2.5e18, 1e9, 0, false, true},
    {"s since 1904", 3.1e9, 4.6e9, 1, -2082844800.0, true, true},
    {"100 ns since 1601", 1.25e17, 1.42e17, 1e7, -11644473600.0, false, true},
    {"day", 20000, 80000, 1 / s_per_day, -25569 * s_per_day, true, false},
    {"days since the year 0", 7.2e5, 7.6e5, 1 / s_per_day, -719529 * s_per_day, true, false},
}};

/// True if two neighbours differ by at most `step_max`, or no two differ.
bool has_steps_below(double step_max, const std::vector<double>& numbers) {
  double least = INFINITY;
  for (std::size_t i = 1; i < numbers.size(); ++i)
    if (const double step = std::abs(numbers[i] - numbers[i - 1]); step > 0)
      least = std::min(least, step);
  return std::isinf(least) || least <= step_max;
}

bool are_multiples_of(double unit, const std::vector<double>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [unit](double number) {
    return std::abs(number / unit - std::round(number / unit)) < 1e-6;
  });
}

}  // namespace

const Epoch* epoch_of(const std::vector<double>& numbers, bool is_named, bool has_unit) {
  constexpr double step_s_max = 3600.0;
  for (const Epoch& epoch : epochs) {
    if (epoch.only_named && !is_named) continue;
    // Whole numbers of that size may be ms of a counter of 32 bits.
    if (epoch.only_named && epoch.per_second == 1 && !has_unit && are_multiples_of(1, numbers))
      continue;
    // No clock goes in steps of 86.4 s: these are seconds.
    if (epoch.per_second < 1 && !has_unit && are_multiples_of(0.001, numbers)) continue;
    if (!has_unit && !has_steps_below(step_s_max * epoch.per_second * 1.001, numbers)) continue;
    if (!numbers.empty() && std::all_of(numbers.begin(), numbers.end(), [&](double number) {
          return number >= epoch.low && number < epoch.high;
        }))
      return &epoch;
  }
  return nullptr;
}

}  // namespace thermocomp
