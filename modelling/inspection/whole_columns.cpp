// What shows only over a whole column or run: its unit, its noise, the unit of the time.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Cholesky>

#include "config/runs/robust.hpp"
#include "config/text/units.hpp"
#include "estimator/types.hpp"
#include "modelling/inspection/checks.hpp"

namespace thermocomp::inspection {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double zero_degC_in_K = 273.15;

Suspicion over_run(const std::string& kind, const std::string& column, std::size_t run,
                   const std::vector<double>& time_s, double size, const std::string& unit,
                   double score) {
  Suspicion made;
  made.finding.kind = kind;
  made.finding.column = column;
  made.finding.run = run;
  made.finding.at_s = time_s.front();
  made.finding.until_s = time_s.back();
  made.finding.size = size;
  made.finding.unit = unit;
  made.score = score;
  return made;
}

// ---- unit of a reading

double first_finite(const std::vector<double>& values) {
  const auto found =
      std::find_if(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  return found == values.end() ? not_a_number : *found;
}

double range_of(const std::vector<double>& values) {
  std::vector<double> finite = values;
  std::erase_if(finite, [](double value) { return !std::isfinite(value); });
  if (finite.empty()) return 0.0;
  const auto [low, high] = std::minmax_element(finite.begin(), finite.end());
  return *high - *low;
}

/// Whether a reading falls while most of the other temperatures rise.
bool moves_against_others(const RunFile& run, std::size_t column) {
  std::vector<double> signs;
  const double own = median(run.values[column]);
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (i == column || !is_temperature(run.columns[i])) continue;
    const double usual = median(run.values[i]);
    double together = 0.0;
    for (std::size_t row = 0; row < run.rows(); ++row) {
      const double both = (run.values[column][row] - own) * (run.values[i][row] - usual);
      if (std::isfinite(both)) together += both;
    }
    signs.push_back(together);
  }
  return median(std::move(signs)) < 0;
}

/// A reading that would begin like the others, and stay about where they are, if it were in kelvin,
/// ten times as large, a tenth or the negative. Of kelvin the drop-outs of the sensor do not count.
void check_unit(const RunFile& run, std::size_t index, std::size_t column, Suspicions& found) {
  constexpr double hot_degC = 200.0;
  constexpr double near_K = 5.0;
  constexpr double apart_K = 15.0;
  constexpr double about_K = 30.0;
  constexpr double larger_min = 3.0;        // motion, relative to that of the others
  constexpr std::ptrdiff_t drop_outs = 20;  // at most one in this number of rows
  const auto is_cool = [](double value) { return value <= hot_degC; };
  const std::vector<double>& values = run.values[column];
  std::vector<double> beginnings;
  std::vector<double> ranges;
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    const double first = first_finite(run.values[i]);
    if (i == column || !is_temperature(run.columns[i]) || !is_cool(first)) continue;
    beginnings.push_back(first);
    ranges.push_back(range_of(run.values[i]));
  }
  if (beginnings.empty()) return;
  const auto ends = std::minmax_element(beginnings.begin(), beginnings.end());
  const double low = *ends.first;
  const double high = *ends.second;
  const double first = first_finite(values);
  const double larger = range_of(values) / std::max(median(ranges), 0.1);
  const auto is_near = [&](double value, double reach_K) {
    return value >= low - reach_K && value <= high + reach_K;
  };
  const auto would_fit = [&](double factor) {
    return beginnings.size() > 1 && !is_near(first, apart_K) && is_near(factor * first, near_K) &&
           std::all_of(values.begin(), values.end(), [&](double value) {
             return !std::isfinite(value) || is_near(factor * value, about_K);
           });
  };
  const auto offer = [&](double size, const std::string& unit) {
    found.push_back(over_run("unit", run.columns[column], index, run.time_s(), size, unit, 10.0));
  };
  const auto cool = std::count_if(values.begin(), values.end(), is_cool);
  if (would_fit(0.1) && larger > larger_min)
    offer(10.0, "times");
  else if (drop_outs * cool <= static_cast<std::ptrdiff_t>(values.size()) &&
           std::abs(first - zero_degC_in_K - median(beginnings)) <= near_K)
    offer(zero_degC_in_K, "K");
  else if (would_fit(-1.0) && first < 0 && low > 0 && moves_against_others(run, column))
    offer(-1.0, "times");
  else if (would_fit(10.0) && low > apart_K && larger < 1.0 / larger_min)
    offer(0.1, "times");
}

// ---- noise

