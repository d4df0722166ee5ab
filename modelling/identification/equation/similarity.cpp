#include "modelling/identification/equation/similarity.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>

#include "report/svg_plot.hpp"

namespace thermocomp::identification {
namespace {

/// Upper limit of the automatic threshold.
constexpr double threshold_max = 0.3;

struct Pair {
  double s;
  std::size_t a;
  std::size_t b;
};

std::vector<Pair> sorted_pairs(const Eigen::MatrixXd& s) {
  std::vector<Pair> pairs;
  const Eigen::Index places = s.rows();
  for (Eigen::Index a = 0; a < places; ++a)
    for (Eigen::Index b = 0; b < places; ++b)
      if (a != b && std::isfinite(s(a, b)))
        pairs.push_back({s(a, b), static_cast<std::size_t>(a), static_cast<std::size_t>(b)});
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& x, const Pair& y) { return x.s < y.s; });
  return pairs;
}

std::size_t root_of(std::vector<std::size_t>& parent, std::size_t place) {
  while (parent[place] != place) place = parent[place] = parent[parent[place]];
  return place;
}

std::vector<std::vector<std::size_t>> groups_of(std::vector<std::size_t>& parent) {
  std::vector<std::vector<std::size_t>> by_root(parent.size());
  for (std::size_t place = 0; place < parent.size(); ++place)
    by_root[root_of(parent, place)].push_back(place);
  std::erase_if(by_root, [](const auto& group) { return group.empty(); });
  std::stable_sort(by_root.begin(), by_root.end(), [](const auto& a, const auto& b) {
    return a.size() != b.size() ? a.size() > b.size() : a.front() < b.front();
  });
  return by_root;
}

auto rows_of(const TestRun& run) {
  return run.places_K.bottomRows(run.places_K.rows() - run.begin);
}

Eigen::VectorXd mean_squares(const MeasuredTests& tests) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(tests.places.size()));
  for (const TestRun& run : tests.runs) sum += rows_of(run).colwise().squaredNorm();
  return sum / static_cast<double>(tests.rows());
}

/// Part of each place's second differences that the other places do not explain. Rows ten minutes
/// apart contain motion, which neighbours share, and noise, which they do not. A place with a
/// motion of its own keeps it in this part, so the part is limited to twice the median of all
/// places (RMS).
/// @param products  of the places' second differences, summed over `count` rows
Eigen::VectorXd own_parts(const Eigen::MatrixXd& products, double count) {
  const Eigen::VectorXd whole = products.diagonal();
  const auto places = static_cast<double>(whole.size());
  if (count < 3.0 * places || !(whole.minCoeff() > 0)) return whole;
  const Eigen::VectorXd size = whole.cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd correlation = size.asDiagonal() * products * size.asDiagonal();
  correlation.diagonal().array() += 1e-9;
  // 1 / (R^-1)_ii is the share of column i that the other columns do not explain.
  const Eigen::MatrixXd inverse =
      correlation.ldlt().solve(Eigen::MatrixXd::Identity(correlation.rows(), correlation.cols()));
  Eigen::VectorXd own = whole.cwiseQuotient(inverse.diagonal()) * (count / (count - places + 1.0));
  std::vector<double> sorted(own.begin(), own.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return own.cwiseMin(4.0 * *middle);
}

}  // namespace

Eigen::MatrixXd similarity(const MeasuredTests& tests, bool relative, LargestOver over) {
  const auto places = static_cast<Eigen::Index>(tests.places.size());
  std::vector<Eigen::VectorXd> largest;  // by test
  for (const TestRun& run : tests.runs)
    largest.emplace_back(rows_of(run).cwiseAbs().colwise().maxCoeff().transpose());
  if (over == LargestOver::all_tests) {
    Eigen::VectorXd of_all = Eigen::VectorXd::Zero(places);
    for (const Eigen::VectorXd& each : largest) of_all = of_all.cwiseMax(each);
    std::fill(largest.begin(), largest.end(), of_all);
  }
  Eigen::MatrixXd crosses = Eigen::MatrixXd::Zero(places, places);  // of A / max|dT_A| and B
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(places);
  Eigen::VectorXd scaled_squares = Eigen::VectorXd::Zero(places);
  for (std::size_t i = 0; i < tests.runs.size(); ++i) {
    const auto rows = rows_of(tests.runs[i]);
    // A place that does not move in a test contributes nothing there.
    const Eigen::VectorXd scale =
        (largest[i].array() > 0).select(largest[i].cwiseInverse(), Eigen::VectorXd::Zero(places));
    const Eigen::MatrixXd scaled = rows * scale.asDiagonal();
    crosses.noalias() += scaled.transpose() * rows;
    squares += rows.colwise().squaredNorm().transpose();
    scaled_squares += scaled.colwise().squaredNorm().transpose();
  }
  Eigen::MatrixXd s(places, places);
  for (Eigen::Index a = 0; a < places; ++a) {
    for (Eigen::Index b = 0; b < places; ++b) {
      const double cross = std::max(0.0, crosses(a, b));  // alpha >= 0
      const double cosine2 = cross * cross / (scaled_squares[a] * squares[b]);
      const bool itself = a == b && over == LargestOver::all_tests;
      const double shape = itself ? 0.0 : std::max(0.0, 1.0 - cosine2);
      s(a, b) = relative ? shape : shape * scaled_squares[a];
    }
  }
  return s;
}

