#include "modelling/diagnosis/hypothesis.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include "config/units.hpp"
#include "modelling/diagnosis/false_reading.hpp"
#include "modelling/diagnosis/place_groups.hpp"
#include "modelling/diagnosis/reading_fault.hpp"
#include "modelling/diagnosis/series.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr std::size_t blocks_wanted = 8;
constexpr double block_rows_min = 12;
constexpr double special_case_handicap = 20.0;
/// Whatever wanders resembles a ramp for the length of a run.
constexpr double clear_share_of_drift = 0.6;
/// A derivative is taken of readings smoothed with this share of the time constant that it is for.
constexpr double slope_smoothing = 0.25;

std::vector<double> logarithmic_grid(double low, double high, std::size_t count) {
  std::vector<double> grid;
  for (std::size_t i = 0; i < count; ++i)
    grid.push_back(low *
                   std::pow(high / low, static_cast<double>(i) / static_cast<double>(count - 1)));
  return grid;
}

std::vector<double> linear_grid(double low, double high, std::size_t count) {
  std::vector<double> grid;
  for (std::size_t i = 0; i < count; ++i)
    grid.push_back(low + (high - low) * static_cast<double>(i) / static_cast<double>(count - 1));
  return grid;
}

double median_step_s(const MeasuredData& data) {
  std::vector<double> steps;
  for (const MeasuredRun& run : data.runs)
    for (Eigen::Index row = run.begin + 1; row < run.rows(); ++row)
      steps.push_back(run.time_s[row] - run.time_s[row - 1]);
  if (steps.empty()) return 1.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

bool moves(const Column& column) {
  return column.size() > 1 && column.maxCoeff() > column.minCoeff();
}

/// Writes the catalogue for one set of data.
class Catalogue {
 public:
  Catalogue(const MeasuredData& data, const StackedRows& rows)
      : data_(data), rows_(rows), groups_(place_groups(data)) {
    step_s_ = median_step_s(data);
    for (const MeasuredRun& run : data.runs)
      length_s_ = std::max(length_s_, run.time_s[run.rows() - 1] - run.time_s[run.begin]);
    settled_um_per_K_.setZero(std::ssize(data.model.outputs), std::ssize(data.model.inputs));
    if (!data.model.guideways.empty()) return;
    for (std::size_t output = 0; output < data.model.outputs.size(); ++output)
      for (std::size_t input = 0; input < data.model.inputs.size(); ++input)
        settled_um_per_K_(static_cast<Eigen::Index>(output), static_cast<Eigen::Index>(input)) =
            settled_um_per_K(data, output, input);
  }

  std::vector<Hypothesis> all() {
    const std::size_t inputs = data_.model.inputs.size();
    found_.reserve(inputs * (inputs + 1) / 2 + 16 * inputs);  // most are exchanged channels
    for (std::size_t input = 0; input < data_.model.inputs.size(); ++input) add_input(input);
    for (std::size_t other = 0; other < data_.others.size(); ++other) add_other(other);
    for (std::size_t signal = 0; signal < data_.signals.size(); ++signal) add_signal(signal);
    for (std::size_t output = 0; output < data_.model.outputs.size(); ++output) add_output(output);
    for (std::size_t run = 0; run < data_.runs.size(); ++run) add_run_faults(run);
    return std::move(found_);
  }

 private:
  template <class Make>
  Column stacked(Make make) const {
    Column out(rows_.time_s.size());
    for (std::size_t i = 0; i < data_.runs.size(); ++i) {
      const Column& whole = make(data_.runs[i]);
      const Block& block = rows_.runs[i];
      out.segment(block.begin, block.end - block.begin) =
          whole.segment(data_.runs[i].begin, block.end - block.begin);
    }
    return out;
  }

  /// A column for each shape, made of whole runs.
  /// @param make  void(const MeasuredRun&, const std::vector<double>& firsts, PanelPart into), with
  ///        the first parameter of each shape
  template <class Make>
  void write_stacked(const Shapes& shapes, PanelPart into, Make make) const {
    std::vector<double> firsts;
    firsts.reserve(shapes.size());
    for (const Shape& shape : shapes) firsts.push_back(shape[0]);
    for (std::size_t i = 0; i < data_.runs.size(); ++i) {
      const MeasuredRun& run = data_.runs[i];
      PanelPart of_run = into.middleRows(rows_.runs[i].begin, run.rows() - run.begin);
      if (run.begin == 0) {
        make(run, firsts, of_run);
        continue;
      }
      Panel whole(run.rows(), into.cols());
      make(run, firsts, whole);
      of_run = whole.bottomRows(of_run.rows());
    }
  }

  /// Zero outside of one run.
  template <class Make>
  Column in_run(std::size_t run, Make make) const {
    Column out = Column::Zero(rows_.time_s.size());
    const Block& block = rows_.runs[run];
    out.segment(block.begin, block.end - block.begin) =
        make(data_.runs[run]).segment(data_.runs[run].begin, block.end - block.begin);
    return out;
  }

  /// For each shape what `make` gives from its first parameter on, a time of this run; else zero.
  template <class Make>
  void write_since(std::size_t run, const Shapes& shapes, PanelPart into, Make make) const {
    const Block& block = rows_.runs[run];
    const Column whole = make(data_.runs[run]);
    into.setZero();
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const double* const time_s = rows_.time_s.data();
      const Eigen::Index first =
          std::lower_bound(time_s + block.begin, time_s + block.end, shapes[i][0]) - time_s;
      into.col(static_cast<Eigen::Index>(i)).segment(first, block.end - first) =
          whole.tail(block.end - first);
    }
  }

  /// What the model misses of a reading with a fault in one run.
  void write_false_reading(const char* cause, std::size_t run, std::size_t input,
                           std::size_t output, const Shapes& shapes, PanelPart into) const {
    const MeasuredRun& of = data_.runs[run];
    Panel errors_K(of.rows(), std::ssize(shapes));
    for (std::size_t i = 0; i < shapes.size(); ++i)
      errors_K.col(static_cast<Eigen::Index>(i)) =
          error_of_reading(cause, data_, of, input, shapes[i][0]);
    answer_to_errors(data_, of, output, input, errors_K);
    const Block& block = rows_.runs[run];
    into.setZero();
    into.middleRows(block.begin, block.end - block.begin) =
        -errors_K.bottomRows(block.end - block.begin);
  }

  /// Of a reading that is late, in every run: it misses tau times its slope.
  void write_slow_reading(std::size_t input, const Shapes& shapes, std::size_t output,
                          PanelPart into) const {
    write_stacked(shapes, into,
                  [&](const MeasuredRun& run, const std::vector<double>& taus_s, PanelPart of_run) {
                    std::vector<double> spans_s;
                    spans_s.reserve(taus_s.size());
                    for (const double tau_s : taus_s) spans_s.push_back(slope_smoothing * tau_s);
                    Panel missed_K(run.rows(), std::ssize(taus_s));
                    slopes(run.time_s, run.inputs_K[input], spans_s, Column::Ones(run.rows()),
                           taus_s, missed_K);
                    answer_to_errors(data_, run, output, input, missed_K);
                    of_run = missed_K;
                  });
  }

  void write_exchanged(std::size_t input, std::size_t other, std::size_t output,
                       PanelPart into) const {
    for (std::size_t i = 0; i < data_.runs.size(); ++i) {
      const MeasuredRun& run = data_.runs[i];
      const Block& block = rows_.runs[i];
      Panel of_input = run.calm_inputs_K[other] - run.calm_inputs_K[input];
      Panel of_other = -of_input;
      answer_to_errors(data_, run, output, input, of_input);
      answer_to_errors(data_, run, output, other, of_other);
      into.middleRows(block.begin, block.end - block.begin) =
          (of_input + of_other).bottomRows(block.end - block.begin);
    }
  }

  [[nodiscard]] bool moves_anywhere(
      const std::function<const Column&(const MeasuredRun&)>& of) const {
    return std::any_of(data_.runs.begin(), data_.runs.end(), [&](const MeasuredRun& run) {
      return moves(of(run).tail(run.rows() - run.begin));
    });
  }

  [[nodiscard]] ShapeParameter lag_times(double low_s, double high_s, std::size_t count) const {
    const double low = std::max(low_s, 0.5 * step_s_);
    const double high = std::max(2.0 * low, std::min(high_s, 0.5 * length_s_));
    return {"tau_s", logarithmic_grid(low, high, count), true, false};
  }

  Hypothesis& add(Hypothesis hypothesis) {
    hypothesis.rows = rows_.time_s.size();
    found_.push_back(std::move(hypothesis));
    return found_.back();
  }

  void add_input(std::size_t input);
  void add_reading_errors(std::size_t input);
  void add_swaps(std::size_t input);
  void add_positions(const std::string& name,
                     const std::function<const Column&(const MeasuredRun&)>& rise_K);
  void add_square(const std::string& name,
                  const std::function<const Column&(const MeasuredRun&)>& rise_K);
  void add_other(std::size_t other);
  void add_signal(std::size_t signal);
  void add_output(std::size_t output);
  void add_period(std::size_t output);
  void add_run_faults(std::size_t run);
  void add_displacement_faults(std::size_t run, std::size_t output);
  void add_sensor_faults(std::size_t run, std::size_t input);
  void share_columns(Hypothesis& fault, std::size_t input) const;
  [[nodiscard]] ShapeParameter onsets(std::size_t run, const char* name, double first, double last,
                                      std::size_t count) const;

  const MeasuredData& data_;
  const StackedRows rows_;
  const PlaceGroups groups_;
  Eigen::MatrixXd settled_um_per_K_;  ///< shape (outputs, inputs); without guideways
  double step_s_{1.0};
  double length_s_{0.0};
  std::vector<Hypothesis> found_;
};

