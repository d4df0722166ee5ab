#include "modelling/identification/equation/lag_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Cholesky>

#include "estimator/model/terms/low_pass.hpp"
#include "estimator/types.hpp"

namespace thermocomp::identification {
namespace {

std::vector<double> time_constants(const MeasuredTests& tests, std::size_t count) {
  double duration_s = 0.0;
  double step_s = std::numeric_limits<double>::infinity();
  for (const TestRun& run : tests.runs) {
    const Eigen::Index rows = run.time_s.size();
    const double length_s = run.time_s[rows - 1] - run.time_s[0];
    duration_s = std::max(duration_s, length_s);
    step_s = std::min(step_s, length_s / static_cast<double>(rows - 1));
  }
  // A lag below two rows or 1 min cannot be distinguished from none, one above a quarter of the
  // test not from a drift.
  const double shortest_s = std::max(2.0 * step_s, 60.0);
  const double longest_s = std::min(duration_s / 4.0, 4.0 * 3600.0);
  std::vector<double> taus_s;
  if (!(longest_s > shortest_s)) return taus_s;
  for (std::size_t i = 0; i < count; ++i) {
    const double share = count == 1 ? 0.5 : static_cast<double>(i) / static_cast<double>(count - 1);
    // Whole seconds, for readability.
    taus_s.push_back(std::round(shortest_s * std::pow(longest_s / shortest_s, share)));
  }
  return taus_s;
}

std::vector<Eigen::Index> outputs_of(const ColumnPool& pool) {
  std::vector<Eigen::Index> places(pool.outputs());
  std::iota(places.begin(), places.end(), static_cast<Eigen::Index>(pool.columns().size()));
  return places;
}

/// Equations of one subset and its lags in all folds, extended by one column at a time with the
/// arithmetic of search_subsets().
class Forward {
 public:
  Forward(const ColumnPool& pool, const std::vector<std::size_t>& columns) : pool_(pool) {
    std::vector<Eigen::Index> rows(columns.begin(), columns.end());
    const std::vector<Eigen::Index> y = outputs_of(pool);
    rows.insert(rows.end(), y.begin(), y.end());
    count_ = static_cast<Eigen::Index>(columns.size());
    const NormalEquations& equations = pool.equations();
    const Eigen::MatrixXd total = equations.total(rows, rows);
    for (std::size_t f = 0; f < equations.folds.size(); ++f) {
      left_out_.emplace_back(equations.folds[f](rows, rows));
      train_.emplace_back(total - left_out_.back());
      for (Eigen::Index i = 0; i < count_; ++i)
        left_out_.back()(i, i) += equations.reading_errors(rows[static_cast<std::size_t>(i)],
                                                           static_cast<Eigen::Index>(f));
    }
    norm_ = total.diagonal();
  }

  [[nodiscard]] bool take(Eigen::Index k) {
    for (const Eigen::MatrixXd& train : train_)
      if (!(train(k, k) > singular_share * norm_[k])) return false;
    for (std::size_t f = 0; f < train_.size(); ++f) {
      Eigen::MatrixXd& a = train_[f];
      Eigen::MatrixXd& t = left_out_[f];
      const Eigen::VectorXd c = a.col(k) / a(k, k);
      const Eigen::VectorXd t_k = t.col(k);
      const Eigen::RowVectorXd a_k = a.row(k);
      a.noalias() -= c * a_k;
      t.noalias() += c * (c.transpose() * t_k[k] - t_k.transpose());
      t.noalias() -= t_k * c.transpose();
      a.col(k).setZero();
      a.row(k).setZero();
    }
    return true;
  }

  /// Left-out sum of squares of the outputs per fold, relative to no model, with column k added
  /// (-1: none); empty if singular.
  [[nodiscard]] std::vector<double> scores_with(Eigen::Index k) const {
    std::vector<double> scores(train_.size(), 0.0);
    for (std::size_t f = 0; f < train_.size(); ++f) {
      const Eigen::MatrixXd& a = train_[f];
      const Eigen::MatrixXd& t = left_out_[f];
      if (k >= 0 && !(a(k, k) > singular_share * norm_[k])) return {};
      for (Eigen::Index o = count_; o < count_ + outputs(); ++o) {
        const double b = k < 0 ? 0.0 : a(k, o) / a(k, k);
        const double left = k < 0 ? t(o, o) : t(o, o) + b * (b * t(k, k) - 2.0 * t(k, o));
        scores[f] += left / (norm_[o] * static_cast<double>(outputs()));
      }
    }
    return scores;
  }

 private:
  [[nodiscard]] Eigen::Index outputs() const { return static_cast<Eigen::Index>(pool_.outputs()); }

  const ColumnPool& pool_;
  Eigen::Index count_{0};
  std::vector<Eigen::MatrixXd> train_;
  std::vector<Eigen::MatrixXd> left_out_;
  Eigen::VectorXd norm_;
};

double sum_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum;
}

/// True if each lag's gain, fitted to all rows, is a share of its place's coefficient.
bool is_share(const ColumnPool& pool, const std::vector<std::size_t>& columns) {
  const std::vector<Eigen::Index> x(columns.begin(), columns.end());
  const std::vector<Eigen::Index> y = outputs_of(pool);
  const Eigen::MatrixXd& total = pool.equations().total;
  const Eigen::MatrixXd b = total(x, x).ldlt().solve(total(x, y));
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (!(pool.columns()[columns[i]].tau_s > 0)) continue;
    const std::size_t place = pool.columns()[columns[i]].place;
    const auto at = std::find(columns.begin(), columns.end(), place) - columns.begin();
    const auto lag = b.row(static_cast<Eigen::Index>(i));
    const auto own = b.row(at);
    if (!(lag.dot(own) > 0 && lag.squaredNorm() <= own.squaredNorm())) return false;
  }
  return true;
}

}  // namespace

