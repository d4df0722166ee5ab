#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include <Eigen/LU>

#include "config/runs/robust.hpp"
#include "config/text/units.hpp"
#include "modelling/inspection/checks.hpp"
#include "modelling/inspection/expectation.hpp"

namespace thermocomp::inspection {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Delays of the inputs: places of a spindle respond minutes to an hour apart.
constexpr std::array<double, 2> lags_s{600.0, 3600.0};
// Response to one kelvin of a neighbour: about 1 K of a reading, some tens of um.
constexpr double prior_K_per_K = 1.0;
constexpr double prior_um_per_K = 20.0;
constexpr Index rows_min = 40;  // per run, needed for the remainder's colour
// Smallest faults reported: a thermocouple's tolerance, and 1 um of displacement.
constexpr double step_K_min = 0.5;
constexpr double drift_K_min = 1.0;
constexpr double step_um_min = 1.0;
constexpr double step_share_min = 0.3;  ///< of the spread, if that is less than 1 um
constexpr double moved_K_min = 1.0;     // needed to see a reading's gain
constexpr double normal_maximum = 2.6;  // largest |z| of a window's rows, for normal z
constexpr Index windows = 24;
constexpr int findings_max = 12;  // removed one after another
constexpr double taken_out_score_min = 5.0;
// Strongest candidate of the median column on a calm machine.
constexpr double usual_level = 3.0;
/// Exchanged readings agree with the other runs if their distance from them is at most this
/// multiple of the distances between those.
constexpr double alike_max = 2.0;
constexpr double loose_gain_max = 0.9;
constexpr double loose_gain_min = -0.3;
// A signal explains a step if, within this number of rows, it changes by more than this share of
// its range and this multiple of its usual change: the current of a battery cell that is discharged
// at a constant rate has only noise as its range.
constexpr Index operated_reach = 3;
constexpr double operated_share = 0.05;
constexpr double times_usual = 3.0;  ///< also for the column itself, see is_sudden()

struct Target {
  std::string name;
  bool output{false};
  Index column{0};
};

/// Regressors of all expectations: temperatures and signals, immediate and delayed.
struct Inputs {
  MatrixXd temps;    ///< shape (rows, temps (1 + lags)), by place
  MatrixXd signals;  ///< shape (rows, ...), each of unit spread
};

void append(MatrixXd& matrix, const MatrixXd& columns) {
  const Index before = matrix.cols();
  matrix.conservativeResize(columns.rows(), before + columns.cols());
  matrix.rightCols(columns.cols()) = columns;
}

Inputs inputs_of(const Recording& recording) {
  Inputs inputs;
  const Index places = recording.temps_K.cols();
  inputs.temps.resize(recording.time_s.size(), places * 3);
  const MatrixXd late = low_pass(recording, recording.temps_K, lags_s[0]);
  const MatrixXd later = low_pass(recording, recording.temps_K, lags_s[1]);
  for (Index place = 0; place < places; ++place) {
    inputs.temps.col(3 * place) = recording.temps_K.col(place);
    inputs.temps.col(3 * place + 1) = late.col(place);
    inputs.temps.col(3 * place + 2) = later.col(place);
  }
  inputs.signals.resize(recording.time_s.size(), 0);
  if (recording.values.cols() > 0) {
    append(inputs.signals, recording.values);
    append(inputs.signals, recording.values.array().square().matrix());
    append(inputs.signals, low_pass(recording, recording.values, lags_s[0]));
    append(inputs.signals, low_pass(recording, recording.values, lags_s[1]));
  }
  for (Index i = 0; i < inputs.signals.cols(); ++i) {
    const double deviation = spread(inputs.signals.col(i));
    if (deviation > 0)
      inputs.signals.col(i) /= deviation;
    else
      inputs.signals.col(i).setZero();
  }
  return inputs;
}

struct Judged {
  std::vector<Index> rows;  ///< rows of the recording
  std::vector<Index> begins;
  Expectation expectation;
};

std::optional<Judged> judge(const Recording& recording, const Inputs& inputs,
                            const Target& target) {
  const auto all = target.output ? recording.outputs_um.col(target.column)
                                 : recording.temps_K.col(target.column);
  std::vector<Index> rows;
  std::vector<Index> begins;
  for (std::size_t r = 0; r < recording.runs(); ++r) {
    begins.push_back(static_cast<Index>(rows.size()));
    for (Index row = recording.begins[r]; row < recording.begins[r + 1]; ++row)
      if (std::isfinite(all[row])) rows.push_back(row);
  }
  begins.push_back(static_cast<Index>(rows.size()));
  const Index own = target.output ? 0 : 3;
  const Index columns = inputs.temps.cols() - own + inputs.signals.cols();
  if (static_cast<Index>(rows.size()) < rows_min) return std::nullopt;
  VectorXd y(static_cast<Index>(rows.size()));
  MatrixXd x(y.size(), columns);
  for (Index i = 0; i < y.size(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    y[i] = all[row];
    const Index before = target.output ? inputs.temps.cols() : 3 * target.column;
    const Index behind = inputs.temps.cols() - before - own;
    x.row(i) << inputs.temps.row(row).head(before), inputs.temps.row(row).tail(behind),
        inputs.signals.row(row);
  }
  y.array() -= y.mean();
  x.rowwise() -= x.colwise().mean().eval();
  VectorXd prior = VectorXd::Constant(columns, target.output ? prior_um_per_K : prior_K_per_K);
  prior.tail(inputs.signals.cols()).setConstant(std::max(spread(y), 1e-6));
  Judged judged{std::move(rows), begins, Expectation(y, x, prior, begins)};
  return judged;
}

/// Usual level of the column: median over windows of the largest |z|, relative to normal noise.
double noise_factor(const std::vector<Expectation::Evidence>& steps) {
  std::vector<double> largest;
  const std::size_t length = std::max<std::size_t>(8, steps.size() / windows);
  for (std::size_t begin = 0; begin + length <= steps.size(); begin += length) {
    double most = 0.0;
    for (std::size_t i = begin; i < begin + length; ++i)
      most = std::max(most, std::abs(steps[i].z));
    largest.push_back(most);
  }
  if (largest.size() < 3) return 1.0;
  return std::max(1.0, median(largest) / normal_maximum);
}

class ChangeSearch {
 public:
  ChangeSearch(Recording recording, Looked looked) : recording_(std::move(recording)) {
    for (Index i = 0; i < recording_.values.cols(); ++i)
      operating_change_.push_back(operating_change(recording_.values.col(i)));
    for (std::size_t i = 0; looked == Looked::all && i < recording_.temps.size(); ++i)
      targets_.push_back({recording_.temps[i], false, static_cast<Index>(i)});
    for (std::size_t i = 0; i < recording_.outputs.size(); ++i)
      targets_.push_back({recording_.outputs[i], true, static_cast<Index>(i)});
  }

  void search(Suspicions& found, const std::function<void(double)>& progress) {
    for (int round = 0; round < findings_max; ++round) {
      const Inputs inputs = inputs_of(recording_);
      offers_.clear();
      for (std::size_t t = 0; t < targets_.size(); ++t) {
        look(inputs, targets_[t]);
        if (progress) progress(static_cast<double>(t) / static_cast<double>(targets_.size()));
      }
      const auto best = likeliest();
      if (!best) return;
      found.push_back(*best);
      if (best->score < taken_out_score_min) return;
      take_out(best->finding);
    }
  }

 private:
  void look(const Inputs& inputs, const Target& target) {
    const auto judged = judge(recording_, inputs, target);
    if (!judged) return;
    for (std::size_t r = 0; r < recording_.runs(); ++r) {
      if (judged->begins[r + 1] - judged->begins[r] < rows_min) continue;
      look_for_step(*judged, target, r);
      if (target.output) continue;
      look_for_drift(*judged, target, r);
      look_for_loosening(*judged, target, r);
    }
  }

  /// The candidate that stands out most from the other columns' candidates of the same kind: on a
  /// machine where every place wanders, wandering is not a fault.
  [[nodiscard]] std::optional<Suspicion> likeliest() const {
    std::optional<Suspicion> best;
    for (const Suspicion& offer : offers_) {
      if (is_taken(offer.finding)) continue;
      Suspicion judged = offer;
      judged.score /= std::max(1.0, level_beside(offer) / usual_level);
      if (!best || judged.score > best->score) best = judged;
    }
    return best;
  }

  [[nodiscard]] double level_beside(const Suspicion& offer) const {
    std::map<std::string, double> strongest;
    for (const Suspicion& each : offers_) {
      if (each.finding.kind != offer.finding.kind || each.finding.column == offer.finding.column)
        continue;
      double& level = strongest[each.finding.column];
      level = std::max(level, each.score);
    }
    const std::size_t others =
        (offer.finding.kind == "displacement_step" ? recording_.outputs : recording_.temps).size() -
        1;
    std::vector<double> levels(others, 0.0);
    std::size_t i = 0;
    for (const auto& [column, level] : strongest) levels[i++] = level;
    return others < 2 ? 0.0 : median(std::move(levels));
  }

  [[nodiscard]] double time_at(const Judged& judged, std::size_t run, Index row) const {
    return recording_.time_s[judged.rows[static_cast<std::size_t>(judged.begins[run] + row)]];
  }

  void offer(const Target& target, const std::string& kind, std::size_t run, double at_s,
             double size, double score) {
    Suspicion suspicion;
    suspicion.score = score;
    suspicion.finding.kind = kind;
    suspicion.finding.column = target.name;
    suspicion.finding.run = run;
    suspicion.finding.at_s = at_s;
    suspicion.finding.until_s = recording_.time_s[recording_.begins[run + 1] - 1];
    suspicion.finding.size = size;
    suspicion.finding.unit = std::string(kind == "sensor_loose" ? "share"
                                         : target.output        ? "um"
                                                                : "K");
    offers_.push_back(std::move(suspicion));
  }

  [[nodiscard]] bool is_taken(const Finding& finding) const {
    return std::any_of(taken_.begin(), taken_.end(), [&](const Finding& each) {
      return each.kind == finding.kind && each.column == finding.column &&
             each.run == finding.run &&
             (each.kind != "sensor_step" && each.kind != "displacement_step"
                  ? true
                  : each.at_s == finding.at_s);
    });
  }

  /// True if a signal changed nearby, so the machine moved, not the sensor.
  [[nodiscard]] bool is_operated(Index row, std::size_t run, Index reach = operated_reach) const {
    const Index first = std::max(recording_.begins[run], row - reach);
    const Index last = std::min(recording_.begins[run + 1] - 1, row + reach);
    for (Index i = 0; i < recording_.values.cols(); ++i)
      if (range(recording_.values.col(i).segment(first, last - first + 1)) >
          operating_change_[static_cast<std::size_t>(i)])
        return true;
    return false;
  }

  static double range(const Eigen::Ref<const VectorXd>& values) {
    return values.maxCoeff() - values.minCoeff();
  }

  /// Change of a signal within 2 operated_reach + 1 rows above which the machine was operated.
  static double operating_change(const Eigen::Ref<const VectorXd>& signal) {
    constexpr Index rows = 2 * operated_reach + 1;
    std::vector<double> usual;
    for (Index row = 0; row + rows <= signal.size(); row += rows)
      usual.push_back(range(signal.segment(row, rows)));
    if (usual.empty()) return 0.0;
    return std::max(operated_share * range(signal), times_usual * median(std::move(usual)));
  }

  /// A gap ends nearby, so its changes appear at once.
  [[nodiscard]] bool is_after_gap(Index row, const Target& target) const {
    constexpr Index reach = 2;
    const Index first = std::max<Index>(0, row - reach);
    const Index last = std::min(recording_.after_gap.rows() - 1, row + reach);
    const Index column = target.output ? recording_.temps_K.cols() : target.column;
    return recording_.after_gap.col(column).segment(first, last - first + 1).any();
  }

  /// True if no nearby step reverses it by half or more.
  static bool stays(const std::vector<Expectation::Evidence>& steps, std::size_t at) {
    constexpr std::size_t near = 60;
    const std::size_t begin = at < near ? 0 : at - near;
    return std::none_of(
        steps.begin() + static_cast<std::ptrdiff_t>(begin),
        steps.begin() + static_cast<std::ptrdiff_t>(std::min(steps.size(), at + near)),
        [&](const auto& other) { return other.size / steps[at].size < -0.5; });
  }

  /// True if the column itself jumps: by at least half the size within two rows, by several times
  /// the usual change of the surrounding rows, and more steeply than three rows away, unlike a
  /// heater's ramp.
  [[nodiscard]] bool is_sudden(const Judged& judged, const Target& target, std::size_t run,
                               Index row, double size) const {
    constexpr Index beside = 15;
    const Index rows = judged.begins[run + 1] - judged.begins[run];
    const auto value = [&](Index i) {
      if (target.output) return judged.expectation.remainder()[judged.begins[run] + i];
      return recording_.temps_K(judged.rows[static_cast<std::size_t>(judged.begins[run] + i)],
                                target.column);
    };
    const auto change = [&](Index i) {
      return i < 1 || i > rows - 2 ? 0.0 : value(i + 1) - value(i - 1);
    };
    double leap = 0.0;
    for (Index i = row - 1; i <= row + 1; ++i)
      if (std::abs(change(i)) > std::abs(leap)) leap = change(i);
    std::vector<double> others;
    for (Index i = std::max<Index>(1, row - beside); i <= std::min(rows - 2, row + beside); ++i)
      if (std::abs(i - row) > 2) others.push_back(std::abs(change(i)));
    const double on_and_on = std::max(change(row - 3) / leap, change(row + 3) / leap);
    return std::abs(leap) >= 0.5 * std::abs(size) && on_and_on < 1.0 / times_usual &&
           (others.empty() || std::abs(leap) >= times_usual * median(std::move(others)));
  }

  void look_for_step(const Judged& judged, const Target& target, std::size_t run) {
    const auto steps = judged.expectation.steps(run);
    const double factor = noise_factor(steps);
    const double least =
        target.output
            ? std::min(step_um_min, step_share_min * spread(judged.expectation.remainder()))
            : step_K_min;
    std::vector<std::size_t> order;
    for (std::size_t i = 4; i + 4 < steps.size(); ++i)
      if (std::abs(steps[i].size) >= least && std::abs(steps[i].z) > 4.0) order.push_back(i);
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return std::abs(steps[a].z) > std::abs(steps[b].z);
    });
    if (order.size() > 20) order.resize(20);
    for (const std::size_t i : order) {
      const auto row = static_cast<Index>(i);
      const Index at = judged.rows[static_cast<std::size_t>(judged.begins[run] + row)];
      if (is_operated(at, run) || is_after_gap(at, target) || !stays(steps, i) ||
          !is_sudden(judged, target, run, row, steps[i].size))
        continue;
      offer(target, target.output ? "displacement_step" : "sensor_step", run,
            time_at(judged, run, row), steps[i].size, std::abs(steps[i].z) / factor);
      return;
    }
  }

