#include "modelling/identification/families/bank_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <Eigen/Cholesky>

#include "estimator/model/terms/low_pass.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::identification {
namespace {

constexpr std::size_t columns_max = 600;
constexpr double shortest_s = 300.0;
constexpr double ratio = 3.0;
constexpr std::size_t lags_max = 6;
constexpr int hinges_a_signal = 8;
constexpr std::size_t values_of_a_switch_max = 6;
/// Scale of a hinge: half of the other columns', since only the recording supports it.
constexpr double weight_of_hinge = 0.5;
/// Scale of a lag: of two columns that explain the same, the undelayed one is preferred.
constexpr double weight_of_lag = 0.7;
/// Share of the places' RMS deviation added in quadrature to each place's own before scaling it to
/// 1, so that a place that hardly moved is not amplified.
constexpr double usual_share = 0.05;
/// The same for a signal's columns, as a share of its deviation in all rows: in the rows with a
/// probing it may hardly move.
constexpr double usual_share_of_signal = 0.01;
/// Penalties for columns of standard deviation 1: ridge_penalty is added to their mean square,
/// l1_price is subtracted from their correlation with the output. Both, weight_of_lag and
/// usual_share were set on spindle, printer, one telescope, one cell and one probe; the other
/// measured machines were reserved for validation (docs/measurements.md).
constexpr double ridge_penalty = 3e-4;
constexpr double l1_price = 1.5e-3;
/// Improvement by a further column, as a share of l1_price, that counts as rounding.
constexpr double l1_tolerance = 1e-6;
/// Iteration limit in case of rounding; usually less than one join per column.
constexpr Eigen::Index joins_a_column_max = 10;

/// True if the signal has two levels, such as on and off, which show no curvature of the response.
/// A measured level may scatter by a tenth of their distance.
bool has_two_levels(const MeasuredTests& tests, Eigen::Index signal) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const TestRun& run : tests.runs) {
    low = std::min(low, run.signals.col(signal).minCoeff());
    high = std::max(high, run.signals.col(signal).maxCoeff());
  }
  const double noise = 0.1 * (high - low);
  return std::all_of(tests.runs.begin(), tests.runs.end(), [&](const TestRun& run) {
    const auto column = run.signals.col(signal).array();
    return (column <= low + noise || column >= high - noise).all();
  });
}

/// Exact minimum of 1/2 w'Aw - c'w + price |w|_1, independent of the order of the columns in a
/// file: the column with the largest gradient joins, and leaves if its sign would change (Lee et
/// al., Efficient sparse coding algorithms, 2007, algorithm 1).
/// @pre A is positive definite
Eigen::VectorXd sparse_minimum(const Eigen::MatrixXd& a, const Eigen::VectorXd& c, double price) {
  Eigen::VectorXd w = Eigen::VectorXd::Zero(c.size());
  Eigen::VectorXd sign = w;
  std::vector<Eigen::Index> active;
  for (Eigen::Index join = 0; join < joins_a_column_max * c.size(); ++join) {
    Eigen::VectorXd pull = c - a * w;
    for (const Eigen::Index each : active) pull[each] = 0.0;
    Eigen::Index next = 0;
    if (!(pull.cwiseAbs().maxCoeff(&next) > (1.0 + l1_tolerance) * price)) break;
    active.push_back(next);
    sign[next] = std::copysign(1.0, pull[next]);
    for (bool turns = true; turns && !active.empty();) {
      const Eigen::MatrixXd of_active = a(active, active);
      const Eigen::VectorXd target = c(active) - price * sign(active);
      const Eigen::VectorXd step = of_active.llt().solve(target) - w(active);
      double share = 1.0;
      std::size_t out = active.size();
      for (std::size_t i = 0; i < active.size(); ++i) {
        const double now = w[active[i]];
        const double by = step[static_cast<Eigen::Index>(i)];
        if ((now + by) * sign[active[i]] > 0 || (out < active.size() && !(-now / by < share)))
          continue;
        share = std::min(share, -now / by);
        out = i;
      }
      w(active) += share * step;
      turns = out < active.size();
      if (!turns) continue;
      w[active[out]] = sign[active[out]] = 0.0;
      active.erase(active.begin() + static_cast<std::ptrdiff_t>(out));
    }
  }
  return w;
}