/// Deviation of the noise in each window, from second differences.
std::vector<double> noise_by_window(const std::vector<double>& values, std::size_t rows) {
  std::vector<double> bends(values.size(), not_a_number);
  for (std::size_t i = 1; i + 1 < values.size(); ++i)
    bends[i] = (values[i - 1] - 2.0 * values[i] + values[i + 1]) / std::sqrt(6.0);
  std::vector<double> noise;
  for (std::size_t begin = 0; begin + rows <= values.size(); begin += rows)
    noise.push_back(robust_deviation(std::span(bends).subspan(begin, rows)));
  return noise;
}

/// Half of the smallest change, below which noise cannot be seen.
double floor_of(const std::vector<double>& values) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t row = 1; row < values.size(); ++row)
    if (const double step = std::abs(values[row] - values[row - 1]); step > 0)
      least = std::min(least, step);
  return std::isfinite(least) ? 0.5 * least : 0.0;
}

/// Windows [begin, end), and how many times the usual noise they have.
struct Noisy {
  std::size_t begin{0};
  std::size_t end{0};
  double times{0.0};
};

/// The longest stretch of windows of several times the usual noise.
Noisy longest_noisy(const std::vector<double>& noise, double usual) {
  constexpr double times_min = 4.0;
  Noisy longest;
  for (std::size_t begin = 0; begin < noise.size(); ++begin) {
    std::size_t end = begin;
    while (end < noise.size() && noise[end] > times_min * usual) ++end;
    if (end - begin > longest.end - longest.begin) longest = {begin, end, 0.0};
    begin = end;
  }
  const auto at = [&](std::size_t i) { return noise.begin() + static_cast<std::ptrdiff_t>(i); };
  if (longest.end > longest.begin)
    longest.times = median({at(longest.begin), at(longest.end)}) / usual;
  return longest;
}

/// Whether all signals were elsewhere, in a window of usual noise, as in the noisy stretch:
/// otherwise the noise may come from the operation.
bool was_operated_so(const RunFile& run, const Noisy& noisy, const std::vector<double>& noise,
                     double usual, std::size_t rows) {
  constexpr double share = 0.1;  // of a signal's range
  const auto mean = [&](std::size_t column, std::size_t begin, std::size_t end) {
    const auto first = run.values[column].begin();
    std::vector<double> part(first + static_cast<std::ptrdiff_t>(begin * rows),
                             first + static_cast<std::ptrdiff_t>(end * rows));
    return median(std::move(part));
  };
  std::vector<std::size_t> quiet;
  for (std::size_t w = 0; w < noise.size(); ++w)
    if ((w < noisy.begin || w >= noisy.end) && noise[w] < 2.0 * usual) quiet.push_back(w);
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (!is_operating(run.columns[i]) || run.columns[i] == "time_s") continue;
    const double range = range_of(run.values[i]);
    for (std::size_t w = noisy.begin; w < noisy.end; ++w) {
      const double here = mean(i, w, w + 1);
      if (std::none_of(quiet.begin(), quiet.end(), [&](std::size_t q) {
            return !(std::abs(mean(i, q, q + 1) - here) > share * range);
          }))
        return false;
    }
  }
  return true;
}

void check_noise(const RunFile& run, std::size_t index, std::size_t column, Suspicions& found) {
  constexpr double noise_K_min = 0.1;
  constexpr double noise_um_min = 0.5;
  constexpr std::size_t windows_of_run = 60;
  constexpr std::size_t windows_min = 3;
  const bool output = is_output(run.columns[column]);
  const std::size_t rows = std::max<std::size_t>(12, run.rows() / windows_of_run);
  const std::vector<double>& values = run.values[column];
  const std::vector<double> noise = noise_by_window(values, rows);
  if (noise.size() < 4 * windows_min) return;
  const double usual = std::max(median(noise), floor_of(values));
  if (!(usual > 0)) return;
  const Noisy noisy = longest_noisy(noise, usual);
  if (noisy.end - noisy.begin < windows_min ||
      noisy.times * usual < (output ? noise_um_min : noise_K_min))
    return;
  // Other columns with more noise there: interference, vibration, or fast motion.
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (i == column || output != is_output(run.columns[i]) ||
        !(output || is_temperature(run.columns[i])))
      continue;
    const std::vector<double> other = noise_by_window(run.values[i], rows);
    const double other_usual = std::max(median(other), floor_of(run.values[i]));
    const auto at = [&](std::size_t w) { return other.begin() + static_cast<std::ptrdiff_t>(w); };
    if (median({at(noisy.begin), at(noisy.end)}) > 3.0 * other_usual) return;
  }
  if (!was_operated_so(run, noisy, noise, usual, rows)) return;
  Suspicion made = over_run("noise", run.columns[column], index, run.time_s(), noisy.times, "times",
                            noisy.times);
  made.finding.at_s = run.time_s()[noisy.begin * rows];
  made.finding.until_s = run.time_s()[noisy.end * rows - 1];
  found.push_back(made);
}