  void look_for_drift(const Judged& judged, const Target& target, std::size_t run) {
    const Index rows = judged.begins[run + 1] - judged.begins[run];
    const double end_s = time_at(judged, run, rows - 1);
    for (const double share : {0.0, 0.2, 0.4, 0.6}) {
      const double start_s = time_at(judged, run, 0) + share * (end_s - time_at(judged, run, 0));
      VectorXd ramp(rows);
      for (Index i = 0; i < rows; ++i)
        ramp[i] = std::max(0.0, time_at(judged, run, i) - start_s) / (end_s - start_s);
      const auto evidence = judged.expectation.shape(run, ramp, true);
      if (std::abs(evidence.size) < drift_K_min) continue;
      offer(target, "sensor_drift", run, start_s, evidence.size, std::abs(evidence.z));
    }
  }

  /// From a time on, the reading is room + gain (truth - room): a step plus a share of the motion.
  void look_for_loosening(const Judged& judged, const Target& target, std::size_t run) {
    constexpr Index times = 30;
    const Index begin = judged.begins[run];
    const Index rows = judged.begins[run + 1] - begin;
    const VectorXd expected = judged.expectation.expected().segment(begin, rows);
    Finding best;
    double z_best = 0.0;
    double z_of_others = 0.0;
    for (Index k = 2; k < times - 2; ++k) {
      const Index from = k * rows / times;
      const auto moved = expected.tail(rows - from);
      const Index at = judged.rows[static_cast<std::size_t>(begin + from)];
      if (moved.maxCoeff() - moved.minCoeff() < moved_K_min || is_operated(at, run, rows / times))
        continue;
      VectorXd step = VectorXd::Zero(rows);
      step.tail(rows - from).setOnes();
      VectorXd motion = VectorXd::Zero(rows);
      motion.tail(rows - from) = (moved.array() - moved.mean()).matrix();
      const auto evidence = judged.expectation.second_shape(run, step, motion);
      const double gain = 1.0 + evidence.size;
      if (!(gain > loose_gain_min && gain < loose_gain_max)) {
        z_of_others = std::max(z_of_others, evidence.z);
      } else if (evidence.z > z_best) {
        z_best = evidence.z;
        best.at_s = time_at(judged, run, from);
        best.size = gain;
      }
    }
    // Loosening lowers a gain; a gain that also rises elsewhere in the run is wander.
    const double factor = std::max(1.0, z_of_others / usual_level);
    if (z_best > 0) offer(target, "sensor_loose", run, best.at_s, best.size, z_best / factor);
  }