void Catalogue::add_input(std::size_t input) {
  const std::string& name = data_.model.inputs[input];
  const auto rise_K = [input](const MeasuredRun& run) -> const Column& {
    return run.calm_inputs_K[input];
  };
  if (!moves_anywhere(rise_K)) return;
  add({"wrong_coefficient", name, Form::own_gains, {}, {"delta_um_per_K"}}).write_columns =
      one_by_one([this, rise_K](const Shape&, std::size_t) { return stacked(rise_K); });
  Hypothesis& lag = add(
      {"thermal_lag", name, Form::own_gains, {lag_times(60.0, 4 * 3600.0, 20)}, {"gain_um_per_K"}});
  lag.write_columns = [this, rise_K](const Shapes& shapes, std::size_t, PanelPart into) {
    write_stacked(shapes, into,
                  [&](const MeasuredRun& run, const std::vector<double>& taus_s, PanelPart of_run) {
                    lagged_less_values(run.time_s, rise_K(run), taus_s, of_run);
                  });
  };
  if (data_.model.guideways.empty()) {
    // Of places that move alike a fit settles the sum, hardly each coefficient.
    Eigen::VectorXd of_group_um_per_K = Eigen::VectorXd::Zero(settled_um_per_K_.rows());
    for (std::size_t other = 0; other < data_.model.inputs.size(); ++other)
      if (same_places(groups_, name, data_.model.inputs[other]))
        of_group_um_per_K += settled_um_per_K_.col(static_cast<Eigen::Index>(other));
    lag.possible = [this, input, of_group_um_per_K](double gain, std::size_t output) {
      const auto row = static_cast<Eigen::Index>(output);
      const double own = gain / settled_um_per_K_(row, static_cast<Eigen::Index>(input));
      const double of_group = gain / of_group_um_per_K[row];
      return (own > 0.0 && own <= 1.1) || (of_group > 0.0 && of_group <= 1.1);
    };
  }
  add_square(name, rise_K);
  add_positions(name, rise_K);
  add_reading_errors(input);
  add_swaps(input);
}

