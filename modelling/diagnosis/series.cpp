#include "modelling/diagnosis/series.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace thermocomp::diagnosis {
namespace {

/// Steps in time that differ by less are one.
constexpr double regular_s = 1e-9;
/// Waves are turned on by the angle of a step from row to row, and set anew so often: that keeps
/// their phases right to rounding.
constexpr Eigen::Index turned_rows = 64;

/// Sines and cosines of the next row, by the angle of a step.
THERMOCOMP_VECTORISED void turn_on(const double* __restrict sines_of_step,
                                   const double* __restrict cosines_of_step,
                                   const double* __restrict sines, const double* __restrict cosines,
                                   Eigen::Index count, double* __restrict next_sines,
                                   double* __restrict next_cosines) {
  for (Eigen::Index i = 0; i < count; ++i) {
    next_sines[i] = sines[i] * cosines_of_step[i] + cosines[i] * sines_of_step[i];
    next_cosines[i] = cosines[i] * cosines_of_step[i] - sines[i] * sines_of_step[i];
  }
}

Panel beside_each_other(const Column& values, std::size_t times) {
  return values.replicate(1, static_cast<Eigen::Index>(times));
}

/// Neighbouring columns through LowPass, whose recursions run side by side; the row before the
/// first one is done.
/// @param stride  from a row to the next one in time: columns, or -columns for backwards
template <std::size_t lanes>
[[gnu::always_inline]] inline void low_pass_lanes(const double* shares, double* row,
                                                  Eigen::Index rows, Eigen::Index stride) {
  std::array<double, lanes> state{};
  std::array<double, lanes> share{};
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    state[lane] = (row - stride)[lane];
    share[lane] = shares[lane];
  }
  for (Eigen::Index i = 0; i < rows; ++i, row += stride)
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      state[lane] += share[lane] * (row[lane] - state[lane]);
      row[lane] = state[lane];
    }
}

THERMOCOMP_VECTORISED void low_pass(const double* shares, double* row, Eigen::Index rows,
                                    Eigen::Index columns, Eigen::Index stride) {
  Eigen::Index at = 0;
  for (; at + 16 <= columns; at += 16) low_pass_lanes<16>(shares + at, row + at, rows, stride);
  for (; at + 4 <= columns; at += 4) low_pass_lanes<4>(shares + at, row + at, rows, stride);
  for (; at < columns; ++at) low_pass_lanes<1>(shares + at, row + at, rows, stride);
}

/// @param ahead  1: from the first row to the last; -1: from the last to the first
void pass(const Column& time_s, const std::vector<double>& taus_s, Panel& values,
          Eigen::Index ahead) {
  const Eigen::Index rows = values.rows();
  const auto place = [&](Eigen::Index i) { return ahead > 0 ? i : rows - 1 - i; };
  const auto step_s = [&](Eigen::Index i) {
    return std::abs(time_s[place(i)] - time_s[place(i - 1)]);
  };
  std::vector<double> shares(taus_s.size());
  for (Eigen::Index i = 1; i < rows;) {
    const double step = step_s(i);
    const Eigen::Index begin = i;
    while (i < rows && std::abs(step_s(i) - step) <= regular_s) ++i;
    for (std::size_t column = 0; column < taus_s.size(); ++column)
      shares[column] = -std::expm1(-step / taus_s[column]);
    low_pass(shares.data(), values.data() + place(begin) * values.cols(), i - begin, values.cols(),
             ahead * values.cols());
  }
}

/// Neighbouring columns through Play.
template <std::size_t lanes>
[[gnu::always_inline]] inline void play_lanes(const double* half_widths, double* row,
                                              Eigen::Index rows, Eigen::Index columns) {
  std::array<double, lanes> state{};
  std::array<double, lanes> half_width{};
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    state[lane] = row[lane];
    half_width[lane] = half_widths[lane];
  }
  for (Eigen::Index i = 0; i < rows; ++i, row += columns)
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const double low = row[lane] - half_width[lane];
      const double high = row[lane] + half_width[lane];
      const double raised = state[lane] < low ? low : state[lane];
      state[lane] = raised > high ? high : raised;
      row[lane] = state[lane];
    }
}

THERMOCOMP_VECTORISED void play(const double* half_widths, double* row, Eigen::Index rows,
                                Eigen::Index columns) {
  Eigen::Index at = 0;
  for (; at + 16 <= columns; at += 16) play_lanes<16>(half_widths + at, row + at, rows, columns);
  for (; at + 4 <= columns; at += 4) play_lanes<4>(half_widths + at, row + at, rows, columns);
  for (; at < columns; ++at) play_lanes<1>(half_widths + at, row + at, rows, columns);
}

}  // namespace

