#include "modelling/diagnosis/data/series.hpp"

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

/// Periods whose waves are turned side by side.
constexpr Eigen::Index lanes_max = 16;

/// Rows of a panel of which the first has been made.
struct Rows {
  double* first{nullptr};
  Eigen::Index stride{0};  ///< to the next row in time; negative: backwards
  Eigen::Index count{0};   ///< of those after the first
  [[nodiscard]] Rows from(Eigen::Index column) const { return {first + column, stride, count}; }
};

/// LowPass of each column, in place.
template <std::size_t lanes>
[[gnu::always_inline]] inline void low_pass_lanes(const double* shares, Rows rows) {
  std::array<double, lanes> state{};
  std::array<double, lanes> share{};
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    state[lane] = rows.first[lane];
    share[lane] = shares[lane];
  }
  double* row = rows.first;
  for (Eigen::Index i = 0; i < rows.count; ++i) {
    row += rows.stride;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      state[lane] += share[lane] * (row[lane] - state[lane]);
      row[lane] = state[lane];
    }
  }
}

THERMOCOMP_VECTORISED void low_pass(const double* shares, Rows rows, Eigen::Index columns) {
  side_by_side(
      columns, [&](auto lanes, Eigen::Index at) __attribute__((always_inline)) {
        low_pass_lanes<lanes()>(shares + at, rows.from(at));
      });
}

/// LowPass of one series in many columns.
/// @param values  of the first row on
/// @param less_values  1: the series itself is taken off
/// @param states  of the filters; taken on
template <std::size_t lanes>
[[gnu::always_inline]] inline void low_pass_of_lanes(const double* values, double less_values,
                                                     const double* shares, double* states,
                                                     Rows rows) {
  std::array<double, lanes> state{};
  std::array<double, lanes> share{};
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    state[lane] = states[lane];
    share[lane] = shares[lane];
  }
  double* row = rows.first;
  for (Eigen::Index i = 1; i <= rows.count; ++i) {
    row += rows.stride;
    const double value = values[i];
    const double taken_off = less_values * value;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      state[lane] += share[lane] * (value - state[lane]);
      row[lane] = state[lane] - taken_off;
    }
  }
  for (std::size_t lane = 0; lane < lanes; ++lane) states[lane] = state[lane];
}

THERMOCOMP_VECTORISED void low_pass_of(const double* values, double less_values,
                                       const double* shares, double* states, Rows rows,
                                       Eigen::Index columns) {
  side_by_side(
      columns, [&](auto lanes, Eigen::Index at) __attribute__((always_inline)) {
        low_pass_of_lanes<lanes()>(values, less_values, shares + at, states + at, rows.from(at));
      });
}

/// Calls `with(first, count, shares)` for stretches of rows of one step, first the row before.
/// @param ahead  1: from the first row to the last; -1: from the last to the first
template <class With>
void by_stretches(const Column& time_s, const std::vector<double>& taus_s, Eigen::Index ahead,
                  With with) {
  const Eigen::Index rows = time_s.size();
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
    with(place(begin - 1), i - begin, shares.data());
  }
}

void pass(const Column& time_s, const std::vector<double>& taus_s, PanelPart values,
          Eigen::Index ahead) {
  by_stretches(
      time_s, taus_s, ahead, [&](Eigen::Index first, Eigen::Index count, const double* shares) {
        low_pass(
            shares,
            {values.data() + first * values.outerStride(), ahead * values.outerStride(), count},
            values.cols());
      });
}

/// @param less_values  1: the series itself is taken off
void lag(const Column& time_s, const Column& values, double less_values,
         const std::vector<double>& taus_s, PanelPart into) {
  std::vector<double> states(taus_s.size(), values[0]);
  into.row(0).setConstant((1.0 - less_values) * values[0]);
  by_stretches(time_s, taus_s, 1,
               [&](Eigen::Index first, Eigen::Index count, const double* shares) {
                 low_pass_of(values.data() + first, less_values, shares, states.data(),
                             {into.data() + first * into.outerStride(), into.outerStride(), count},
                             into.cols());
               });
}