void Catalogue::add_reading_errors(std::size_t input) {
  const std::string& name = data_.model.inputs[input];
  Hypothesis& slow = add({"slow_sensor", name, Form::no_gain, {lag_times(20.0, 3600.0, 16)}});
  slow.in_every_output = true;
  if (has_terms_of(data_.model, input)) {
    slow.write_columns = [this, input](const Shapes& shapes, std::size_t output, PanelPart into) {
      write_slow_reading(input, shapes, output, into);
    };
  } else {
    slow.write_columns = [this, input](const Shapes& shapes, std::size_t output, PanelPart into) {
      write_stacked(
          shapes, into,
          [&](const MeasuredRun& run, const std::vector<double>& taus_s, PanelPart of_run) {
            std::vector<double> spans_s;
            spans_s.reserve(taus_s.size());
            for (const double tau_s : taus_s) spans_s.push_back(slope_smoothing * tau_s);
            slopes(run.time_s, run.inputs_K[input], spans_s, data_.coefficient(run, output, input),
                   taus_s, of_run);
          });
    };
  }
  double range_K = 0.0;
  for (const MeasuredRun& run : data_.runs) {
    const Column& rise_K = run.inputs_K[input];
    range_K = std::max(range_K, rise_K.maxCoeff() - rise_K.minCoeff());
  }
  Hypothesis& play = add({"hysteresis",
                          name,
                          Form::no_gain,
                          {{"width_K", linear_grid(0.04 * range_K, 0.8 * range_K, 16)}}});
  play.in_every_output = true;
  play.write_columns = [this, input](const Shapes& shapes, std::size_t output, PanelPart into) {
    write_stacked(
        shapes, into,
        [&](const MeasuredRun& run, const std::vector<double>& widths_K, PanelPart of_run) {
          Panel missed_K(run.rows(), std::ssize(widths_K));
          played_less_values(run.calm_inputs_K[input], widths_K, Column::Ones(run.rows()),
                             missed_K);
          answer_to_errors(data_, run, output, input, missed_K);
          of_run = missed_K;
        });
  };
}

