#include "modelling/identification/gate/tie_course.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/checks.hpp"
#include "modelling/identification/measured_tests.hpp"
#include "modelling/identification/printed.hpp"
#include "modelling/identification/svg.hpp"

namespace thermocomp::identification {
namespace {

constexpr double s_per_min = 60.0;
constexpr int heights = 200;  // of a curve of the picture
constexpr double diagram_px = 320.0;

/// Every column that the file names, each once; and that each run has it.
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

/// Mean rise of some places; those that never move were left out and count as 0.
Eigen::VectorXd mean_K(const MeasuredTests& tests, const TestRun& run,
                       const std::vector<std::string>& names) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(run.time_s.size());
  for (const std::string& name : names) {
    const auto found = std::find(tests.places.begin(), tests.places.end(), name);
    if (found != tests.places.end()) sum += run.places_K.col(found - tests.places.begin());
  }
  return sum / static_cast<double>(names.size());
}

Curve course_curve(const TieCourse& course, const TiedCoefficients& k, const char* name,
                   const char* colour, bool dashed) {
  const Eigen::VectorXd um = displacement_um(course, k);
  Curve curve{printed("%s: %.3g um", name, um.maxCoeff() - um.minCoeff()), {}, {}, colour, dashed};
  for (Eigen::Index i = 0; i < um.size(); ++i) {
    curve.x.push_back((course.time_s[i] - course.time_s[0]) / s_per_min);
    curve.y.push_back(um[i]);
  }
  return curve;
}

Diagram swing_diagram(const GateFile& file, const std::vector<TieCourse>& courses,
                      const TiedColumns& best) {
  Diagram diagram{"Swing over the height of a tie, the others at their best",
                  "height, mm",
                  "swing, um",
                  {},
                  720.0,
                  diagram_px};
  for (std::size_t j = 0; j < best.ties.size(); ++j) {
    const Bounds bounds = file.choices[j].height_mm;
    Curve curve{
        printed("tie %zu, best at %.4g mm", j + 1, best.ties[j].height_mm), {}, {}, "", false};
    TiedColumns other = best;
    for (int i = 0; i <= heights; ++i) {
      other.ties[j].height_mm = bounds.low + (bounds.high - bounds.low) * i / heights;
      curve.x.push_back(other.ties[j].height_mm);
      curve.y.push_back(swing_um(courses, tied_coefficients(other)));
    }
    diagram.curves.push_back(std::move(curve));
  }
  return diagram;
}

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

std::string tie_picture(const GateFile& file, const std::vector<TieCourse>& courses,
                        const TiedColumns* best) {
  TiedColumns free = file.columns;
  free.ties.clear();
  const std::size_t diagrams = courses.size() + (best == nullptr ? 0 : 1);
  std::string text = printed(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"720\" "
      "height=\"%.0f\">\n",
      (diagram_px + 10.0) * static_cast<double>(diagrams));
  double top_px = 0.0;
  const auto add = [&](const Diagram& diagram) {
    text += printed("<g transform=\"translate(0 %.0f)\">\n", top_px);
    text += svg_of(diagram) + "</g>\n";
    top_px += diagram_px + 10.0;
  };
  for (const TieCourse& course : courses) {
    Diagram diagram{course.name, "min", "displacement, um", {}, 720.0, diagram_px};
    diagram.curves.push_back(
        course_curve(course, tied_coefficients(free), "no tie", "#a0a0a0", true));
    diagram.curves.push_back(
        course_curve(course, tied_coefficients(file.columns), "as drawn", "#1b6ca8", false));
    if (best != nullptr)
      diagram.curves.push_back(
          course_curve(course, tied_coefficients(*best), "best ties", "#c8502c", false));
    add(diagram);
  }
  if (best != nullptr) add(swing_diagram(file, courses, *best));
  return text + "</svg>\n";
}

}  // namespace thermocomp::identification