/// Play of one series in many columns, the series taken off, times the factor of each row.
template <std::size_t lanes>
[[gnu::always_inline]] inline void play_lanes(const double* values, const double* factors,
                                              const double* half_widths, double* row,
                                              Eigen::Index rows, Eigen::Index stride) {
  std::array<double, lanes> state{};
  std::array<double, lanes> half_width{};
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    state[lane] = values[0];
    half_width[lane] = half_widths[lane];
  }
  for (Eigen::Index i = 0; i < rows; ++i, row += stride) {
    const double value = values[i];
    const double factor = factors[i];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const double low = value - half_width[lane];
      const double high = value + half_width[lane];
      const double raised = state[lane] < low ? low : state[lane];
      state[lane] = raised > high ? high : raised;
      row[lane] = factor * (state[lane] - value);
    }
  }
}

THERMOCOMP_VECTORISED void play(const double* values, const double* factors,
                                const double* half_widths, double* row, Eigen::Index rows,
                                Eigen::Index columns, Eigen::Index stride) {
  side_by_side(
      columns, [&](auto lanes, Eigen::Index at) __attribute__((always_inline)) {
        play_lanes<lanes()>(values, factors, half_widths + at, row + at, rows, stride);
      });
}

/// LowPass backwards over rows of columns that went forwards, from there to their central
/// differences, times the factors of row and column. The last row has been made.
/// @param states  of the filters in the first of the rows, and one row later; taken on
template <std::size_t lanes>
[[gnu::always_inline]] inline void low_pass_slope_lanes(const double* shares, const double* of_rows,
                                                        const double* of_columns, double* states,
                                                        double* states_later, Rows rows) {
  std::array<double, lanes> state{};
  std::array<double, lanes> later{};
  std::array<double, lanes> share{};
  std::array<double, lanes> factor{};
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    state[lane] = states[lane];
    later[lane] = states_later[lane];
    share[lane] = shares[lane];
    factor[lane] = of_columns[lane];
  }
  double* row = rows.first;
  for (Eigen::Index i = 0; i < rows.count; ++i) {
    double* const before = row + rows.stride;
    const double of_row = of_rows[-i];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const double next = state[lane] + share[lane] * (before[lane] - state[lane]);
      row[lane] = of_row * factor[lane] * (later[lane] - next);
      later[lane] = state[lane];
      state[lane] = next;
    }
    row = before;
  }
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    states[lane] = state[lane];
    states_later[lane] = later[lane];
  }
}

THERMOCOMP_VECTORISED void low_pass_slope(const double* shares, const double* of_rows,
                                          const double* of_columns, double* states,
                                          double* states_later, Rows rows, Eigen::Index columns) {
  side_by_side(
      columns, [&](auto lanes, Eigen::Index at) __attribute__((always_inline)) {
        low_pass_slope_lanes<lanes()>(shares + at, of_rows, of_columns + at, states + at,
                                      states_later + at, rows.from(at));
      });
}

/// Sines and cosines of some periods.
struct Turn {
  std::array<double, lanes_max> sines{};
  std::array<double, lanes_max> cosines{};
};

/// Those of the rows after the first, each by the angle of a step; next to each other, those of a
/// period `apart` columns after those of the one before.
[[gnu::always_inline]] inline void turn_on_all(const Turn& step, const Turn& first, Rows rows,
                                               Eigen::Index apart, Eigen::Index count) {
  Turn at = first;
  double* row = rows.first;
  for (Eigen::Index i = 0; i < rows.count; ++i) {
    row += rows.stride;
    for (std::size_t lane = 0; lane < lanes_max; ++lane) {
      const double sine = at.sines[lane] * step.cosines[lane] + at.cosines[lane] * step.sines[lane];
      at.cosines[lane] = at.cosines[lane] * step.cosines[lane] - at.sines[lane] * step.sines[lane];
      at.sines[lane] = sine;
    }
    for (Eigen::Index lane = 0; lane < count; ++lane) {
      row[lane * apart] = at.sines[static_cast<std::size_t>(lane)];
      row[lane * apart + 1] = at.cosines[static_cast<std::size_t>(lane)];
    }
  }
}