void Catalogue::add_swaps(std::size_t input) {
  for (std::size_t other = 0; other < data_.model.inputs.size(); ++other) {
    const auto& names = data_.model.inputs;
    if (!(names[input] < names[other])) continue;
    Hypothesis& swap = add({"sensor_swap", names[input] + "|" + names[other], Form::no_gain});
    swap.in_every_output = true;
    const bool linear_terms = has_terms_of(data_.model, input) || has_terms_of(data_.model, other);
    if (data_.model.guideways.empty() && !linear_terms)
      swap.of_readings = [this, input, other](std::size_t output) {
        const auto& coefficients = data_.model.matrix_um_per_K[output];
        const double weight = coefficients[input] - coefficients[other];
        return std::vector<ReadingShare>{{other, weight}, {input, -weight}};
      };
    if (linear_terms) {
      swap.write_columns = [this, input, other](const Shapes&, std::size_t output, PanelPart into) {
        write_exchanged(input, other, output, into);
      };
      continue;
    }
    swap.write_columns = [this, input, other](const Shapes&, std::size_t output, PanelPart into) {
      for (std::size_t i = 0; i < data_.runs.size(); ++i) {
        const MeasuredRun& run = data_.runs[i];
        const Block& block = rows_.runs[i];
        const Eigen::Index count = block.end - block.begin;
        into.col(0).segment(block.begin, count) =
            (data_.coefficient(run, output, input) - data_.coefficient(run, output, other))
                .cwiseProduct(run.calm_inputs_K[other] - run.calm_inputs_K[input])
                .tail(count);
      }
    };
  }
}

