#include "cli/model/course_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "config/runs/model_inputs.hpp"
#include "estimator/learning/probings.hpp"
#include "estimator/learning/recorded_course.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp::cli {
namespace {

using Point = RecordedCourse::Point;

constexpr std::array<double, 4> bandwidths{0.125, 0.25, 0.5, 1.0};
constexpr double bandwidth_of_one_run = 0.5;

/// A point with the groups' contributions, which convert gains to displacement.
struct LearnedPoint {
  Point point;
  std::vector<double> contribution_um;
};
using OfRuns = std::vector<std::vector<LearnedPoint>>;  ///< one list per run

/// Steps the correction of one output through a run.
class CorrectionRun {
 public:
  CorrectionRun(const RunFile& run, const ThermalModel& model, const CorrectionConfig& correction,
                std::size_t output)
      : inputs_(model_inputs(model, run)),
        time_s_(run.time_s()),
        model_(model),
        correction_(correction),
        output_(output),
        displacement_(model),
        learning_(correction, model, output),
        phase_(correction.turn_um),
        values_um_(model.outputs.size()) {
    const auto column = run.find(model.outputs[output]);
    measured_um_ = column ? &run.values[*column] : nullptr;
  }

  std::vector<LearnedPoint> take(double every_s) {
    std::vector<LearnedPoint> learned_points;
    if (measured_um_ == nullptr) return learned_points;
    double first_um = not_a_number;
    double model_first_um = 0.0;
    double probed_at_s = -std::numeric_limits<double>::infinity();
    for (const std::size_t row : inputs_.rows) {
      step(row);
      const double measured_um = (*measured_um_)[row];
      if (!std::isfinite(measured_um) || time_s_[row] < probed_at_s + every_s) continue;
      probed_at_s = time_s_[row];
      if (!std::isfinite(first_um)) {
        first_um = measured_um;
        model_first_um = values_um_[output_];
        continue;
      }
      const std::uint64_t before = learning_.report().taken;
      learning_.measured({measured_um - first_um, values_um_[output_] - model_first_um});
      if (learning_.report().taken > before) learned_points.push_back(point());
    }
    return learned_points;
  }

 private:
  void step(std::size_t row) {
    const auto values_at = [row](const auto& columns) {
      std::vector<double> values;
      values.reserve(columns.size());
      for (const std::vector<double>* column : columns) values.push_back((*column)[row]);
      return values;
    };
    const nanoseconds now = time_of_row(time_s_[row]);
    rise_K_ = values_at(inputs_.temperatures);
    displacement_.step(now, rise_K_, inputs_.reference_degC, values_at(inputs_.signals),
                       values_um_);
    for (std::size_t i = 0; i < rise_K_.size(); ++i) rise_K_[i] -= inputs_.reference_degC[i];
    learning_.step(now, rise_K_, true);
    contribution_um_ = contributions();
    double sum_um = 0.0;
    for (const double each : contribution_um_) sum_um += each;
    phase_.step(now, contribution_um_.front(), sum_um);
  }

  [[nodiscard]] std::vector<double> contributions() const {
    std::vector<double> sums;
    for (const std::vector<std::string>& group : correction_.groups) {
      double sum_um = 0.0;
      for (const std::string& name : group) {
        const auto input = static_cast<std::size_t>(
            std::find(model_.inputs.begin(), model_.inputs.end(), name) - model_.inputs.begin());
        sum_um += model_.matrix_um_per_K[output_][input] * rise_K_[input];
      }
      sums.push_back(sum_um);
    }
    return sums;
  }

  [[nodiscard]] LearnedPoint point() const {
    const CorrectionReport report = learning_.report();
    Point point{phase_.phase(), phase_.since_s(), rise_K_, {}, {}};
    point.rise_K.resize(model_.inputs.size());
    for (std::size_t g = 0; g < correction_.groups.size(); ++g) {
      point.gain.push_back(report.gain[g]);
      point.sd.push_back(deviation(report, g));
    }
    return {point, contribution_um_};
  }

  /// Without a filter, a gain is as uncertain as its probing; Rc is unknown until the turn.
  [[nodiscard]] double deviation(const CorrectionReport& report, std::size_t group) const {
    if (correction_.form == CorrectionForm::recursive) return report.gain_sd[group];
    if (group == 1 && report.phase == 1) return correction_.gain_sd;
    return std::min(correction_.gain_sd,
                    correction_.noise_um / std::max(std::abs(contribution_um_[group]),
                                                    correction_.contribution_um_min));
  }

