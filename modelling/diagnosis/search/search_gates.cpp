// What must be so before a cause is named.
#include <algorithm>
#include <cmath>

#include "modelling/diagnosis/search/search.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Structure is called unexplained when its RMS is above this share of the measured motion's ...
constexpr double structure_share_min = 0.03;
/// ... and this many times the noise.
constexpr double structure_noises_min = 1.5;

}  // namespace

double Search::carried_share(const std::vector<Finding>& findings, std::size_t output) const {
  const OutputEvidence& evidence = outputs_[output];
  Column left = evidence.measured_residual();
  for (const Finding& finding : findings) {
    const Explanation& each = finding.explanation;
    if (each.gains[output].size() == 0) continue;
    left -= columns_of(*each.hypothesis, each.shape, evidence) * each.gains[output];
  }
  const double noise = evidence.noise_um() * evidence.noise_um();
  const auto variance = [&](const Column& values) {
    const double rms = evidence.centred_rms(values);
    return std::max(0.0, rms * rms - noise);
  };
  const double before = variance(evidence.measured_residual());
  return before > 0 ? 1.0 - variance(left) / before : 0.0;
}

/// Whether what it explains can be seen beside noise and motion in one of the outputs.
bool Search::matters(const Explanation& explanation, bool first) const {
  return std::any_of(measured_.begin(), measured_.end(), [&](std::size_t output) {
    const Eigen::VectorXd& gains = explanation.gains[output];
    if (gains.size() == 0) return false;
    const OutputEvidence& evidence = outputs_[output];
    const Column explained =
        columns_of(*explanation.hypothesis, explanation.shape, evidence) * gains;
    const double motion_um = evidence.centred_rms(evidence.measured(data_));
    const double residual_um = evidence.centred_rms(evidence.measured_residual());
    return evidence.centred_rms(explained) >
           std::max({evidence.noise_um(), thresholds_.motion_share_min * motion_um,
                     first ? 0.0 : thresholds_.later_share_min * residual_um});
  });
}

bool Search::earned(const Explanation& explanation, bool first) const {
  return explanation.left_out_gain >= thresholds_.left_out_gain_min &&
         (explanation.score >= thresholds_.score_min ||
          explanation.left_out_gain >= thresholds_.obvious_share) &&
         matters(explanation, first);
}

/// Whether the findings may be named: one of them is clear by itself, or all together are.
bool Search::convincing(const std::vector<Finding>& findings) const {
  double left = 1.0;
  double score = 0.0;
  for (const Finding& finding : findings) {
    const Explanation& each = finding.explanation;
    left *= 1.0 - each.left_out_gain;
    score += each.score;
    const double alone = each.hypothesis->clear_share;
    if (alone > 0 && each.left_out_gain < alone) continue;
    const double share = each.left_out_gain / thresholds_.clear_share;
    const double likelihood = std::min(1.0, each.score / thresholds_.clear_score);
    if (share >= 1.0 || share + likelihood >= thresholds_.clear_sum) return true;
    if (likelihood >= 1.0 && each.left_out_gain >= thresholds_.seen_share) return true;
  }
  return 1.0 - left >= thresholds_.together_share && score >= thresholds_.clear_score;
}

bool Search::may_be_named(const Explanation& explanation, bool first) const {
  if (thresholds_.by_probability && !(explanation.probability >= thresholds_.probability_min))
    return false;
  return first && !thresholds_.by_gates ? matters(explanation, first) : earned(explanation, first);
}

bool Search::named(const Path& path) const {
  return thresholds_.by_gates ? convincing(path.findings) : !path.findings.empty();
}

bool Search::structure_left() const {
  return std::any_of(measured_.begin(), measured_.end(), [&](std::size_t output) {
    const OutputEvidence& evidence = outputs_[output];
    const double noise_um = evidence.noise_um();
    const double residual_um = evidence.centred_rms(evidence.measured_residual());
    const double structure_um =
        std::sqrt(std::max(0.0, residual_um * residual_um - noise_um * noise_um));
    const double motion_um = evidence.centred_rms(evidence.measured(data_));
    return structure_um > structure_share_min * motion_um &&
           structure_um > structure_noises_min * noise_um;
  });
}

}  // namespace thermocomp::diagnosis
