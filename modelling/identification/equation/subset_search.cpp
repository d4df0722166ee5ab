#include "modelling/identification/equation/subset_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace thermocomp::identification {
namespace {

class Best {
 public:
  explicit Best(std::size_t kept) : kept_(kept) {}
  [[nodiscard]] double worst() const noexcept { return worst_; }
  void offer(double score, const std::vector<std::size_t>& places) {
    subsets_.push_back({places, score});
    std::push_heap(subsets_.begin(), subsets_.end(), less);
    if (subsets_.size() > kept_) {
      std::pop_heap(subsets_.begin(), subsets_.end(), less);
      subsets_.pop_back();
    }
    if (subsets_.size() == kept_) worst_ = subsets_.front().score;
  }
  [[nodiscard]] std::vector<Subset> sorted() const {
    std::vector<Subset> result = subsets_;
    std::sort(result.begin(), result.end(), less);
    return result;
  }

 private:
  static bool less(const Subset& a, const Subset& b) { return a.score < b.score; }
  std::size_t kept_;
  double worst_{std::numeric_limits<double>::infinity()};
  std::vector<Subset> subsets_;
};

/// Interleaved equations of all folds, so that a vector instruction serves several folds: entry (i,
/// j) of fold f, i <= j, is at [(i * size + j) * lanes + f].
struct Level {
  std::vector<double> train;
  std::vector<double> left_out;
};

/// `fixed`: number of lanes at compile time; 0: `lanes`.
template <std::size_t fixed>
class Search {
 public:
  Search(const NormalEquations& equations, const SubsetOptions& options, std::size_t lanes)
      : options_(options),
        candidates_(static_cast<std::size_t>(equations.candidates)),
        outputs_(static_cast<std::size_t>(equations.outputs)),
        size_(candidates_ + outputs_),
        lanes_(lanes),
        levels_(options.terms_max),
        best_(options.terms_max + 1, Best(options.kept)),
        of_group_(candidates_ + 1, 0) {
    for (Level& level : levels_) {
      level.train.assign(size_ * size_ * lanes_, 0.0);
      level.left_out.assign(size_ * size_ * lanes_, 0.0);
    }
    factor_.resize(size_ * lanes_);
    fill(equations);
    order_places();
  }

  SubsetSearch run() {
    if (!levels_.empty()) descend(0, 0);
    SubsetSearch result;
    result.judged = judged_;
    for (const Best& best : best_) result.best.push_back(best.sorted());
    for (auto& subsets : result.best)
      for (Subset& subset : subsets) {
        for (std::size_t& place : subset.places) place = place_[place];
        std::sort(subset.places.begin(), subset.places.end());
      }
    return result;
  }

 private:
  [[nodiscard]] std::size_t lanes() const noexcept { return fixed != 0 ? fixed : lanes_; }
  [[nodiscard]] std::size_t at(std::size_t i, std::size_t j) const noexcept {
    return (i * size_ + j) * lanes();
  }

  /// Counts the places of the required group, which fill() puts first to prune the others early.
  void order_places() {
    if (options_.group_of.empty()) return;
    const auto required = [&](std::size_t place) {
      return options_.group_of[place] == options_.group_required;
    };
    required_ = static_cast<std::size_t>(std::count_if(place_.begin(), place_.end(), required));
  }

  void fill(const NormalEquations& equations) {
    place_.resize(candidates_);
    std::iota(place_.begin(), place_.end(), std::size_t{0});
    if (!options_.group_of.empty())
      std::stable_partition(place_.begin(), place_.end(), [&](std::size_t place) {
        return options_.group_of[place] == options_.group_required;
      });
    const Eigen::MatrixXd& total = equations.total;
    // Unit columns, so that one threshold detects singular equations.
    Eigen::VectorXd scale = total.diagonal().cwiseSqrt().cwiseInverse();
    for (Eigen::Index i = 0; i < scale.size(); ++i)
      if (!std::isfinite(scale[i])) scale[i] = 0.0;
    const auto source = [&](std::size_t i) {
      return static_cast<Eigen::Index>(i < candidates_ ? place_[i] : i);
    };
    for (std::size_t i = 0; i < size_; ++i) {
      for (std::size_t j = i; j < size_; ++j) {
        const Eigen::Index a = source(i);
        const Eigen::Index b = source(j);
        for (std::size_t f = 0; f < lanes(); ++f) {
          const bool real = f < equations.folds.size();
          const double own = real ? equations.folds[f](a, b) * scale[a] * scale[b] : 0.0;
          const double all = total(a, b) * scale[a] * scale[b];
          const bool reading = real && i == j && i < candidates_;
          const double error =
              reading ? equations.reading_errors(a, static_cast<Eigen::Index>(f)) : 0.0;
          levels_[0].left_out[at(i, j) + f] = own + error * scale[a] * scale[b];
          // A lane without a fold gets the identity: never singular, and without weight.
          levels_[0].train[at(i, j) + f] = real ? all - own : (i == j ? 1.0 : 0.0);
        }
      }
    }
  }