  void take_out(const Finding& finding) {
    taken_.push_back(finding);
    const bool output = finding.kind == "displacement_step";
    const auto& names = output ? recording_.outputs : recording_.temps;
    const auto column =
        static_cast<Index>(std::find(names.begin(), names.end(), finding.column) - names.begin());
    MatrixXd& values = output ? recording_.outputs_um : recording_.temps_K;
    const double duration_s = finding.until_s - finding.at_s;
    for (Index row = recording_.begins[finding.run]; row < recording_.begins[finding.run + 1];
         ++row) {
      const double after_s = recording_.time_s[row] - finding.at_s;
      if (after_s < 0) continue;
      if (finding.kind == "sensor_drift")
        values(row, column) -= finding.size * after_s / duration_s;
      else if (finding.kind == "sensor_loose")
        restore_loose(row, column, finding);
      else
        values(row, column) -= finding.size;
    }
  }

  /// Restores a loose reading from its gain, since it is a poor regressor for its neighbours.
  void restore_loose(Index row, Index column, const Finding& finding) {
    const double gain = std::max(0.1, finding.size);
    const Index first = recording_.begins[finding.run];
    Index at = row;
    while (at > first && recording_.time_s[at - 1] >= finding.at_s) --at;
    const double pivot =
        at > first ? recording_.temps_K(at - 1, column) : recording_.temps_K(at, column);
    if (row == at) loose_start_ = recording_.temps_K(row, column);
    recording_.temps_K(row, column) =
        pivot + (recording_.temps_K(row, column) - loose_start_) / gain;
  }