void Catalogue::add_square(const std::string& name,
                           const std::function<const Column&(const MeasuredRun&)>& rise_K) {
  add({"nonlinear_expansion", name, Form::own_gains, {}, {"gain_um_per_K2"}}).write_columns =
      one_by_one([this, rise_K](const Shape&, std::size_t) {
        return stacked(
            [&](const MeasuredRun& run) -> Column { return rise_K(run).array().square(); });
      });
}

void Catalogue::add_positions(const std::string& name,
                              const std::function<const Column&(const MeasuredRun&)>& rise_K) {
  for (std::size_t signal = 0; signal < data_.signals.size(); ++signal) {
    const std::string& position = data_.signals[signal];
    if (kind_of(position) != QuantityKind::position) continue;
    if (!moves_anywhere(
            [signal](const MeasuredRun& run) -> const Column& { return run.signals[signal]; }))
      continue;
    const std::string subject = std::min(name, position) + "|" + std::max(name, position);
    Hypothesis& along =
        add({"position_dependence", subject, Form::own_gains, {}, {"gain_um_per_K_mm", "p0_mm"}});
    along.handicap = special_case_handicap;  // without the position: a coefficient
    along.write_columns = one_by_one([this, rise_K, signal](const Shape&, std::size_t) {
      Eigen::MatrixXd both(rows_.time_s.size(), 2);
      both.col(0) = stacked([&](const MeasuredRun& run) -> Column {
        return run.signals[signal].cwiseProduct(rise_K(run));
      });
      both.col(1) = stacked(rise_K);
      return both;
    });
  }
}

void Catalogue::add_other(std::size_t other) {
  const std::string& name = data_.others[other];
  const auto rise_K = [other](const MeasuredRun& run) -> const Column& {
    return run.calm_others_K[other];
  };
  if (!moves_anywhere(rise_K)) return;
  ShapeParameter lag = lag_times(60.0, 6 * 3600.0, 20);
  lag.grid.insert(lag.grid.begin(), 0.0);
  add({"missing_temperature", name, Form::own_gains, {lag}, {"gain_um_per_K"}}).write_columns =
      [this, rise_K](const Shapes& shapes, std::size_t, PanelPart into) {
        write_stacked(shapes, into,
                      [&](const MeasuredRun& run, const std::vector<double>& taus_s,
                          PanelPart of_run) { lagged(run.time_s, rise_K(run), taus_s, of_run); });
      };
  add_square(name, rise_K);
  add_positions(name, rise_K);
}

void Catalogue::add_signal(std::size_t signal) {
  const std::string& name = data_.signals[signal];
  const auto values = [signal](const MeasuredRun& run) -> const Column& {
    return run.signals[signal];
  };
  if (kind_of(name) != QuantityKind::signal || !moves_anywhere(values)) return;
  const ShapeParameter power{"power", {1.0, 2.0}, false, true};
  Hypothesis& heat = add({"missing_heat_source",
                          name,
                          Form::own_gains,
                          {lag_times(120.0, 6 * 3600.0, 22), power},
                          {"gain_um_per_unit"}});
  heat.write_columns = [this, values](const Shapes& shapes, std::size_t, PanelPart into) {
    Eigen::Array<bool, Eigen::Dynamic, 1> is_squared(into.cols());
    for (std::size_t i = 0; i < shapes.size(); ++i)
      is_squared[static_cast<Eigen::Index>(i)] = shapes[i][1] > 1.5;
    write_stacked(shapes, into,
                  [&](const MeasuredRun& run, const std::vector<double>& taus_s, PanelPart of_run) {
                    const Column& u = values(run);
                    for (Eigen::Index row = 0; row < of_run.rows(); ++row)
                      for (Eigen::Index i = 0; i < of_run.cols(); ++i)
                        of_run(row, i) = is_squared[i] ? u[row] * u[row] : u[row];
                    lag_each(run.time_s, taus_s, of_run);
                  });
  };
  const auto unit = unit_of(name).suffix;
  if (unit != "_rpm" && unit != "_mm_per_min" && !unit.empty()) return;
  add({"speed_growth", name, Form::own_gains, {}, {"gain_um_per_unit2"}}).write_columns =
      one_by_one([this, values](const Shape&, std::size_t) {
        return stacked(
            [&](const MeasuredRun& run) -> Column { return values(run).array().square(); });
      });
}