Eigen::MatrixXd noise_floor(const MeasuredTests& tests) {
  const auto places = static_cast<Eigen::Index>(tests.places.size());
  Eigen::MatrixXd second = Eigen::MatrixXd::Zero(places, places);  // products of second differences
  double count = 0.0;
  for (const TestRun& run : tests.runs) {
    const Eigen::Index rows = run.places_K.rows();
    if (rows < 3) continue;
    const Eigen::MatrixXd each = run.places_K.topRows(rows - 2) -
                                 2.0 * run.places_K.middleRows(1, rows - 2) +
                                 run.places_K.bottomRows(rows - 2);
    second.noalias() += each.transpose() * each;
    count += static_cast<double>(rows - 2);
  }
  // A second difference of white noise has six times its variance. A rise contains the noise of its
  // own row and of the reference row.
  const Eigen::VectorXd noise = own_parts(second, count) / (6.0 * std::max(count, 1.0));
  const Eigen::VectorXd share = (2.0 * noise).cwiseQuotient(mean_squares(tests));
  Eigen::MatrixXd floor(places, places);
  for (Eigen::Index a = 0; a < places; ++a)
    for (Eigen::Index b = 0; b < places; ++b) floor(a, b) = share[a] + share[b];
  return floor;
}

Grouping group_places(const Eigen::MatrixXd& s, double threshold) {
  Grouping grouping;
  grouping.threshold = threshold;
  grouping.threshold_given = true;
  std::vector<std::size_t> parent(static_cast<std::size_t>(s.rows()));
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  std::vector<std::size_t> all = parent;
  std::size_t left = parent.size();
  for (const Pair& pair : sorted_pairs(s)) {
    if (pair.s <= threshold) parent[root_of(parent, pair.a)] = root_of(parent, pair.b);
    const std::size_t a = root_of(all, pair.a);
    const std::size_t b = root_of(all, pair.b);
    if (a == b) continue;
    all[a] = b;
    grouping.merges.push_back({pair.s, --left});
  }
  grouping.groups = groups_of(parent);
  return grouping;
}

Grouping group_places(const Eigen::MatrixXd& s, const Eigen::MatrixXd& floor) {
  // A pair that differs by less than its noise counts as alike.
  const Eigen::MatrixXd raised = s.cwiseMax(floor);
  const std::vector<Merge> merges = group_places(raised, 0.0).merges;
  double threshold = 0.0;
  double widest = 1.0;
  for (std::size_t i = 0; i <= merges.size(); ++i) {
    const double below = i == 0 ? floor.minCoeff() : merges[i - 1].threshold;
    const double above = i == merges.size() ? 1.0 : merges[i].threshold;
    if (!(below > 0) || below > threshold_max) continue;
    const double ratio = above / below;
    if (ratio <= widest) continue;
    widest = ratio;
    threshold = std::min(std::sqrt(below * above), threshold_max);
  }
  Grouping grouping = group_places(raised, threshold);
  grouping.threshold_given = false;
  return grouping;
}

Drawing groups_drawing(const std::string& title, const std::vector<std::string>& names,
                       const Eigen::MatrixXd& s, const Grouping& grouping) {
  HeatMap map{title, {}, {}, {}};
  std::vector<std::size_t> order;
  for (const auto& group : grouping.groups) {
    order.insert(order.end(), group.begin(), group.end());
    map.group_sizes.push_back(group.size());
  }
  for (const std::size_t row : order) {
    map.names.push_back(names[row]);
    std::vector<double>& values = map.values.emplace_back();
    for (const std::size_t column : order)
      values.push_back(s(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)));
  }
  return heat_map_drawing(map);
}

}  // namespace thermocomp::identification