  Recording recording_;
  std::vector<double> operating_change_;  ///< by signal
  std::vector<Target> targets_;
  std::vector<Finding> taken_;
  Suspicions offers_;
  double loose_start_{0.0};
};

}  // namespace

void check_changes(Recording recording, Looked looked, Suspicions& found,
                   const std::function<void(double)>& progress) {
  if (recording.temps.empty() && recording.outputs.empty()) return;
  ChangeSearch(std::move(recording), looked).search(found, progress);
}

void check_exchanged(const Recording& recording, Suspicions& found) {
  const Index places = recording.temps_K.cols();
  if (recording.runs() < 2 || places < 2) return;
  // Temperatures relative to each run's mean: an exchange shows in the motion.
  std::vector<MatrixXd> sums;
  std::vector<double> rows;
  for (std::size_t r = 0; r < recording.runs(); ++r) {
    const Index begin = recording.begins[r];
    MatrixXd moved = recording.temps_K.middleRows(begin, recording.begins[r + 1] - begin);
    moved.rowwise() -= moved.colwise().mean().eval();
    sums.emplace_back(moved.transpose() * moved);
    rows.push_back(static_cast<double>(moved.rows()));
  }
  // Distance of a run from the others but one: about the number of places if they move alike.
  const auto precision_of_others = [&](std::size_t r, std::size_t but) {
    constexpr double noise_K = 0.05;  // of a thermocouple: similar places are not distinguished
    MatrixXd sum = MatrixXd::Zero(places, places);
    double count = 0.0;
    for (std::size_t other = 0; other < sums.size(); ++other) {
      if (other == r || other == but) continue;
      sum += sums[other];
      count += rows[other];
    }
    return MatrixXd(
        (sum / count + noise_K * noise_K * MatrixXd::Identity(places, places)).inverse());
  };
  const auto distance = [](const MatrixXd& precision, const MatrixXd& scatter) {
    return (precision * scatter).trace();
  };
  for (std::size_t r = 0; r < recording.runs(); ++r) {
    const Index begin = recording.begins[r];
    if (recording.begins[r + 1] - begin < rows_min) continue;
    std::vector<double> of_others{static_cast<double>(places)};
    for (std::size_t other = 0; other < sums.size() && sums.size() > 2; ++other)
      if (other != r)
        of_others.push_back(distance(precision_of_others(other, r), sums[other] / rows[other]));
    const double usual = std::max(static_cast<double>(places), median(of_others));
    const MatrixXd scatter = sums[r] / rows[r];
    const MatrixXd precision = precision_of_others(r, r);
    const double as_is = distance(precision, scatter);
    for (Index a = 0; a < places; ++a) {
      for (Index b = a + 1; b < places; ++b) {
        const double apart =
            std::sqrt(std::max(0.0, scatter(a, a) + scatter(b, b) - 2 * scatter(a, b)));
        if (apart < step_K_min) continue;
        MatrixXd turned = scatter;
        turned.row(a).swap(turned.row(b));
        turned.col(a).swap(turned.col(b));
        const double exchanged = distance(precision, turned);
        const double ratio = as_is / std::max(exchanged, usual);
        if (!(ratio > 1.5) || !(exchanged < alike_max * usual)) continue;
        Suspicion suspicion;
        suspicion.score = ratio;
        suspicion.finding.kind = std::string("sensor_swap");
        suspicion.finding.column = recording.temps[static_cast<std::size_t>(a)];
        suspicion.finding.other = recording.temps[static_cast<std::size_t>(b)];
        suspicion.finding.run = r;
        suspicion.finding.at_s = recording.time_s[begin];
        suspicion.finding.until_s = recording.time_s[recording.begins[r + 1] - 1];
        suspicion.finding.size = apart;
        suspicion.finding.unit = std::string("K");
        found.push_back(suspicion);
      }
    }
  }
}

}  // namespace thermocomp::inspection