/// Standard deviation of each signal to its power in all rows of the courses; 0 for temperatures.
std::vector<double> course_deviations(const MeasuredTests& tests, const BankColumns& columns) {
  std::vector<double> deviations(columns.subjects.size(), 0.0);
  for (std::size_t i = tests.places.size(); i < deviations.size(); ++i) {
    const auto signal = std::find(tests.signals.begin(), tests.signals.end(), columns.subjects[i]);
    double rows = 0.0;
    double sum = 0.0;
    double squares = 0.0;
    for (std::size_t run = 0; run < tests.runs.size(); ++run) {
      const Eigen::ArrayXd values = tests.course(run)
                                        .signals.col(signal - tests.signals.begin())
                                        .array()
                                        .pow(columns.powers[i]);
      rows += static_cast<double>(values.size());
      sum += values.sum();
      squares += values.square().sum();
    }
    deviations[i] = std::sqrt(std::max(0.0, squares / rows - std::pow(sum / rows, 2.0)));
  }
  return deviations;
}

/// Factors of the columns for the fit; 0 (no gain): columns that never move, and all columns of a
/// signal that did not move.
/// @param deviation  standard deviation of each column
/// @param size       its RMS
Eigen::VectorXd scales(const Eigen::VectorXd& deviation, const Eigen::VectorXd& size,
                       const MeasuredTests& tests, const BankColumns& columns) {
  const auto places = static_cast<Eigen::Index>(tests.places.size());
  const double usual_K = std::sqrt(deviation.head(places).squaredNorm() /
                                   static_cast<double>(std::max<Eigen::Index>(places, 1)));
  const auto late = static_cast<Eigen::Index>(columns.late());
  const std::vector<double> usual = course_deviations(tests, columns);
  Eigen::VectorXd scale = Eigen::VectorXd::Zero(deviation.size());
  for (Eigen::Index i = 0; i < deviation.size(); ++i) {
    if (!(deviation[i] > 1e-12 * size[i])) continue;
    const auto subject = static_cast<std::size_t>(
        i < late ? i % std::ssize(columns.subjects)
                 : std::find(columns.subjects.begin(), columns.subjects.end(),
                             columns.hinges[static_cast<std::size_t>(i - late)].signal) -
                       columns.subjects.begin());
    const bool is_place = subject < tests.places.size();
    if (!is_place && !tests.moved(columns.subjects[subject])) continue;
    const double weight = i >= late                          ? weight_of_hinge
                          : i < std::ssize(columns.subjects) ? 1.0
                                                             : weight_of_lag;
    scale[i] = weight / std::hypot(deviation[i], is_place ? usual_share * usual_K
                                                          : usual_share_of_signal * usual[subject]);
  }
  return scale;
}

Eigen::VectorXd low_pass(const Eigen::VectorXd& time_s, const Eigen::VectorXd& values,
                         double tau_s) {
  LowPass late(tau_s);
  Eigen::VectorXd passed(values.size());
  for (Eigen::Index row = 0; row < values.size(); ++row)
    passed[row] = late.step(
        std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(time_s[row])),
        values[row]);
  return passed;
}

struct Rows {
  Eigen::MatrixXd x;
  Eigen::MatrixXd y;
};

Rows complete_rows(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y) {
  std::vector<Eigen::Index> complete;
  for (Eigen::Index row = 0; row < y.rows(); ++row)
    if (y.row(row).allFinite()) complete.push_back(row);
  return {x(complete, Eigen::all), y(complete, Eigen::all)};
}

}  // namespace

BankColumns bank_columns(const MeasuredTests& tests) {
  BankColumns bank;
  for (const std::string& place : tests.places) {
    bank.subjects.push_back(place);
    bank.powers.push_back(1.0);
  }
  for (std::size_t i = 0; i < tests.signals.size(); ++i)
    for (const double power : {1.0, 2.0}) {
      if (power > 1.5 && has_two_levels(tests, static_cast<Eigen::Index>(i))) continue;
      bank.subjects.push_back(tests.signals[i]);
      bank.powers.push_back(power);
    }
  double longest_s = 0.0;
  std::vector<double> steps_s;
  for (std::size_t i = 0; i < tests.runs.size(); ++i) {
    const Eigen::VectorXd& time_s = tests.course(i).time_s;
    longest_s =
        std::max(longest_s, tests.runs[i].time_s[tests.runs[i].time_s.size() - 1] - time_s[0]);
    for (Eigen::Index row = 1; row < time_s.size(); ++row)
      steps_s.push_back(time_s[row] - time_s[row - 1]);
  }
  std::nth_element(steps_s.begin(),
                   steps_s.begin() + static_cast<std::ptrdiff_t>(steps_s.size() / 2),
                   steps_s.end());
  const double step_s = steps_s[steps_s.size() / 2];
  const std::size_t lags = std::min(lags_max, columns_max / bank.subjects.size());
  bank.taus_s = {0.0};
  for (double tau_s = std::max(shortest_s, 2.0 * step_s);
       tau_s <= longest_s / 2.0 && tau_s <= term_tau_s_max && bank.taus_s.size() < lags;
       tau_s *= ratio)
    bank.taus_s.push_back(std::round(tau_s));
  return bank;
}