  /// Scores each place from `first` on in addition to the chosen ones, and recurses.
  void descend(std::size_t depth, std::size_t first) {
    const Level& level = levels_[depth];
    const std::size_t terms = depth + 1;
    for (std::size_t k = first; k < candidates_; ++k) {
      if (depth == 0 && !options_.group_of.empty() && k >= required_) return;
      const std::size_t group = options_.group_of.empty() ? k : options_.group_of[place_[k]];
      if (of_group_[group] >= options_.of_a_group_max && !options_.group_of.empty()) continue;
      if (!usable(level, k)) continue;
      chosen_.push_back(k);
      ++of_group_[group];
      if (terms >= options_.terms_min) {
        ++judged_;
        const double score = score_with(level, k);
        if (score < best_[terms].worst()) best_[terms].offer(score, chosen_);
      }
      if (terms < options_.terms_max && k + 1 < candidates_) {
        eliminate(level, levels_[depth + 1], k, terms + 1 == options_.terms_max);
        descend(depth + 1, k + 1);
      }
      --of_group_[group];
      chosen_.pop_back();
    }
  }

  [[nodiscard]] bool usable(const Level& level, std::size_t k) const noexcept {
    const double* own = &level.train[at(k, k)];
    double least = own[0];
    for (std::size_t f = 1; f < lanes(); ++f) least = std::min(least, own[f]);
    return least > singular_share;
  }

  [[nodiscard]] double score_with(const Level& level, std::size_t k) const noexcept {
    const double* a = &level.train[at(k, k)];
    const double* t = &level.left_out[at(k, k)];
    double sum = 0.0;
    for (std::size_t o = candidates_; o < size_; ++o) {
      const double* ay = &level.train[at(k, o)];
      const double* ty = &level.left_out[at(k, o)];
      const double* tt = &level.left_out[at(o, o)];
      std::array<double, fixed != 0 ? fixed : 1> part{};
      for (std::size_t f = 0; f < lanes(); ++f) {
        const double b = ay[f] / a[f];
        const double left = tt[f] + b * (b * t[f] - 2.0 * ty[f]);
        part[fixed != 0 ? f : 0] += left;
      }
      for (const double each : part) sum += each;
    }
    return sum / static_cast<double>(outputs_);
  }

  /// Row i of the next level, columns [begin, end).
  void eliminate_row(const Level& from, Level& to, std::size_t k, std::size_t i, std::size_t begin,
                     std::size_t end) noexcept {
    const double* c_i = &factor_[i * lanes()];
    const double* t_kk = &from.left_out[at(k, k)];
    const double* t_ki = &from.left_out[at(k, i)];
    for (std::size_t j = begin; j < end; ++j) {
      const double* c_j = &factor_[j * lanes()];
      const double* a_kj = &from.train[at(k, j)];
      const double* t_kj = &from.left_out[at(k, j)];
      const double* a_ij = &from.train[at(i, j)];
      const double* t_ij = &from.left_out[at(i, j)];
      double* __restrict a = &to.train[at(i, j)];
      double* __restrict t = &to.left_out[at(i, j)];
      for (std::size_t f = 0; f < lanes(); ++f) {
        a[f] = a_ij[f] - c_i[f] * a_kj[f];
        t[f] = t_ij[f] - c_i[f] * t_kj[f] + c_j[f] * (c_i[f] * t_kk[f] - t_ki[f]);
      }
    }
  }