void Catalogue::add_output(std::size_t output) {
  const std::string& name = data_.model.outputs[output];
  const auto model_um = [output](const MeasuredRun& run) -> const Column& {
    return run.model_um[output];
  };
  double range_um = 0.0;
  for (const MeasuredRun& run : data_.runs)
    range_um = std::max(range_um, model_um(run).maxCoeff() - model_um(run).minCoeff());
  if (range_um > 0) {
    Hypothesis& play = add({"hysteresis",
                            name,
                            Form::no_gain,
                            {{"width_um", linear_grid(0.03 * range_um, 0.7 * range_um, 20)}}});
    play.output = output;
    play.write_columns = [this, model_um](const Shapes& shapes, std::size_t, PanelPart into) {
      write_stacked(
          shapes, into,
          [&](const MeasuredRun& run, const std::vector<double>& widths_um, PanelPart of_run) {
            played_less_values(calm(run.time_s, model_um(run)), widths_um, Column::Ones(run.rows()),
                               of_run);
          });
    };
    std::vector<double> shifts = logarithmic_grid(std::max(5.0, 0.2 * step_s_), 3600.0, 14);
    for (std::size_t i = 0, count = shifts.size(); i < count; ++i)
      shifts.insert(shifts.begin(), -shifts[2 * i]);
    Hypothesis& shift = add({"time_shift", name, Form::no_gain, {{"shift_s", shifts}}});
    shift.output = output;
    shift.write_columns = [this, model_um](const Shapes& shapes, std::size_t, PanelPart into) {
      write_stacked(
          shapes, into,
          [&](const MeasuredRun& run, const std::vector<double>& shifts_s, PanelPart of_run) {
            // Interpolation averages two rows; both sides are smoothed, so that less noise is no
            // gain.
            Panel smooth(run.rows(), 1);
            smoothed(run.time_s, model_um(run), {2.0 * step_s_}, smooth);
            const Column smooth_um = smooth.col(0);
            for (std::size_t i = 0; i < shapes.size(); ++i)
              of_run.col(static_cast<Eigen::Index>(i)) =
                  shifted(run.time_s, smooth_um, shifts_s[i]) - smooth_um;
          });
    };
  }
  add_period(output);
}

void Catalogue::add_period(std::size_t output) {
  // At least five whole periods in the longest run; the grid is fine enough that a neighbour of the
  // true period is at most a fifth of a turn off at the run's end.
  const double longest_s = length_s_ / 5.0;
  const double shortest_s = 5.0 * step_s_;
  if (!(longest_s > 2.0 * shortest_s)) return;
  std::vector<double> periods;
  for (double frequency = 1.0 / longest_s; frequency <= 1.0 / shortest_s && periods.size() < 400;
       frequency += std::max(0.4 / length_s_, 0.004 * frequency))
    periods.push_back(1.0 / frequency);
  std::vector<std::string> gains;
  for (std::size_t run = 0; run < data_.runs.size(); ++run)
    gains.insert(gains.end(), {"sine_um", "cosine_um"});
  Hypothesis& period = add({"periodic_disturbance",
                            data_.model.outputs[output],
                            Form::own_gains,
                            {{"period_s", periods, true, false}},
                            gains});
  period.output = output;
  period.write_columns = [this](const Shapes& shapes, std::size_t, PanelPart into) {
    std::vector<double> periods_s;
    for (const Shape& shape : shapes) periods_s.push_back(shape[0]);
    const Eigen::Index apart = into.cols() / std::ssize(shapes);
    if (data_.runs.size() > 1) into.setZero();
    for (std::size_t run = 0; run < data_.runs.size(); ++run) {
      const Block& block = rows_.runs[run];
      const Eigen::Index count = block.end - block.begin;
      const Eigen::Index first = 2 * static_cast<Eigen::Index>(run);
      waves(rows_.time_s.segment(block.begin, count), periods_s, apart,
            into.block(block.begin, first, count, into.cols() - first));
    }
  };
}