void add_hinges(const MeasuredTests& tests, BankColumns& columns) {
  std::vector<Hinge> hinges;
  for (std::size_t i = 0; i < tests.signals.size(); ++i) {
    std::set<double> values;  // enough to distinguish a switch
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const TestRun& run : tests.runs)
      for (const double value : run.signals.col(static_cast<Eigen::Index>(i))) {
        low = std::min(low, value);
        high = std::max(high, value);
        if (values.size() <= values_of_a_switch_max) values.insert(value);
      }
    if (values.size() <= values_of_a_switch_max || !tests.moved(tests.signals[i])) continue;
    const double step = (high - low) / (hinges_a_signal + 1);
    for (int j = 1; j <= hinges_a_signal; ++j) hinges.push_back({tests.signals[i], low + j * step});
  }
  if (columns.late() + hinges.size() <= columns_max) columns.hinges = std::move(hinges);
}

Eigen::MatrixXd bank_of(const TestRun& course, const MeasuredTests& tests,
                        const BankColumns& columns, const std::vector<Eigen::Index>& rows) {
  const auto subjects = static_cast<Eigen::Index>(columns.subjects.size());
  const auto of_signal = [&](const std::string& name) {
    return course.signals.col(std::find(tests.signals.begin(), tests.signals.end(), name) -
                              tests.signals.begin());
  };
  Eigen::MatrixXd bank(std::ssize(rows), static_cast<Eigen::Index>(columns.size()));
  for (Eigen::Index i = 0; i < subjects; ++i) {
    const auto at = static_cast<std::size_t>(i);
    Eigen::VectorXd values;
    if (i < course.places_K.cols())
      values = course.places_K.col(i);
    else
      values = of_signal(columns.subjects[at]);
    if (columns.powers[at] > 1.5) values = values.cwiseAbs2().eval();
    for (std::size_t j = 0; j < columns.taus_s.size(); ++j)
      bank.col(static_cast<Eigen::Index>(j) * subjects + i) =
          low_pass(course.time_s, values, columns.taus_s[j])(rows);
  }
  auto at = static_cast<Eigen::Index>(columns.late());
  for (const Hinge& hinge : columns.hinges)
    bank.col(at++) = (of_signal(hinge.signal)(rows).array() - hinge.above).max(0.0);
  bank.rowwise() -= bank.row(0).eval();
  return bank;
}

TermSpec bank_term(const BankColumns& columns, const std::vector<std::string>& outputs,
                   const Eigen::MatrixXd& gains) {
  TermSpec term;
  term.kind = "lag_bank";
  term.bank.taus_s = columns.taus_s;
  const auto subjects = static_cast<Eigen::Index>(columns.subjects.size());
  const auto taus = static_cast<Eigen::Index>(columns.taus_s.size());
  for (Eigen::Index i = 0; i < subjects; ++i) {
    const Eigen::MatrixXd of_subject = gains(Eigen::seqN(i, taus, subjects), Eigen::all);
    if ((of_subject.array() == 0.0).all()) continue;
    term.bank.subjects.push_back(columns.subjects[static_cast<std::size_t>(i)]);
    term.bank.powers.push_back(columns.powers[static_cast<std::size_t>(i)]);
    for (std::size_t o = 0; o < outputs.size(); ++o) {
      const auto of_output = of_subject.col(static_cast<Eigen::Index>(o));
      term.bank.gain_um_per_unit[outputs[o]].emplace_back(of_output.begin(), of_output.end());
    }
  }
  return term;
}

