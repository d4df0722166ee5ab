#include "daemon/status/warm_up.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "estimator/model/displacement_model.hpp"

namespace thermocomp {
namespace {

/// Running sums of a straight-line fit.
struct LineSums {
  double count{0.0}, t{0.0}, tt{0.0}, y{0.0}, ty{0.0};
  void add(double time_s, double value) noexcept {
    count += 1.0;
    t += time_s;
    tt += time_s * time_s;
    y += value;
    ty += time_s * value;
  }
  [[nodiscard]] double slope() const noexcept {
    return (count * ty - t * y) / (count * tt - t * t);
  }
};

}  // namespace

bool TemperatureTrend::Change::is_uneven() const noexcept {
  return std::abs(rate_K_per_h) > even_rate_K_per_h_max && farthest_K >= change_K_min;
}

bool TemperatureTrend::is_due(nanoseconds now) const noexcept {
  if (rows_.empty()) return true;
  return now - rows_.back().at >= (rows_.size() < first_rows ? first_pace : pace);
}

void TemperatureTrend::note(nanoseconds now, const std::vector<std::string>& columns,
                            std::span<const InputReport> inputs) {
  if (columns != columns_) rows_.clear();
  columns_ = columns;
  Row& row = rows_.emplace_back();
  row.at = now;
  for (const InputReport& input : inputs)
    row.temps_degC.push_back(input.good ? input.temp_degC : not_a_number);
  while (now - rows_.front().at > window) rows_.pop_front();
}

TemperatureTrend::Change TemperatureTrend::change(std::size_t column, nanoseconds now,
                                                  double temp_degC) const {
  if (!std::isfinite(temp_degC)) return {};
  LineSums sums;
  // Relative to the present value, for precision.
  sums.add(0.0, 0.0);
  double first_s = 0.0;
  double farthest_K = 0.0;
  for (const Row& row : rows_) {
    if (row.at >= now || column >= row.temps_degC.size()) continue;
    if (!std::isfinite(row.temps_degC[column])) continue;
    const double time_s = to_seconds(row.at - now);
    first_s = std::min(first_s, time_s);
    const double difference_K = row.temps_degC[column] - temp_degC;
    farthest_K = std::max(farthest_K, std::abs(difference_K));
    sums.add(time_s, difference_K);
  }
  if (sums.count < 2.0) return {};
  return {3600.0 * sums.slope(), -first_s, farthest_K};
}

namespace {

constexpr std::array<double, 5> stretches_min{240.0, 120.0, 60.0, 30.0, 20.0};
constexpr std::size_t points_min = 15;
constexpr std::array<double, 4> taus_min{10.0, 30.0, 90.0, 270.0};
constexpr std::size_t usual_taus = 3;
constexpr double misfit_of_bound_max = 0.1;
constexpr double misfit_of_bound_small = 0.03;  ///< below this the fit is good enough
/// Required reduction of the squares for the slowest tau, which noise alone can imitate.
constexpr double squares_for_slowest = 0.7;

struct Point {
  double minutes{0.0};  ///< before now, negative
  double um{0.0};
};

/// Amplitudes a_k of one sign.
struct Approach {
  std::array<double, taus_min.size()> a_um{};
  double squares_um2{std::numeric_limits<double>::infinity()};

  [[nodiscard]] double remaining_um(double in_minutes) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < taus_min.size(); ++k)
      sum += a_um[k] * std::exp(-in_minutes / taus_min[k]);
    return std::abs(sum);
  }
};

using Columns = Eigen::Matrix<double, Eigen::Dynamic, static_cast<int>(taus_min.size()) + 1>;

/// Least squares for every subset of taus; returns the best with amplitudes of one sign.
Approach best_approach(const Columns& columns, const Eigen::VectorXd& course_um, std::size_t taus) {
  Approach best;
  for (unsigned chosen = 0; chosen < 1u << taus; ++chosen) {
    std::vector<Eigen::Index> used{static_cast<Eigen::Index>(taus_min.size())};  // the end
    for (std::size_t k = 0; k < taus; ++k)
      if ((chosen >> k & 1u) != 0) used.push_back(static_cast<Eigen::Index>(k));
    const Eigen::MatrixXd own = columns(Eigen::all, used);
    const Eigen::VectorXd found = (own.transpose() * own).ldlt().solve(own.transpose() * course_um);
    const auto amplitudes = found.tail(found.size() - 1);
    if (!found.allFinite() || ((amplitudes.array() > 0).any() && (amplitudes.array() < 0).any()))
      continue;
    const double squares_um2 = (course_um - own * found).squaredNorm();
    if (squares_um2 >= best.squares_um2) continue;
    best = {{}, squares_um2};
    for (std::size_t i = 1; i < used.size(); ++i)
      best.a_um[static_cast<std::size_t>(used[i])] = found[static_cast<Eigen::Index>(i)];
  }
  return best;
}