ShapeParameter Catalogue::onsets(std::size_t run, const char* name, double first, double last,
                                 std::size_t count) const {
  const MeasuredRun& of = data_.runs[run];
  const double begin_s = of.time_s[of.begin];
  const double span_s = of.time_s[of.rows() - 1] - begin_s;
  return {name, linear_grid(begin_s + first * span_s, begin_s + last * span_s, count)};
}

void Catalogue::add_run_faults(std::size_t run) {
  const Block& rows = rows_.runs[run];
  if (static_cast<double>(rows.end - rows.begin) < 2 * block_rows_min) return;
  for (std::size_t output = 0; output < data_.model.outputs.size(); ++output)
    add_displacement_faults(run, output);
  for (std::size_t input = 0; input < data_.model.inputs.size(); ++input)
    add_sensor_faults(run, input);
}

void Catalogue::add_displacement_faults(std::size_t run, std::size_t output) {
  const std::string& name = data_.model.outputs[output];
  Hypothesis& step = add({"displacement_step",
                          name,
                          Form::own_gains,
                          {onsets(run, "at_s", 0.02, 0.98, 64)},
                          {"step_um"},
                          output,
                          run});
  step.write_columns = [this, run](const Shapes& shapes, std::size_t, PanelPart into) {
    write_since(run, shapes, into,
                [](const MeasuredRun& of) -> Column { return Column::Ones(of.rows()); });
  };
  Hypothesis& drift =
      add({"displacement_drift", name, Form::own_gains, {}, {"rate_um_per_h"}, output, run});
  drift.clear_share = clear_share_of_drift;
  drift.write_columns = one_by_one([this, run](const Shape&, std::size_t) {
    return in_run(run, [&](const MeasuredRun& of) -> Column {
      return (of.time_s.array() - of.time_s[of.begin]) / 3600.0;
    });
  });
}

/// A fault that is alike at every sensor of a run acts through the sensor's coefficient alone.
void Catalogue::share_columns(Hypothesis& fault, std::size_t input) const {
  // With guideways the coefficient changes from row to row, terms answer late.
  if (!data_.model.guideways.empty() || has_terms_of(data_.model, input)) return;
  fault.pattern = fault.cause + std::to_string(*fault.run);
  fault.scale = [this, input](std::size_t output) {
    return -data_.model.matrix_um_per_K[output][input];
  };
}

