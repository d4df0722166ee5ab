/// best_ties() of tie_course.hpp.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "modelling/identification/gate/tie_course.hpp"

namespace thermocomp::identification {
namespace {

// Differential evolution (Storn and Price 1997), each mutation with a factor of its own.
constexpr std::uint64_t seed = 1995;
constexpr std::size_t members_each_variable = 12;
constexpr int generations_max = 600;
constexpr double crossing = 0.9;
constexpr double factor_min = 0.4;
constexpr double factor_max = 1.0;
constexpr double swing_same_um = 1e-7;  // the members have met
constexpr Eigen::Index rows_max = 2000;

using Point = std::vector<double>;  ///< of each variable its place between its bounds, 0..1

/// One thing that may be chosen: the height or the area of a tie.
struct Variable {
  std::size_t tie;
  bool is_area;
  Bounds bounds;

  [[nodiscard]] double value(double share) const {
    return is_area ? bounds.low * std::pow(bounds.high / bounds.low, share)
                   : bounds.low + (bounds.high - bounds.low) * share;
  }
  [[nodiscard]] double share(double value) const {
    const double at = is_area ? std::log(value / bounds.low) / std::log(bounds.high / bounds.low)
                              : (value - bounds.low) / (bounds.high - bounds.low);
    return std::clamp(at, 0.0, 1.0);
  }
  [[nodiscard]] double& of(TiedColumns& columns) const {
    return is_area ? columns.ties[tie].area_mm2 : columns.ties[tie].height_mm;
  }
};

std::vector<Variable> variables_of(const GateFile& file) {
  std::vector<Variable> variables;
  for (std::size_t i = 0; i < file.choices.size(); ++i) {
    const TieChoice& choice = file.choices[i];
    if (choice.height_mm.low < choice.height_mm.high)
      variables.push_back({i, false, choice.height_mm});
    if (choice.area_mm2.low < choice.area_mm2.high) variables.push_back({i, true, choice.area_mm2});
  }
  if (variables.empty())
    throw ConfigurationError({Problem{file.name, 0, "tie", "fixed",
                                      "at least one tie must have a range of heights or areas"}});
  return variables;
}

/// Every n-th row of the courses, so that there are not too many.
std::vector<TieCourse> thinned(const std::vector<TieCourse>& courses) {
  Eigen::Index rows = 0;
  for (const TieCourse& course : courses) rows += course.time_s.size();
  const Eigen::Index stride = rows / rows_max + 1;
  if (stride == 1) return courses;
  std::vector<TieCourse> result;
  for (const TieCourse& course : courses) {
    std::vector<Eigen::Index> kept;
    for (Eigen::Index i = 0; i < course.time_s.size(); i += stride) kept.push_back(i);
    result.push_back({course.name, course.time_s(kept), course.rises_K(kept, Eigen::all)});
  }
  return result;
}

class Search {
 public:
  Search(const GateFile& file, const std::vector<TieCourse>& courses)
      : variables_(variables_of(file)), start_(bounded(file)), courses_(thinned(courses)) {
    Point drawn;
    for (const Variable& each : variables_) drawn.push_back(each.share(each.of(start_)));
    members_.push_back(drawn);
    const std::size_t count = std::max<std::size_t>(members_each_variable * drawn.size(), 16);
    while (members_.size() < count) {
      Point point(drawn.size());
      for (double& each : point) each = uniform();
      members_.push_back(point);
    }
    for (const Point& each : members_) swings_um_.push_back(swing_of(each));
  }

  TiedColumns best() {
    for (int generation = 0; generation < generations_max && !met(); ++generation)
      for (std::size_t i = 0; i < members_.size(); ++i) improve(i);
    const auto least = std::min_element(swings_um_.begin(), swings_um_.end());
    return columns_at(members_[static_cast<std::size_t>(least - swings_um_.begin())]);
  }

 private:
  /// What cannot be chosen is at its only value, even where the drawing has another.
  static TiedColumns bounded(const GateFile& file) {
    TiedColumns columns = file.columns;
    for (std::size_t i = 0; i < columns.ties.size(); ++i) {
      const TieChoice& choice = file.choices[i];
      Tie& tie = columns.ties[i];
      tie.height_mm = std::clamp(tie.height_mm, choice.height_mm.low, choice.height_mm.high);
      tie.area_mm2 = std::clamp(tie.area_mm2, choice.area_mm2.low, choice.area_mm2.high);
    }
    return columns;
  }
  [[nodiscard]] TiedColumns columns_at(const Point& point) const {
    TiedColumns columns = start_;
    for (std::size_t i = 0; i < point.size(); ++i)
      variables_[i].of(columns) = variables_[i].value(point[i]);
    return columns;
  }
  [[nodiscard]] double swing_of(const Point& point) const {
    return swing_um(courses_, tied_coefficients(columns_at(point)));
  }
  /// The same on every machine, which standard distributions need not be.
  double uniform() { return static_cast<double>(engine_() >> 11U) * 0x1p-53; }
  std::size_t another() { return static_cast<std::size_t>(engine_() % members_.size()); }

  [[nodiscard]] bool met() const {
    const auto [least, most] = std::minmax_element(swings_um_.begin(), swings_um_.end());
    return *most - *least < swing_same_um;
  }
  void improve(std::size_t i) {
    const Point& a = members_[another()];
    const Point& b = members_[another()];
    const Point& c = members_[another()];
    const double factor = factor_min + (factor_max - factor_min) * uniform();
    const auto kept = static_cast<std::size_t>(engine_() % variables_.size());
    Point trial = members_[i];
    for (std::size_t j = 0; j < trial.size(); ++j)
      if (j == kept || uniform() < crossing)
        trial[j] = std::clamp(a[j] + factor * (b[j] - c[j]), 0.0, 1.0);
    const double swing = swing_of(trial);
    if (swing <= swings_um_[i]) members_[i] = std::move(trial), swings_um_[i] = swing;
  }

  std::vector<Variable> variables_;
  TiedColumns start_;
  std::vector<TieCourse> courses_;
  std::mt19937_64 engine_{seed};
  std::vector<Point> members_;
  std::vector<double> swings_um_;
};

}  // namespace

TiedColumns best_ties(const GateFile& file, const std::vector<TieCourse>& courses) {
  return Search(file, courses).best();
}

}  // namespace thermocomp::identification