std::vector<TermSpec> hinge_terms(const BankColumns& columns,
                                  const std::vector<std::string>& outputs,
                                  const Eigen::MatrixXd& gains) {
  std::vector<TermSpec> terms;
  auto row = static_cast<Eigen::Index>(columns.late());
  for (const Hinge& hinge : columns.hinges) {
    const auto of_hinge = gains.row(row++);
    if ((of_hinge.array() == 0.0).all()) continue;
    TermSpec& term = terms.emplace_back();
    term.kind = "signal_hinge";
    term.subject = hinge.signal;
    term.shared["above"] = hinge.above;
    for (std::size_t o = 0; o < outputs.size(); ++o)
      term.per_output["gain_um_per_unit"][outputs[o]] = of_hinge[static_cast<Eigen::Index>(o)];
  }
  return terms;
}

ThermalModel bank_model(const std::vector<std::string>& places,
                        const std::vector<std::string>& outputs, const BankColumns& columns,
                        Eigen::MatrixXd gains) {
  ThermalModel model;
  model.inputs = places;
  model.outputs = outputs;
  const auto count = static_cast<Eigen::Index>(places.size());
  for (Eigen::Index o = 0; o < gains.cols(); ++o) {
    const auto at_once = gains.col(o).head(count);
    model.matrix_um_per_K.emplace_back(at_once.begin(), at_once.end());
  }
  gains.topRows(count).setZero();
  model.terms = hinge_terms(columns, outputs, gains);
  TermSpec bank = bank_term(columns, outputs, gains);
  if (!bank.bank.subjects.empty()) model.terms.insert(model.terms.begin(), std::move(bank));
  return model;
}

BankEquations::BankEquations(const MeasuredTests& tests, const BankColumns& columns) {
  const auto count = static_cast<Eigen::Index>(columns.size());
  for (std::size_t run = 0; run < tests.runs.size(); ++run)
    rows_.push_back(bank_of(tests.course(run), tests, columns, tests.rows_in_course(run)));
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd squares = sum;
  for (const Fold& fold : tests.folds) {
    const Eigen::Index length = fold.end - fold.begin;
    const Rows part = complete_rows(rows_[fold.run].middleRows(fold.begin, length),
                                    tests.runs[fold.run].outputs_um.middleRows(fold.begin, length));
    Sums& sums = folds_.emplace_back();
    sums.xx = part.x.transpose() * part.x;
    sums.xy = part.x.transpose() * part.y;
    sums.yy = part.y.colwise().squaredNorm().transpose();
    sums.rows = static_cast<double>(part.x.rows());
    sum += part.x.colwise().sum().transpose();
    squares += sums.xx.diagonal();
  }
  const auto rows = static_cast<double>(tests.rows());
  const Eigen::VectorXd variance = squares / rows - (sum / rows).cwiseAbs2();
  scale_ = scales(variance.cwiseMax(0.0).cwiseSqrt(), (squares / rows).cwiseSqrt(), tests, columns);
  for (Sums& sums : folds_) {
    sums.xx = scale_.asDiagonal() * sums.xx * scale_.asDiagonal();
    sums.xy = scale_.asDiagonal() * sums.xy;
  }
}

Eigen::MatrixXd BankEquations::fit(std::size_t left_out) const {
  Eigen::MatrixXd xx = Eigen::MatrixXd::Zero(scale_.size(), scale_.size());
  Eigen::MatrixXd xy = Eigen::MatrixXd::Zero(scale_.size(), folds_[0].xy.cols());
  Eigen::VectorXd yy = Eigen::VectorXd::Zero(xy.cols());
  double rows = 0.0;
  for (std::size_t f = 0; f < folds_.size(); ++f) {
    if (f == left_out) continue;
    xx += folds_[f].xx;
    xy += folds_[f].xy;
    yy += folds_[f].yy;
    rows += folds_[f].rows;
  }
  xx /= std::max(rows, 1.0);
  xy /= std::max(rows, 1.0);
  xx.diagonal().array() += ridge_penalty;
  Eigen::MatrixXd gains = Eigen::MatrixXd::Zero(xy.rows(), xy.cols());
  for (Eigen::Index o = 0; o < xy.cols(); ++o) {
    const double size_um = std::sqrt(yy[o] / std::max(rows, 1.0));
    if (size_um > 0) gains.col(o) = size_um * sparse_minimum(xx, xy.col(o) / size_um, l1_price);
  }
  return scale_.asDiagonal() * gains;
}

}  // namespace thermocomp::identification