Approach approach_of(const std::vector<Point>& points, double bound_um) {
  Columns columns(static_cast<Eigen::Index>(points.size()),
                  static_cast<Eigen::Index>(taus_min.size()) + 1);
  Eigen::VectorXd course_um(columns.rows());
  for (Eigen::Index i = 0; i < columns.rows(); ++i) {
    const Point& point = points[static_cast<std::size_t>(i)];
    for (std::size_t k = 0; k < taus_min.size(); ++k)
      columns(i, static_cast<Eigen::Index>(k)) = std::exp(-point.minutes / taus_min[k]);
    columns(i, static_cast<Eigen::Index>(taus_min.size())) = 1.0;
    course_um[i] = point.um;
  }
  const Approach usual = best_approach(columns, course_um, usual_taus);
  const double enough_um = misfit_of_bound_small * bound_um;
  if (usual.squares_um2 < enough_um * enough_um * static_cast<double>(points.size())) return usual;
  const Approach slow = best_approach(columns, course_um, taus_min.size());
  return slow.squares_um2 < squares_for_slowest * usual.squares_um2 ? slow : usual;
}

}  // namespace

void WarmUp::note(nanoseconds now, std::vector<double> displacement_um, double bound_um) {
  if (!rows_.empty() && rows_.back().displacement_um.size() != displacement_um.size())
    rows_.clear();
  rows_.push_back({now, std::move(displacement_um)});
  while (now - rows_.front().at > window) rows_.pop_front();
  remaining_.clear();
  for (std::size_t axis = 0; axis < rows_.back().displacement_um.size(); ++axis)
    remaining_.push_back(remaining_of(axis, bound_um));
}

RemainingDrift WarmUp::remaining_of(std::size_t axis, double bound_um) const {
  for (const double stretch_min : stretches_min) {
    std::vector<Point> points;
    double first_min = 0.0;
    for (const Row& row : rows_) {
      const double minutes = 1e-9 / 60.0 * static_cast<double>((row.at - rows_.back().at).count());
      if (minutes < -stretch_min || !std::isfinite(row.displacement_um[axis])) continue;
      points.push_back({minutes, row.displacement_um[axis]});
      first_min = std::min(first_min, minutes);
    }
    // Not enough data for this duration: a shorter one is tried.
    if (points.size() < points_min || first_min > -0.9 * stretch_min) continue;
    const double middle_um = points.back().um;  // for precision
    for (Point& point : points) point.um -= middle_um;
    const Approach found = approach_of(points, bound_um);
    const double misfit_um = std::sqrt(found.squares_um2 / static_cast<double>(points.size()));
    if (misfit_um > misfit_of_bound_max * bound_um) continue;
    double minutes = 0.0;
    while (found.remaining_um(minutes) > bound_um) minutes += 1.0;
    return {found.remaining_um(0.0), minutes};
  }
  return {};
}

void SinceProbing::note(std::span<const AxisReport> axes, const std::string& model) {
  const bool is_other = model != model_;
  model_ = model;
  probed_.resize(axes.size());
  for (std::size_t i = 0; i < axes.size(); ++i) {
    Probed& probed = probed_[i];
    const double now_um = axes[i].displacement_um;
    if (is_other) probed.displacement_um += now_um - probed.last_um;
    if (probed.probings != axes[i].probings || !std::isfinite(probed.displacement_um))
      probed.displacement_um = now_um;
    probed.probings = axes[i].probings;
    probed.last_um = now_um;
  }
}

double SinceProbing::error_um(std::size_t axis, const AxisReport& now, const ThermalModel& model,
                              const std::string& output, bool is_corrected) const {
  if (is_corrected) return now.correction.sd_um;
  if (!model.made_from || axis >= probed_.size()) return not_a_number;
  const auto found = model.made_from->outputs.find(output);
  if (found == model.made_from->outputs.end() || !(found->second.no_model_rms_um > 0.0))
    return not_a_number;
  return spread_um(*model.made_from, found->second, false) / found->second.no_model_rms_um *
         std::abs(now.displacement_um - probed_[axis].displacement_um);
}

}  // namespace thermocomp