  ModelInputs inputs_;
  const std::vector<double>& time_s_;
  const ThermalModel& model_;
  const CorrectionConfig& correction_;
  std::size_t output_;
  DisplacementModel displacement_;
  RunningCorrection learning_;
  HeatPhase phase_;
  const std::vector<double>* measured_um_{nullptr};
  std::vector<double> values_um_;
  std::vector<double> rise_K_;
  std::vector<double> contribution_um_;
};

std::vector<Point> thinned(const OfRuns& runs, std::size_t left_out) {
  std::vector<Point> all;
  for (std::size_t i = 0; i < runs.size(); ++i)
    if (i != left_out)
      for (const LearnedPoint& each : runs[i]) all.push_back(each.point);
  const std::size_t stride = (all.size() + course_points_max - 1) / course_points_max;
  std::vector<Point> kept;
  for (std::size_t i = 0; i < all.size(); i += std::max<std::size_t>(1, stride))
    kept.push_back(all[i]);
  return kept;
}

/// Mean square displacement error of gains from the other runs [um^2].
double left_out_square(const OfRuns& runs, const ThermalModel& model, std::size_t output,
                       RecordedCourse course, double gain_sd) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t run = 0; run < runs.size(); ++run) {
    course.outputs[model.outputs[output]] = thinned(runs, run);
    const CourseLookup lookup(course, model, output, gain_sd);
    for (const LearnedPoint& each : runs[run]) {
      const RecordedGains recorded =
          lookup.at(each.point.phase, each.point.since_s, each.point.rise_K);
      double missed_um = 0.0;
      for (std::size_t g = 0; g < each.contribution_um.size(); ++g)
        missed_um += (recorded.gain[g] - each.point.gain[g]) * each.contribution_um[g];
      sum += missed_um * missed_um;
      ++count;
    }
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, count));
}

/// Mean square displacement error of gains of 1 [um^2].
double square_without(const OfRuns& runs) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const std::vector<LearnedPoint>& run : runs) {
    for (const LearnedPoint& each : run) {
      double missed_um = 0.0;
      for (std::size_t g = 0; g < each.contribution_um.size(); ++g)
        missed_um += (1.0 - each.point.gain[g]) * each.contribution_um[g];
      sum += missed_um * missed_um;
      ++count;
    }
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, count));
}

std::size_t index_of_output(const ThermalModel& model, const std::string& name) {
  return static_cast<std::size_t>(std::find(model.outputs.begin(), model.outputs.end(), name) -
                                  model.outputs.begin());
}

void choose_bandwidth(const std::map<std::string, OfRuns>& learned_points,
                      const ThermalModel& model, double gain_sd, CourseFit& fit) {
  double best = std::numeric_limits<double>::infinity();
  for (const double bandwidth : bandwidths) {
    RecordedCourse course = fit.course;
    course.bandwidth = bandwidth;
    std::map<std::string, double> rms_um;
    double sum = 0.0;
    for (const auto& [name, of_runs] : learned_points) {
      const double square =
          left_out_square(of_runs, model, index_of_output(model, name), course, gain_sd);
      rms_um[name] = std::sqrt(square);
      sum += square;
    }
    if (!(sum < best)) continue;
    best = sum;
    fit.course.bandwidth = bandwidth;
    fit.left_out_rms_um = rms_um;
  }
  for (const auto& [name, of_runs] : learned_points)
    fit.without_rms_um[name] = std::sqrt(square_without(of_runs));
}

}  // namespace

CourseFit fit_course(std::span<const RunFile> runs, const ThermalModel& given,
                     const CorrectionConfig& correction, double every_s) {
  ThermalModel model = given;
  model.course.reset();
  CourseFit fit;
  fit.course.groups = correction.groups;
  fit.course.bandwidth = bandwidth_of_one_run;
  for (const RunFile& run : runs) fit.course.runs.push_back(run.name);
  std::map<std::string, OfRuns> learned_points;
  for (std::size_t output = 0; output < model.outputs.size(); ++output) {
    const std::string& name = model.outputs[output];
    for (const RunFile& run : runs) {
      std::vector<LearnedPoint> one = CorrectionRun(run, model, correction, output).take(every_s);
      if (one.empty()) continue;
      fit.probings[name] += one.size();
      learned_points[name].push_back(std::move(one));
    }
  }
  if (learned_points.empty())
    throw ConfigurationError({{runs.empty() ? "correction" : runs.front().name, 0, "rows",
                               "none of them determines a gain",
                               "must have measured values of an output of the model, at states in "
                               "which its groups contribute contribution_um_min or more"}});
  if (runs.size() > 1) choose_bandwidth(learned_points, model, correction.gain_sd, fit);
  for (const auto& [name, of_runs] : learned_points)
    fit.course.outputs[name] = thinned(of_runs, of_runs.size());
  return fit;
}

}  // namespace thermocomp::cli