THERMOCOMP_VECTORISED void turn_on(const Turn& step, const Turn& first, Rows rows,
                                   Eigen::Index apart, Eigen::Index count) {
  if (apart == 2 && count == lanes_max)
    turn_on_all(step, first, rows, 2, lanes_max);
  else
    turn_on_all(step, first, rows, apart, count);
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

void lag_each(const Column& time_s, const std::vector<double>& taus_s, PanelPart columns) {
  pass(time_s, taus_s, columns, 1);
}

void lagged(const Column& time_s, const Column& values, const std::vector<double>& taus_s,
            PanelPart into) {
  lag(time_s, values, 0.0, taus_s, into);
}

void lagged_less_values(const Column& time_s, const Column& values,
                        const std::vector<double>& taus_s, PanelPart into) {
  lag(time_s, values, 1.0, taus_s, into);
}

void played_less_values(const Column& values, const std::vector<double>& widths,
                        const Column& factors, PanelPart into) {
  std::vector<double> half_widths;
  half_widths.reserve(widths.size());
  for (const double width : widths) half_widths.push_back(0.5 * width);
  play(values.data(), factors.data(), half_widths.data(), into.data(), into.rows(), into.cols(),
       into.outerStride());
}

void waves(const Column& time_s, const std::vector<double>& periods_s, Eigen::Index apart,
           PanelPart into) {
  constexpr double turn = 6.283185307179586;
  const auto periods = std::ssize(periods_s);
  const auto since_s = [&](Eigen::Index row) { return time_s[row] - time_s[row - 1]; };
  for (Eigen::Index first = 0; first < periods; first += lanes_max) {
    const Eigen::Index count = std::min(lanes_max, periods - first);
    const auto turned_by = [&](double seconds) {
      Turn by;
      for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        const double phase = turn / periods_s[static_cast<std::size_t>(first) + i] * seconds;
        by.sines[i] = std::sin(phase);
        by.cosines[i] = std::cos(phase);
      }
      return by;
    };
    double step_s = 0.0;
    Turn step = turned_by(step_s);
    for (Eigen::Index row = 0; row < time_s.size();) {
      const Turn now = turned_by(time_s[row]);
      double* const to = into.data() + row * into.outerStride() + first * apart;
      for (Eigen::Index i = 0; i < count; ++i) {
        to[i * apart] = now.sines[static_cast<std::size_t>(i)];
        to[i * apart + 1] = now.cosines[static_cast<std::size_t>(i)];
      }
      const Eigen::Index end = std::min(row + turned_rows, time_s.size());
      Eigen::Index next = row + 1;
      if (next < end && std::abs(since_s(next) - step_s) > regular_s) {
        step_s = since_s(next);
        step = turned_by(step_s);
      }
      while (next < end && std::abs(since_s(next) - step_s) <= regular_s) ++next;
      turn_on(step, now, {to, into.outerStride(), next - row - 1}, apart, count);
      row = next;
    }
  }
}

void smoothed(const Column& time_s, const Column& values, const std::vector<double>& taus_s,
              PanelPart into) {
  lag(time_s, values, 0.0, taus_s, into);
  pass(time_s, taus_s, into, -1);
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
  Panel all(values.size(), std::ssize(taus_s));
  smoothed(time_s, values, taus_s, all);
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

void slopes(const Column& time_s, const Column& values, const std::vector<double>& taus_s,
            const Column& of_rows, const std::vector<double>& of_columns, PanelPart into) {
  if (values.size() < 2) {
    into.setZero();
    return;
  }
  const Eigen::Index last = values.size() - 1;
  lag(time_s, values, 0.0, taus_s, into);
  Column factors(values.size());
  for (Eigen::Index row = 0; row <= last; ++row)
    factors[row] = of_rows[row] /
                   (time_s[std::min(row + 1, last)] - time_s[std::max<Eigen::Index>(row - 1, 0)]);
  std::vector<double> states(into.row(last).begin(), into.row(last).end());
  std::vector<double> states_later = states;
  by_stretches(
      time_s, taus_s, -1, [&](Eigen::Index first, Eigen::Index count, const double* shares) {
        low_pass_slope(
            shares, factors.data() + first, of_columns.data(), states.data(), states_later.data(),
            {into.data() + first * into.outerStride(), -into.outerStride(), count}, into.cols());
      });
  for (Eigen::Index i = 0; i < into.cols(); ++i) {
    const auto column = static_cast<std::size_t>(i);
    into(0, i) = factors[0] * of_columns[column] * (states_later[column] - states[column]);
  }
}

}  // namespace thermocomp::diagnosis