bool helps_on_most(const std::vector<double>& before, const std::vector<double>& after) {
  std::size_t better = 0;
  for (std::size_t f = 0; f < before.size(); ++f)
    if (after[f] < before[f]) ++better;
  return 2 * better > before.size();
}

Eigen::VectorXd column_of(const TestRun& run, const FitColumn& column) {
  Eigen::VectorXd rise_K = run.places_K.col(static_cast<Eigen::Index>(column.place));
  if (!(column.tau_s > 0)) return rise_K;
  LowPass late(column.tau_s);
  Eigen::VectorXd lag_K(rise_K.size());
  for (Eigen::Index row = 0; row < rise_K.size(); ++row) {
    const auto now =
        std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(run.time_s[row]));
    lag_K[row] = late.step(now, rise_K[row]) - rise_K[row];
  }
  return lag_K;
}

ColumnPool::ColumnPool(const MeasuredTests& tests, std::size_t lags, double sensor_error_K)
    : places_(tests.places.size()),
      outputs_(tests.outputs.size()),
      taus_s_(time_constants(tests, lags)),
      tests_(tests.folds.size()) {
  for (std::size_t place = 0; place < places_; ++place) columns_.push_back({place, 0.0});
  for (std::size_t place = 0; place < places_; ++place)
    for (const double tau_s : taus_s_) columns_.push_back({place, tau_s});
  const auto count = static_cast<Eigen::Index>(columns_.size());
  std::vector<Eigen::MatrixXd> all_of_run;
  for (const TestRun& run : tests.runs) {
    Eigen::MatrixXd& all = all_of_run.emplace_back(run.time_s.size(), count);
    for (Eigen::Index i = 0; i < count; ++i)
      all.col(i) = column_of(run, columns_[static_cast<std::size_t>(i)]);
  }
  equations_ = normal_equations(tests, all_of_run, sensor_error_K);
}

Eigen::MatrixXd ColumnPool::left_out(const std::vector<std::size_t>& columns) const {
  const std::vector<Eigen::Index> x(columns.begin(), columns.end());
  const std::vector<Eigen::Index> y = outputs_of(*this);
  Eigen::MatrixXd sums(static_cast<Eigen::Index>(tests_), static_cast<Eigen::Index>(y.size()));
  for (std::size_t f = 0; f < tests_; ++f) {
    const Eigen::MatrixXd train = equations_.total - equations_.folds[f];
    Eigen::MatrixXd b = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(x.size()), sums.cols());
    if (!x.empty()) {
      const Eigen::MatrixXd a = train(x, x);
      const Eigen::VectorXd scale = a.diagonal().cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd scaled = scale.asDiagonal() * a * scale.asDiagonal();
      const Eigen::LDLT<Eigen::MatrixXd> solver(scaled);
      if (!(solver.vectorD().minCoeff() > singular_share))
        return Eigen::MatrixXd::Constant(sums.rows(), sums.cols(), not_a_number);
      b = scale.asDiagonal() * solver.solve(scale.asDiagonal() * train(x, y));
    }
    const Eigen::MatrixXd& own = equations_.folds[f];
    for (Eigen::Index o = 0; o < sums.cols(); ++o) {
      const auto column = y[static_cast<std::size_t>(o)];
      double sum = own(column, column);
      if (!x.empty()) {
        const Eigen::VectorXd own_b = own(x, x) * b.col(o);
        sum += b.col(o).dot(own_b) - 2.0 * b.col(o).dot(own(x, column).eval());
      }
      sums(static_cast<Eigen::Index>(f), o) = std::max(0.0, sum);
    }
  }
  return sums;
}

LaggedSubset add_lags(const ColumnPool& pool, const std::vector<std::size_t>& places,
                      double gain_min) {
  const std::size_t lags = pool.taus_s().size();
  std::vector<std::size_t> columns = places;
  for (const std::size_t place : places)
    for (std::size_t lag = 0; lag < lags; ++lag) columns.push_back(pool.index_of(place, lag));
  Forward forward(pool, columns);
  LaggedSubset subset{places, std::numeric_limits<double>::infinity()};
  for (std::size_t i = 0; i < places.size(); ++i)
    if (!forward.take(static_cast<Eigen::Index>(i))) return subset;
  std::vector<double> scores = forward.scores_with(-1);
  subset.score = sum_of(scores);
  std::vector<bool> lagged(places.size(), false);
  for (std::size_t round = 0; round < places.size(); ++round) {
    std::size_t best = columns.size();
    std::vector<double> best_scores = scores;
    for (std::size_t i = places.size(); i < columns.size(); ++i) {
      if (lagged[(i - places.size()) / lags]) continue;
      const std::vector<double> with = forward.scores_with(static_cast<Eigen::Index>(i));
      if (with.empty() || !(sum_of(with) < sum_of(best_scores)) || !helps_on_most(scores, with))
        continue;
      std::vector<std::size_t> tried = subset.columns;
      tried.push_back(columns[i]);
      if (!is_share(pool, tried)) continue;
      best = i;
      best_scores = with;
    }
    if (best == columns.size() || sum_of(best_scores) > (1.0 - gain_min) * subset.score) break;
    if (!forward.take(static_cast<Eigen::Index>(best))) break;
    lagged[(best - places.size()) / lags] = true;
    subset.columns.push_back(columns[best]);
    scores = best_scores;
    subset.score = sum_of(scores);
  }
  return subset;
}

}  // namespace thermocomp::identification