Column shifted(const Column& time_s, const Column& values, double shift_s) {
  Column out(values.size());
  Eigen::Index row = 0;
  const Eigen::Index last = values.size() - 1;
  for (Eigen::Index i = 0; i <= last; ++i) {
    const double t = time_s[i] - shift_s;
    while (row > 0 && time_s[row] > t) --row;
    while (row < last && time_s[row + 1] <= t) ++row;
    if (row == last || t <= time_s[row]) {
      out[i] = values[row];
      continue;
    }
    const double share = (t - time_s[row]) / (time_s[row + 1] - time_s[row]);
    out[i] = values[row] + share * (values[row + 1] - values[row]);
  }
  return out;
}

void lag_each(const Column& time_s, const std::vector<double>& taus_s, Panel& columns) {
  pass(time_s, taus_s, columns, 1);
}

Panel lagged(const Column& time_s, const Column& values, const std::vector<double>& taus_s) {
  Panel out = beside_each_other(values, taus_s.size());
  pass(time_s, taus_s, out, 1);
  return out;
}

Panel played(const Column& values, const std::vector<double>& widths) {
  Panel out = beside_each_other(values, widths.size());
  std::vector<double> half_widths;
  half_widths.reserve(widths.size());
  for (const double width : widths) half_widths.push_back(0.5 * width);
  play(half_widths.data(), out.data(), out.rows(), out.cols());
  return out;
}

Waves waves(const Column& time_s, const std::vector<double>& periods_s) {
  constexpr double turn = 6.283185307179586;
  const auto count = std::ssize(periods_s);
  Waves all{Panel(time_s.size(), count), Panel(time_s.size(), count)};
  const auto set = [&](double time, double* sines, double* cosines) {
    for (std::size_t i = 0; i < periods_s.size(); ++i) {
      const double phase = turn / periods_s[i] * time;
      sines[i] = std::sin(phase);
      cosines[i] = std::cos(phase);
    }
  };
  std::vector<double> sines_of_step(periods_s.size());
  std::vector<double> cosines_of_step(periods_s.size());
  double step_s = 0.0;
  for (Eigen::Index row = 0; row < time_s.size(); ++row) {
    const double since_s = row > 0 ? time_s[row] - time_s[row - 1] : 0.0;
    const bool regular = std::abs(since_s - step_s) <= regular_s;
    if (row % turned_rows == 0 || !regular)
      set(time_s[row], &all.sines(row, 0), &all.cosines(row, 0));
    else
      turn_on(sines_of_step.data(), cosines_of_step.data(), &all.sines(row - 1, 0),
              &all.cosines(row - 1, 0), count, &all.sines(row, 0), &all.cosines(row, 0));
    if (regular) continue;
    step_s = since_s;
    set(step_s, sines_of_step.data(), cosines_of_step.data());
  }
  return all;
}

Panel smoothed(const Column& time_s, const Column& values, const std::vector<double>& taus_s) {
  Panel out = lagged(time_s, values, taus_s);
  pass(time_s, taus_s, out, -1);
  return out;
}

Column calm(const Column& time_s, const Column& values) {
  const Eigen::Index last = values.size() - 1;
  Column best = values;
  if (last < 8) return best;
  // Without smoothing a row is predicted from its two neighbours.
  double least = 0.0;
  for (Eigen::Index row = 1; row < last; ++row)
    least += std::pow(values[row] - 0.5 * (values[row - 1] + values[row + 1]), 2);
  const double step_s = (time_s[last] - time_s[0]) / static_cast<double>(last);
  const std::vector<double> spans_rows = {1.0, 2.0, 4.0, 8.0};
  std::vector<double> taus_s;
  taus_s.reserve(spans_rows.size());
  for (const double rows : spans_rows) taus_s.push_back(rows * step_s);
  const Panel all = smoothed(time_s, values, taus_s);
  for (std::size_t i = 0; i < spans_rows.size(); ++i) {
    const double rows = spans_rows[i];
    const Column smooth = all.col(static_cast<Eigen::Index>(i));
    // Weight of a value in its own smoothed one.
    const double share = -std::expm1(-1.0 / rows);
    const double own = share / (2.0 - share);
    const double left = ((values - smooth) / (1.0 - own)).segment(1, last - 1).squaredNorm();
    if (!(left < least)) continue;
    least = left;
    best = smooth;
  }
  return best;
}

Panel slopes_per_s(const Column& time_s, const Column& values, const std::vector<double>& taus_s) {
  const Panel smooth = smoothed(time_s, values, taus_s);
  const Eigen::Index last = values.size() - 1;
  Panel slopes = Panel::Zero(smooth.rows(), smooth.cols());
  for (Eigen::Index row = 0; row <= last && last > 0; ++row) {
    const Eigen::Index low = std::max<Eigen::Index>(0, row - 1);
    const Eigen::Index high = std::min(last, row + 1);
    slopes.row(row) = (smooth.row(high) - smooth.row(low)) / (time_s[high] - time_s[low]);
  }
  return slopes;
}

}  // namespace thermocomp::diagnosis
