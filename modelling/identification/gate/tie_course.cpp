#include "modelling/identification/gate/tie_course.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include "estimator/checks.hpp"
#include "modelling/identification/measured_tests.hpp"
#include "modelling/identification/printed.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::identification {
namespace {

constexpr double s_per_min = 60.0;
constexpr int heights = 200;  // steps of a curve in the plot
constexpr double panel_px = 240.0;

/// Every column that the file names, once each. @throws ConfigurationError if a run lacks one
std::vector<std::string> named_places(const GateFile& file, const std::vector<RunFile>& runs) {
  std::vector<std::string> names;
  std::vector<Problem> problems;
  const auto add = [&](const std::vector<std::string>& some, const std::string& key) {
    for (const std::string& name : some) {
      for (const RunFile& run : runs)
        if (!run.find(name))
          problems.push_back({run.name, 0, name, "(missing)",
                              "must be a column of the run, or " + key + " in " + file.name +
                                  " must name another one"});
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  };
  add(file.side_a, "course.side_a");
  add(file.side_b, "course.side_b");
  for (std::size_t i = 0; i < file.choices.size(); ++i)
    add(file.choices[i].temperatures, file.choices.size() == 1
                                          ? std::string("tie.temperatures")
                                          : "tie[" + std::to_string(i + 1) + "].temperatures");
  if (!problems.empty()) throw ConfigurationError(std::move(problems));
  return names;
}

/// Mean rise of some places; places that never move are not in `tests` and count as 0.
Eigen::VectorXd mean_K(const MeasuredTests& tests, const TestRun& run,
                       const std::vector<std::string>& names) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(run.time_s.size());
  for (const std::string& name : names) {
    const auto found = std::find(tests.places.begin(), tests.places.end(), name);
    if (found != tests.places.end()) sum += run.places_K.col(found - tests.places.begin());
  }
  return sum / static_cast<double>(names.size());
}

struct NamedColumns {
  const char* name;
  const char* colour;
  TiedColumns columns;
};

Drawing course_drawing(const TieCourse& course, const std::vector<NamedColumns>& all) {
  std::vector<double> minutes;
  for (const double time_s : course.time_s)
    minutes.push_back((time_s - course.time_s[0]) / s_per_min);
  std::vector<Eigen::VectorXd> values;
  PlotPanel panel{course.name, "displacement, um", {}, panel_px};
  for (const NamedColumns& each : all) {
    const Eigen::VectorXd& um =
        values.emplace_back(displacement_um(course, tied_coefficients(each.columns)));
    panel.lines.push_back(
        {printed("%s: %.3g um", each.name, um.maxCoeff() - um.minCoeff()), each.colour, {}});
  }
  for (std::size_t i = 0; i < all.size(); ++i)
    panel.lines[i].values = {values[i].data(), static_cast<std::size_t>(values[i].size())};
  return curves_drawing(minutes, "min", {panel});
}

Drawing swing_drawing(const GateFile& file, const std::vector<TieCourse>& courses,
                      const TiedColumns& best, std::size_t tie) {
  const Bounds bounds = file.choices[tie].height_mm;
  std::vector<double> heights_mm;
  std::vector<double> swings_um;
  TiedColumns other = best;
  for (int i = 0; i <= heights; ++i) {
    other.ties[tie].height_mm = bounds.low + (bounds.high - bounds.low) * i / heights;
    heights_mm.push_back(other.ties[tie].height_mm);
    swings_um.push_back(swing_um(courses, tied_coefficients(other)));
  }
  const std::string name = printed("tie %zu, best at %.4g mm", tie + 1, best.ties[tie].height_mm);
  return curves_drawing(heights_mm, "height, mm",
                        {{"Swing over the height of a tie, the others at their optimum",
                          "swing, um",
                          {{name, "#1b6ca8", swings_um}},
                          panel_px}});
}

// Differential evolution (Storn and Price 1997) with a random factor for each mutation.
constexpr std::uint64_t seed = 1995;
constexpr std::size_t members_each_variable = 12;
constexpr int generations_max = 600;
constexpr double crossing = 0.9;
constexpr double factor_min = 0.4;
constexpr double factor_max = 1.0;
constexpr double swing_same_um = 1e-7;  // spread of the members at convergence
constexpr Eigen::Index rows_max = 2000;

using Point = std::vector<double>;  ///< position of each variable between its bounds, 0..1

/// Variable of the search: height or area of a tie.
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

/// Every n-th row of the courses, about rows_max in all.
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

class TieSearch {
 public:
  TieSearch(const GateFile& file, const std::vector<TieCourse>& courses)
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
  /// Moves each tie into its bounds; a fixed height or area overrides the drawn one.
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
  /// Identical on every platform, unlike standard distributions.
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

std::vector<TieCourse> tie_courses(const GateFile& file, const std::vector<RunFile>& runs,
                                   std::vector<std::string>& notes) {
  TestOptions options;
  options.places = named_places(file, runs);
  const MeasuredTests tests = measured_tests(runs, options);
  notes = tests.notes;
  std::vector<TieCourse> courses;
  for (const TestRun& run : tests.runs) {
    const auto ties = static_cast<Eigen::Index>(file.choices.size());
    const Eigen::Index rows = run.time_s.size() - run.begin;
    Eigen::MatrixXd rises_K(run.time_s.size(), 1 + ties);
    rises_K.col(0) = mean_K(tests, run, file.side_a) - mean_K(tests, run, file.side_b);
    for (Eigen::Index j = 0; j < ties; ++j) {
      const TieChoice& choice = file.choices[static_cast<std::size_t>(j)];
      rises_K.col(1 + j) = choice.rise_factor * mean_K(tests, run, choice.temperatures);
    }
    courses.push_back({run.name, run.time_s.tail(rows), rises_K.bottomRows(rows)});
  }
  return courses;
}

Eigen::VectorXd displacement_um(const TieCourse& course, const TiedCoefficients& k) {
  const auto ties = static_cast<Eigen::Index>(k.kc_um_per_K.size());
  THERMOCOMP_ENSURE(ties == 0 || ties + 1 == course.rises_K.cols());
  const Eigen::Map<const Eigen::VectorXd> kc(k.kc_um_per_K.data(), ties);
  Eigen::VectorXd um = k.ki_um_per_K * course.rises_K.col(0);
  if (ties > 0) um -= course.rises_K.rightCols(ties) * kc;
  return um;
}

double swing_um(const std::vector<TieCourse>& courses, const TiedCoefficients& k) {
  double swing = 0.0;
  for (const TieCourse& course : courses) {
    const Eigen::VectorXd um = displacement_um(course, k);
    swing = std::max(swing, um.maxCoeff() - um.minCoeff());
  }
  return swing;
}

TiedColumns best_ties(const GateFile& file, const std::vector<TieCourse>& courses) {
  return TieSearch(file, courses).best();
}

std::string tie_picture(const GateFile& file, const std::vector<TieCourse>& courses,
                        const TiedColumns* best) {
  std::vector<NamedColumns> shown{{"no tie", "#a0a0a0", file.columns},
                                  {"as drawn", "#1b6ca8", file.columns}};
  shown.front().columns.ties.clear();
  if (best != nullptr) shown.push_back({"best ties", "#c8502c", *best});
  std::vector<Drawing> drawings;
  for (const TieCourse& course : courses) drawings.push_back(course_drawing(course, shown));
  for (std::size_t tie = 0; best != nullptr && tie < best->ties.size(); ++tie)
    drawings.push_back(swing_drawing(file, courses, *best, tie));
  return svg_file(drawings);
}

}  // namespace thermocomp::identification