// ---- scale of a column against other runs

/// Gain of a column over what other runs predict from the temperatures.
struct Gain {
  double gain{0.0};
  double correlation{0.0};
};

/// Regressions of a column on temperatures, both without each run's mean.
class Regressions {
 public:
  Regressions(const Recording& recording, const VectorXd& y, const MatrixXd& x) {
    for (std::size_t r = 0; r < recording.runs(); ++r) {
      std::vector<Index> rows;
      for (Index row = recording.begins[r]; row < recording.begins[r + 1]; ++row)
        if (std::isfinite(y[row])) rows.push_back(row);
      MatrixXd inputs = x(rows, Eigen::all);
      VectorXd own = y(rows);
      if (!rows.empty()) {
        inputs.rowwise() -= inputs.colwise().mean().eval();
        own.array() -= own.mean();
      }
      x_.push_back(std::move(inputs));
      y_.push_back(std::move(own));
    }
  }

  [[nodiscard]] Index rows(std::size_t run) const { return y_[run].size(); }
  [[nodiscard]] double range(std::size_t run) const {
    return rows(run) > 0 ? y_[run].maxCoeff() - y_[run].minCoeff() : 0.0;
  }

  /// Of `run` over the others without `left_out`, all with the same weight.
  [[nodiscard]] Gain gain(std::size_t run, std::size_t left_out) const {
    const Index columns = x_[run].cols();
    MatrixXd left = MatrixXd::Zero(columns, columns);
    VectorXd right = VectorXd::Zero(columns);
    for (std::size_t other = 0; other < y_.size(); ++other) {
      if (other == run || other == left_out || rows(other) == 0) continue;
      const double weight = 1.0 / static_cast<double>(rows(other));
      left += weight * x_[other].transpose() * x_[other];
      right += weight * x_[other].transpose() * y_[other];
    }
    left.diagonal().array() += 0.01 * left.trace() / static_cast<double>(columns) + 1e-12;
    const VectorXd expected = x_[run] * left.ldlt().solve(right);
    const double square = expected.squaredNorm();
    const double own = y_[run].squaredNorm();
    const double both = expected.dot(y_[run]);
    if (!(square > 0) || !(own > 0)) return {};
    return {both / square, both / std::sqrt(square * own)};
  }

 private:
  std::vector<MatrixXd> x_;
  std::vector<VectorXd> y_;
};

/// Ten, a tenth or minus one, if a gain is near it.
std::optional<double> usual_factor(double gain) {
  for (const double factor : {10.0, 0.1, -1.0})
    if (gain / factor > 0.7 && gain / factor < 1.4) return factor;
  return std::nullopt;
}

/// A column of one run that agrees with the other runs, as these with each other, only when
/// multiplied. Of two runs either may be wrong.
void check_scale(const Recording& recording, const std::string& name, const VectorXd& y,
                 const MatrixXd& x, Suspicions& found) {
  constexpr double moved_um_min = 1.0;
  constexpr Index run_rows_min = 40;
  if (x.cols() == 0) return;
  const Regressions regressions(recording, y, x);
  const std::size_t runs = recording.runs();
  for (std::size_t r = runs == 2 ? 1 : 0; r < runs; ++r) {
    const Gain own = regressions.gain(r, r);
    const auto factor = usual_factor(own.gain);
    if (!factor || std::abs(own.correlation) < (runs == 2 ? 0.9 : 0.8) ||
        regressions.rows(r) < run_rows_min || regressions.range(r) < moved_um_min)
      continue;
    double least = 1.0;
    for (std::size_t other = 0; other < runs && runs > 2; ++other) {
      if (other == r) continue;
      const Gain gain = regressions.gain(other, r);
      if (!(gain.gain > 0.4 && gain.gain < 2.5)) least = 0.0;
      least = std::min(least, gain.correlation);
    }
    if (least < 0.8) continue;
    const Index begin = recording.begins[r];
    const std::vector<double> time_s{recording.time_s[begin],
                                     recording.time_s[recording.begins[r + 1] - 1]};
    const double rest = std::sqrt(1.0 - own.correlation * own.correlation);
    found.push_back(over_run("unit", name, r, time_s, *factor, "times",
                             std::min(20.0, (runs == 2 ? 1.0 : 2.0) / std::max(rest, 0.01))));
    if (runs == 2) found.back().finding.other = "either run";
  }
}

