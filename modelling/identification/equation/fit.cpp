#include "modelling/identification/equation/fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "estimator/types.hpp"

namespace thermocomp::identification {
namespace {

constexpr double combinations_max = 2e9;
constexpr double as_good_as = 1.02;       // on RMS; within it fewer terms win
constexpr double condition_max = 1000.0;  // above it, coefficients cancel each other
constexpr double sensor_error_K_of_one_run = 0.1;

/// Two-sided 95 % points of Student's t; above thirty degrees of freedom the normal's.
double student_95(std::size_t freedom) {
  constexpr std::array<double, 31> points{0.0,   12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365,
                                          2.306, 2.262,  2.228, 2.201, 2.179, 2.160, 2.145, 2.131,
                                          2.120, 2.110,  2.101, 2.093, 2.086, 2.080, 2.074, 2.069,
                                          2.064, 2.060,  2.056, 2.052, 2.048, 2.045, 2.042};
  return freedom < points.size() ? points[std::max<std::size_t>(freedom, 1)] : 1.96;
}

/// Rows of the folds stacked in order: columns of the equation, and outputs.
struct Stacked {
  Eigen::MatrixXd x;
  Eigen::MatrixXd y;
  std::vector<Eigen::Index> begin;  ///< first row of each fold, and the end
};

Stacked stack(const MeasuredTests& tests, const std::vector<FitColumn>& columns) {
  Stacked stacked;
  const auto count = static_cast<Eigen::Index>(columns.size());
  Eigen::Index row = 0;
  for (const Fold& fold : tests.folds) row += fold.end - fold.begin;
  stacked.x.resize(row, count);
  stacked.y.resize(row, static_cast<Eigen::Index>(tests.outputs.size()));
  row = 0;
  stacked.begin.push_back(0);
  std::vector<Eigen::MatrixXd> whole;
  for (const TestRun& run : tests.runs) {
    Eigen::MatrixXd& x = whole.emplace_back(run.time_s.size(), count);
    for (Eigen::Index i = 0; i < count; ++i)
      x.col(i) = column_of(run, columns[static_cast<std::size_t>(i)]);
  }
  for (const Fold& fold : tests.folds) {
    const Eigen::Index rows = fold.end - fold.begin;
    stacked.x.middleRows(row, rows) = whole[fold.run].middleRows(fold.begin, rows);
    stacked.y.middleRows(row, rows) = tests.runs[fold.run].outputs_um.middleRows(fold.begin, rows);
    row += rows;
    stacked.begin.push_back(row);
  }
  return stacked;
}

Eigen::MatrixXd solve(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y, double penalty) {
  if (!(penalty > 0)) return x.colPivHouseholderQr().solve(y);
  Eigen::MatrixXd a = x.transpose() * x;
  a.diagonal() *= 1.0 + penalty;
  return a.ldlt().solve(x.transpose() * y);
}

Eigen::MatrixXd without_rows(const Eigen::MatrixXd& all, Eigen::Index begin, Eigen::Index end) {
  Eigen::MatrixXd rest(all.rows() - (end - begin), all.cols());
  rest << all.topRows(begin), all.bottomRows(all.rows() - end);
  return rest;
}

double rms(const Eigen::VectorXd& values) {
  return std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

/// Rows of one test are correlated, so its sum of x e counts as one observation (sandwich
/// estimator, clustered by fold); t with folds - 1 degrees of freedom.
Eigen::VectorXd confidence(const Stacked& data, const Eigen::VectorXd& residual) {
  const std::size_t folds = data.begin.size() - 1;
  Eigen::VectorXd half_width = Eigen::VectorXd::Constant(data.x.cols(), not_a_number);
  if (folds < 2) return half_width;
  const Eigen::MatrixXd inverse = (data.x.transpose() * data.x).inverse();
  Eigen::MatrixXd slices = Eigen::MatrixXd::Zero(data.x.cols(), data.x.cols());
  for (std::size_t f = 0; f < folds; ++f) {
    const Eigen::Index rows = data.begin[f + 1] - data.begin[f];
    const Eigen::VectorXd sum =
        data.x.middleRows(data.begin[f], rows).transpose() * residual.segment(data.begin[f], rows);
    slices.noalias() += sum * sum.transpose();
  }
  const double few = static_cast<double>(folds) / static_cast<double>(folds - 1);
  const Eigen::MatrixXd covariance = few * inverse * slices * inverse;
  return student_95(folds - 1) * covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
}

void judge_hot_half(const MeasuredTests& tests, const Stacked& data, double penalty, Fit& fit) {
  for (OutputFit& output : fit.outputs) output.hot_rms_um = not_a_number;
  if (tests.hot.rows.empty()) return;
  std::vector<bool> is_hot(static_cast<std::size_t>(data.x.rows()), false);
  for (const Eigen::Index row : tests.hot.rows)
    is_hot[static_cast<std::size_t>(row - tests.runs[0].begin)] = true;
  std::vector<Eigen::Index> hot;
  std::vector<Eigen::Index> cool;
  for (Eigen::Index row = 0; row < data.x.rows(); ++row)
    (is_hot[static_cast<std::size_t>(row)] ? hot : cool).push_back(row);
  const Eigen::MatrixXd b = solve(data.x(cool, Eigen::all), data.y(cool, Eigen::all), penalty);
  const Eigen::MatrixXd left = data.y(hot, Eigen::all) - data.x(hot, Eigen::all) * b;
  for (std::size_t o = 0; o < fit.outputs.size(); ++o)
    fit.outputs[o].hot_rms_um = rms(left.col(static_cast<Eigen::Index>(o)));
}

void judge_outputs(const MeasuredTests& tests, const Stacked& data, double penalty, Fit& fit) {
  const std::size_t folds = data.begin.size() - 1;
  const Eigen::MatrixXd coefficients = solve(data.x, data.y, penalty);
  fit.left_out_um.resize(data.y.rows(), data.y.cols());
  for (std::size_t f = 0; f < folds; ++f) {
    const Eigen::Index begin = data.begin[f];
    const Eigen::Index end = data.begin[f + 1];
    const Eigen::MatrixXd b = folds == 1 ? coefficients
                                         : solve(without_rows(data.x, begin, end),
                                                 without_rows(data.y, begin, end), penalty);
    fit.left_out_um.middleRows(begin, end - begin) = data.x.middleRows(begin, end - begin) * b;
  }
  for (Eigen::Index o = 0; o < data.y.cols(); ++o) {
    OutputFit& output = fit.outputs.emplace_back();
    output.coefficients = coefficients.col(o);
    const Eigen::VectorXd residual = data.y.col(o) - data.x * coefficients.col(o);
    const Eigen::VectorXd left = data.y.col(o) - fit.left_out_um.col(o);
    output.ci95 = confidence(data, residual);
    output.train_rms_um = rms(residual);
    output.left_out_rms_um = rms(left);
    output.left_out_peak_um = left.cwiseAbs().maxCoeff();
    output.no_model_rms_um = rms(data.y.col(o));
    for (std::size_t f = 0; f < folds; ++f) {
      const Eigen::Index rows = data.begin[f + 1] - data.begin[f];
      output.fold_rms_um.push_back(rms(left.segment(data.begin[f], rows)));
      output.fold_no_model_rms_um.push_back(rms(data.y.col(o).segment(data.begin[f], rows)));
    }
  }
  judge_hot_half(tests, data, penalty, fit);
  Eigen::MatrixXd scaled = data.x;
  scaled.colwise().normalize();
  const auto values = scaled.jacobiSvd().singularValues();
  fit.condition = values[0] / values[values.size() - 1];
}

std::vector<double> rms_of_sums(const Eigen::MatrixXd& sums, double rows) {
  std::vector<double> result;
  for (Eigen::Index o = 0; o < sums.cols(); ++o)
    result.push_back(std::sqrt(sums.col(o).sum() / rows));
  return result;
}

/// Columns of the equation with place `lost` replaced by `by`; by = lost: removed.
std::vector<std::size_t> columns_without(const ColumnPool& pool,
                                         const std::vector<std::size_t>& columns, std::size_t lost,
                                         std::size_t by) {
  std::vector<std::size_t> rest;
  for (const std::size_t column : columns) {
    if (pool.columns()[column].place != lost)
      rest.push_back(column);
    else if (by != lost && column < pool.places())
      rest.push_back(by);
    else if (by != lost)
      rest.push_back(column + by * pool.taus_s().size() - lost * pool.taus_s().size());
  }
  return rest;
}

void judge_losses(const MeasuredTests& tests, const ColumnPool& pool,
                  const std::vector<std::size_t>& columns, Fit& fit) {
  const auto rows = static_cast<double>(tests.rows());
  const Eigen::MatrixXd whole = pool.left_out({});
  const auto score = [&](const Eigen::MatrixXd& sums) {
    return (sums.colwise().sum().array() / whole.colwise().sum().array()).sum();
  };
  for (const std::size_t place : fit.places) {
    LostPlace lost;
    lost.place = lost.replacement = place;
    const Eigen::MatrixXd without = pool.left_out(columns_without(pool, columns, place, place));
    lost.without_rms_um = lost.replaced_rms_um = rms_of_sums(without, rows);
    double best = score(without);
    for (std::size_t other = 0; other < tests.places.size(); ++other) {
      if (std::find(fit.places.begin(), fit.places.end(), other) != fit.places.end()) continue;
      const Eigen::MatrixXd sums = pool.left_out(columns_without(pool, columns, place, other));
      if (!(score(sums) < best)) continue;
      best = score(sums);
      lost.replacement = other;
      lost.replaced_rms_um = rms_of_sums(sums, rows);
    }
    fit.lost.push_back(std::move(lost));
  }
}

void warn(const MeasuredTests& tests, Fit& fit) {
  for (std::size_t o = 0; o < fit.outputs.size(); ++o) {
    const OutputFit& output = fit.outputs[o];
    for (std::size_t f = 0; f < output.fold_rms_um.size(); ++f)
      if (!(output.fold_rms_um[f] < output.fold_no_model_rms_um[f]))
        fit.warnings.push_back(tests.outputs[o] + ": on " + tests.fold_name(f) +
                               ", left out, the model is worse than no model");
  }
  if (!(fit.condition <= condition_max))
    fit.warnings.emplace_back(
        "the chosen places are nearly collinear (condition above 1000): their coefficients balance "
        "each other and amplify a sensor's error");
  if (tests.folds.size() < 2)
    fit.warnings.emplace_back(
        "one test only: nothing could be left out, and the errors are those of the fitted rows");
}

SubsetOptions subset_options(const MeasuredTests& tests, const FitOptions& options,
                             const Grouping& grouping) {
  SubsetOptions subset;
  subset.terms_min = std::min(options.terms_min, tests.places.size());
  subset.terms_max = std::min(options.terms_max, tests.places.size());
  subset.kept = options.lags ? options.kept_for_lags : 20;
  if (options.choice == Choice::free) return subset;
  subset.group_of.resize(tests.places.size());
  for (std::size_t group = 0; group < grouping.groups.size(); ++group)
    for (const std::size_t place : grouping.groups[group]) subset.group_of[place] = group;
  return subset;
}

/// Best equation of each number of terms; of those, the one with the fewest terms within
/// `as_good_as` of the best.
std::vector<std::size_t> choose_columns(const ColumnPool& pool, const FitOptions& options,
                                        Fit& fit) {
  std::vector<LaggedSubset> best;
  for (auto& subsets : fit.ranking) {
    LaggedSubset chosen{{}, std::numeric_limits<double>::infinity()};
    for (const Subset& subset : subsets) {
      const LaggedSubset each = options.lags ? add_lags(pool, subset.places, options.lag_gain_min)
                                             : LaggedSubset{subset.places, subset.score};
      if (each.score < chosen.score) chosen = each;
    }
    if (!chosen.columns.empty()) best.push_back(chosen);
    if (subsets.size() > 20) subsets.resize(20);
  }
  if (best.empty())
    throw std::runtime_error(
        "no combination is allowed. Next: fewer --terms, --free, or another --threshold");
  double lowest = best[0].score;
  for (const LaggedSubset& each : best) lowest = std::min(lowest, each.score);
  const auto found = std::find_if(best.begin(), best.end(), [&](const LaggedSubset& each) {
    // Scores are squares; rounding can make that of an exact equation negative.
    return each.score <= lowest + std::abs(lowest) * (as_good_as * as_good_as - 1.0);
  });
  return found->columns;
}

bool found_any(const SubsetSearch& search) {
  return std::any_of(search.best.begin(), search.best.end(),
                     [](const auto& subsets) { return !subsets.empty(); });
}

SubsetSearch search_relaxing(const NormalEquations& equations, SubsetOptions subset, bool relaxes,
                             Fit& fit) {
  SubsetSearch search = search_subsets(equations, subset);
  if (!relaxes || found_any(search)) return search;
  subset.terms_min = 1;
  search = search_subsets(equations, subset);
  fit.warnings.emplace_back("the groups of places allow fewer terms than requested");
  if (found_any(search)) return search;
  subset.group_of.clear();
  fit.warnings.emplace_back("the groups of places allow no combination: any places were tried");
  return search_subsets(equations, subset);
}

struct Chosen {
  ColumnPool pool;
  std::vector<std::size_t> columns;
};

Chosen choose(const MeasuredTests& tests, const FitOptions& options, Fit& fit) {
  const Eigen::MatrixXd s = similarity(tests, true);
  fit.grouping = options.threshold >= 0 ? group_places(s, options.threshold)
                                        : group_places(s, noise_floor(tests));
  const SubsetOptions subset = subset_options(tests, options, fit.grouping);
  if (!(combinations(tests.places.size(), subset.terms_min, subset.terms_max) <= combinations_max))
    throw std::runtime_error(
        "too many combinations. Next: fewer --terms, or fewer places (--places)");
  const double sensor_error_K = options.sensor_error_K >= 0 ? options.sensor_error_K
                                : tests.runs.size() > 1     ? 0.0
                                                            : sensor_error_K_of_one_run;
  SubsetSearch search =
      search_relaxing(normal_equations(tests, sensor_error_K), subset, options.relaxes, fit);
  fit.ranking = std::move(search.best);
  fit.judged = search.judged;
  Chosen chosen{ColumnPool(tests, options.lags ? 12 : 0, sensor_error_K), {}};
  chosen.columns = choose_columns(chosen.pool, options, fit);
  for (const std::size_t column : chosen.columns) {
    fit.columns.push_back(chosen.pool.columns()[column]);
    if (column < chosen.pool.places()) fit.places.push_back(column);
  }
  return chosen;
}

}  // namespace

Equation chosen_equation(const MeasuredTests& tests, const FitOptions& options) {
  Fit fit;
  static_cast<void>(choose(tests, options, fit));
  const Stacked data = stack(tests, fit.columns);
  return {fit.columns, solve(data.x, data.y, options.penalty)};
}

Fit fit_equation(const MeasuredTests& tests, const FitOptions& options) {
  Fit fit;
  const Chosen chosen = choose(tests, options, fit);
  judge_outputs(tests, stack(tests, fit.columns), options.penalty, fit);
  judge_losses(tests, chosen.pool, chosen.columns, fit);
  warn(tests, fit);
  return fit;
}

ThermalModel model_of(const MeasuredTests& tests, const Fit& fit) {
  ThermalModel model;
  model.outputs = tests.outputs;
  for (const std::size_t place : fit.places) model.inputs.push_back(tests.places[place]);
  for (std::size_t o = 0; o < tests.outputs.size(); ++o) {
    const Eigen::VectorXd& all = fit.outputs[o].coefficients;
    model.matrix_um_per_K.emplace_back(all.data(), all.data() + fit.places.size());
  }
  for (std::size_t i = fit.places.size(); i < fit.columns.size(); ++i) {
    TermSpec term;
    term.kind = "thermal_lag";
    term.subject = tests.places[fit.columns[i].place];
    term.shared["tau_s"] = fit.columns[i].tau_s;
    for (std::size_t o = 0; o < tests.outputs.size(); ++o)
      term.per_output["gain_um_per_K"][tests.outputs[o]] =
          fit.outputs[o].coefficients[static_cast<Eigen::Index>(i)];
    model.terms.push_back(std::move(term));
  }
  return model;
}

}  // namespace thermocomp::identification