void Catalogue::add_sensor_faults(std::size_t run, std::size_t input) {
  const std::string& name = data_.model.inputs[input];
  const auto fault = [&](const char* cause, const char* onset, const char* gain, double first,
                         std::size_t count) -> Hypothesis& {
    Hypothesis& added =
        add({cause, name, Form::shared_gain, {onsets(run, onset, first, 0.95, count)}, {gain}});
    added.run = run;
    added.sensor = input;
    added.handicap = special_case_handicap;  // from the run's start on: a fault of the datum
    added.in_every_output = true;
    added.write_columns = [this, cause, run, input](const Shapes& shapes, std::size_t output,
                                                    PanelPart into) {
      write_false_reading(cause, run, input, output, shapes, into);
    };
    return added;
  };
  // Where the reading has no more than a coefficient, many of these share one column.
  const bool coefficient_alone = !has_terms_of(data_.model, input);
  Hypothesis& step = fault("sensor_step", "at_s", "step_K", 0.02, 64);
  if (coefficient_alone)
    step.write_columns = [this, run, input](const Shapes& shapes, std::size_t output,
                                            PanelPart into) {
      write_since(run, shapes, into, [&](const MeasuredRun& of) -> Column {
        return -data_.coefficient(of, output, input);
      });
    };
  share_columns(step, input);
  share_columns(fault("sensor_drift", "start_s", "rate_K_per_h", 0.0, 24), input);
  if (room_among(data_.model.inputs) == name) return;
  Hypothesis& loose = fault("sensor_loose", "at_s", "gain", 0.03, 48);
  loose.possible = [](double lost, std::size_t) { return lost > 0.02 && lost < 20.0; };
  if (!coefficient_alone) return;
  const auto whole = [this, input](const MeasuredRun& of, std::size_t output) -> Column {
    const Column lost_K = error_of_reading("sensor_loose", data_, of, input, of.time_s[0]);
    return -data_.coefficient(of, output, input).cwiseProduct(lost_K);
  };
  loose.write_columns = [this, run, whole](const Shapes& shapes, std::size_t output,
                                           PanelPart into) {
    write_since(run, shapes, into, [&](const MeasuredRun& of) { return whole(of, output); });
  };
  loose.from_onset = [this, run, whole](std::size_t output) {
    return in_run(run, [&](const MeasuredRun& of) { return whole(of, output); });
  };
}

}  // namespace

Shapes grid_of(const Hypothesis& hypothesis) {
  std::size_t points = 1;
  for (const ShapeParameter& parameter : hypothesis.shape) points *= parameter.grid.size();
  Shapes all;
  all.reserve(points);
  for (std::size_t i = 0; i < points; ++i) all.push_back(point_of_grid(hypothesis, i));
  return all;
}

Shape point_of_grid(const Hypothesis& hypothesis, std::size_t index) {
  Shape point(hypothesis.shape.size());
  for (std::size_t i = point.size(); i-- > 0;) {
    const std::vector<double>& grid = hypothesis.shape[i].grid;
    point[i] = grid[index % grid.size()];
    index /= grid.size();
  }
  return point;
}

StackedRows stacked_rows(const MeasuredData& data) {
  StackedRows rows;
  Eigen::Index total = 0;
  for (const MeasuredRun& run : data.runs) total += run.rows() - run.begin;
  rows.time_s.resize(total);
  Eigen::Index at = 0;
  const double block_rows =
      std::max(block_rows_min, static_cast<double>(total) / static_cast<double>(blocks_wanted));
  for (const MeasuredRun& run : data.runs) {
    const Eigen::Index count = run.rows() - run.begin;
    rows.time_s.segment(at, count) = run.time_s.tail(count);
    rows.runs.push_back({at, at + count});
    const auto parts = std::max<Eigen::Index>(
        1, static_cast<Eigen::Index>(std::lround(static_cast<double>(count) / block_rows)));
    for (Eigen::Index part = 0; part < parts; ++part)
      rows.blocks.push_back({at + count * part / parts, at + count * (part + 1) / parts});
    at += count;
  }
  return rows;
}

std::vector<Hypothesis> hypotheses(const MeasuredData& data, const StackedRows& rows) {
  // The hypotheses keep the writer, which knows the rows, alive.
  const auto catalogue = std::make_shared<Catalogue>(data, rows);
  std::vector<Hypothesis> all = catalogue->all();
  for (Hypothesis& hypothesis : all)
    hypothesis.write_columns = [catalogue, write = std::move(hypothesis.write_columns)](
                                   const Shapes& shapes, std::size_t output, PanelPart into) {
      write(shapes, output, into);
    };
  return all;
}

}  // namespace thermocomp::diagnosis