  /// `last`: the next level is only scored, which needs diagonal and outputs of the places.
  void eliminate(const Level& from, Level& to, std::size_t k, bool last) noexcept {
    const double* a_kk = &from.train[at(k, k)];
    for (std::size_t i = k + 1; i < size_; ++i) {
      const double* a_ki = &from.train[at(k, i)];
      double* c = &factor_[i * lanes()];
      for (std::size_t f = 0; f < lanes(); ++f) c[f] = a_ki[f] / a_kk[f];
    }
    for (std::size_t i = k + 1; i < candidates_; ++i) {
      eliminate_row(from, to, k, i, i, last ? i + 1 : size_);
      if (last) eliminate_row(from, to, k, i, candidates_, size_);
    }
    for (std::size_t o = candidates_; o < size_; ++o) eliminate_row(from, to, k, o, o, o + 1);
  }

  const SubsetOptions& options_;
  std::size_t candidates_;
  std::size_t outputs_;
  std::size_t size_;
  std::size_t lanes_;
  std::vector<Level> levels_;
  std::vector<Best> best_;
  std::vector<std::size_t> of_group_;
  std::vector<double> factor_;
  std::vector<std::size_t> place_;  ///< search order -> candidate
  std::vector<std::size_t> chosen_;
  std::size_t required_{0};
  std::uint64_t judged_{0};
};

template <std::size_t fixed>
SubsetSearch search_with(const NormalEquations& equations, const SubsetOptions& options) {
  const std::size_t lanes = fixed != 0 ? fixed : (equations.folds.size() + 1) / 2 * 2;
  return Search<fixed>(equations, options, lanes).run();
}

}  // namespace

NormalEquations normal_equations(const MeasuredTests& tests, double sensor_error_K) {
  std::vector<Eigen::MatrixXd> columns;
  for (const TestRun& run : tests.runs) columns.push_back(run.places_K);
  return normal_equations(tests, columns, sensor_error_K);
}

NormalEquations normal_equations(const MeasuredTests& tests,
                                 const std::vector<Eigen::MatrixXd>& columns,
                                 double sensor_error_K) {
  NormalEquations equations;
  equations.candidates = columns[0].cols();
  equations.outputs = static_cast<Eigen::Index>(tests.outputs.size());
  std::vector<double> rows;
  const auto add = [&](const auto& x, const auto& y) {
    Eigen::MatrixXd all(x.rows(), x.cols() + y.cols());
    all << x, y;
    equations.folds.emplace_back(all.transpose() * all);
    rows.push_back(static_cast<double>(all.rows()));
  };
  for (const Fold& fold : tests.folds) {
    const Eigen::Index count = fold.end - fold.begin;
    add(columns[fold.run].middleRows(fold.begin, count),
        tests.runs[fold.run].outputs_um.middleRows(fold.begin, count));
  }
  equations.total = equations.folds[0];
  for (std::size_t f = 1; f < equations.folds.size(); ++f) equations.total += equations.folds[f];
  if (!tests.hot.rows.empty())
    add(columns[0](tests.hot.rows, Eigen::all),
        tests.runs[0].outputs_um(tests.hot.rows, Eigen::all));
  const auto places = static_cast<Eigen::Index>(tests.places.size());
  equations.reading_errors =
      Eigen::MatrixXd::Zero(equations.candidates, static_cast<Eigen::Index>(rows.size()));
  for (std::size_t f = 0; f < rows.size(); ++f)
    equations.reading_errors.col(static_cast<Eigen::Index>(f))
        .head(places)
        .setConstant(rows[f] * sensor_error_K * sensor_error_K);
  return equations;
}

double combinations(std::size_t candidates, std::size_t terms_min, std::size_t terms_max) {
  double sum = 0.0;
  double binomial = 1.0;
  for (std::size_t terms = 1; terms <= std::min(terms_max, candidates); ++terms) {
    binomial *= static_cast<double>(candidates - terms + 1) / static_cast<double>(terms);
    if (terms >= terms_min) sum += binomial;
  }
  return sum;
}

SubsetSearch search_subsets(const NormalEquations& equations, const SubsetOptions& options) {
  switch ((equations.folds.size() + 1) / 2) {
    case 1:
      return search_with<2>(equations, options);
    case 2:
      return search_with<4>(equations, options);
    case 3:
      return search_with<6>(equations, options);
    case 4:
      return search_with<8>(equations, options);
    case 5:
      return search_with<10>(equations, options);
    case 6:
      return search_with<12>(equations, options);
    default:
      return search_with<0>(equations, options);
  }
}

}  // namespace thermocomp::identification