// ---- unit of the time

/// Fast change of a run's median temperature over a tenth of the run [K/h]; 0 with fewer than
/// three, or with a heater.
double fast_K_per_h(const RunFile& run) {
  constexpr double unheated_degC_max = 90.0;
  constexpr double moved_K = 0.5;
  constexpr std::size_t columns_min = 3;
  const std::size_t lag = std::max<std::size_t>(run.rows() / 10, 1);
  std::vector<double> speeds;
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (!is_temperature(run.columns[i])) continue;
    const std::vector<double>& values = run.values[i];
    if (std::any_of(values.begin(), values.end(), [](double v) { return v > unheated_degC_max; }))
      return 0.0;
    double most = 0.0;
    for (std::size_t row = lag; row < run.rows(); ++row) {
      const double moved = std::abs(values[row] - values[row - lag]);
      const double hours = (run.time_s()[row] - run.time_s()[row - lag]) / 3600.0;
      if (moved > moved_K) most = std::max(most, moved / hours);
    }
    speeds.push_back(most);
  }
  return speeds.size() < columns_min ? 0.0 : median(std::move(speeds));
}

/// Root mean square of the change over some rows, beside that of the noise; 0 if that hides it.
double motion_of(const std::vector<double>& values) {
  constexpr std::size_t lag = 20;
  constexpr double above_noise = 5.0;
  const std::vector<double> noise = noise_by_window(values, values.size());
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t row = lag; row < values.size(); ++row) {
    const double moved = values[row] - values[row - lag];
    if (!std::isfinite(moved)) continue;
    sum += moved * moved;
    count += 1.0;
  }
  const double motion = count > 0 ? std::sqrt(sum / count) : 0.0;
  return !noise.empty() && motion > above_noise * noise.front() ? motion : 0.0;
}

/// Whether a run has rows 60 times as close as another run's, between which the temperatures change
/// as there.
bool is_in_minutes_beside(const RunFile& run, const RunFile& other) {
  constexpr double minute_s = 60.0;
  const std::vector<double> steps = steps_of(run);
  const std::vector<double> other_steps = steps_of(other);
  if (steps.empty() || other_steps.empty()) return false;
  const double times = median(other_steps) / median(steps);
  if (std::abs(times / minute_s - 1.0) > 0.03) return false;
  std::vector<double> ratios;
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (!is_temperature(run.columns[i]) || !other.find(run.columns[i])) continue;
    const double there = motion_of(other.column(run.columns[i]));
    if (there > 0) ratios.push_back(motion_of(run.values[i]) / there);
  }
  return !ratios.empty() && median(std::move(ratios)) > 1.0 / 3.0;
}

}  // namespace

void check_units(const std::vector<RunFile>& runs, const Recording& recording, Suspicions& found) {
  for (std::size_t index = 0; index < runs.size(); ++index)
    for (std::size_t i = 0; i < runs[index].columns.size(); ++i)
      if (runs[index].columns[i].ends_with("_degC")) check_unit(runs[index], index, i, found);
  if (recording.runs() < 2) return;
  for (Index i = 0; i < recording.outputs_um.cols(); ++i)
    check_scale(recording, recording.outputs[static_cast<std::size_t>(i)],
                recording.outputs_um.col(i), recording.temps_K, found);
}

void check_noises(const RunFile& run, std::size_t index, Suspicions& found) {
  for (std::size_t i = 0; i < run.columns.size(); ++i)
    if (is_temperature(run.columns[i]) || is_output(run.columns[i]))
      check_noise(run, index, i, found);
}

void check_time_unit(const std::vector<RunFile>& runs, Suspicions& found) {
  constexpr double usual_K_per_h_max = 100.0;  // of a machine without heaters
  for (std::size_t index = 0; index < runs.size(); ++index) {
    const RunFile& run = runs[index];
    const bool is_contradicted = std::any_of(runs.begin(), runs.end(), [&](const RunFile& other) {
      return is_in_minutes_beside(run, other);
    });
    const double score = is_contradicted ? 10.0 : fast_K_per_h(run) / usual_K_per_h_max;
    if (score > 1.0)
      found.push_back(over_run("clock", "", index, run.time_s(), 60.0, "times", score));
  }
}

}  // namespace thermocomp::inspection
