#include "modelling/diagnosis/rank/search.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double probability_min = 0.5;
constexpr std::size_t findings_max = 4;
constexpr std::size_t refined = 24;
/// A residual is large if it exceeds this multiple of the noise and this share of the motion.
constexpr double structure_over_noise = 1.5;
constexpr double structure_of_motion = 0.03;

/// RMS of an output's measured motion.
double motion_of(const MeasuredData& data, std::size_t output) {
  double squares = 0.0;
  double count = 0.0;
  for (const MeasuredRun& run : data.runs) {
    const auto values = run.measured_um[output].tail(run.rows() - run.begin).array();
    const auto present = values.isFinite();
    const auto n = static_cast<double>(present.count());
    if (n == 0.0) continue;
    const double mean = present.select(values, 0.0).sum() / n;
    squares += present.select(values - mean, 0.0).square().sum();
    count += n;
  }
  return count > 0 ? std::sqrt(squares / count) : 0.0;
}

constexpr double normal_95 = 1.96;
/// The form of a column is approximate, so the error of a shape parameter is this many times its
/// standard deviation. Jumps need no factor.
constexpr double wider_on_machines = 4.5;
/// For the same reason the error of a gain is a multiple of its standard deviation plus a share of
/// the gain, set for a coverage of 93 % of 112 planted gains (seeds of research/README.md).
constexpr double gain_wider = 2.0;
constexpr double gain_share = 0.2;
constexpr std::size_t fine_points = 33;

Interval hull(const Interval& a, double low, double high) {
  return {std::min(a.low, low), std::max(a.high, high)};
}

bool of_a_jump(const Hypothesis& hypothesis, const std::string& parameter) {
  const CauseParameter* const known = find_parameter(cause_named(hypothesis.cause), parameter);
  return known != nullptr && known->of_a_jump;
}

double wider(const Hypothesis& hypothesis, const std::string& parameter) {
  return of_a_jump(hypothesis, parameter) ? 1.0 : wider_on_machines;
}

/// Standard deviation of a gain with model discrepancy.
double gain_deviation(const Hypothesis& hypothesis, std::size_t number, double gain, double sd) {
  return of_a_jump(hypothesis, hypothesis.gains[number])
             ? sd
             : std::hypot(gain_wider * sd, gain_share * gain);
}

/// The grid, three points in each of its intervals, and many points near the estimate; ascending.
std::vector<double> values_of(const ShapeParameter& of, double found) {
  std::vector<double> values = {found, of.grid.front()};
  for (std::size_t i = 1; i < of.grid.size(); ++i)
    for (const double share : {0.25, 0.5, 0.75, 1.0})
      values.push_back(of.grid[i - 1] + share * (of.grid[i] - of.grid[i - 1]));
  const auto above = std::upper_bound(of.grid.begin(), of.grid.end(), found);
  const double low = above - of.grid.begin() >= 2 ? *(above - 2) : of.grid.front();
  const double high = of.grid.end() - above >= 2 ? *(above + 1) : of.grid.back();
  const std::vector<double> fine = of.logarithmic && low > 0
                                       ? logarithmic_grid(low, high, fine_points)
                                       : linear_grid(low, high, fine_points);
  values.insert(values.end(), fine.begin(), fine.end());
  std::sort(values.begin(), values.end());
  return values;
}

/// Sets the 95 % intervals: of a shape parameter by its profile likelihood, of a gain also over the
/// shapes within these intervals.
/// @return whether the interval of any gain at the best shape excludes 0; true without gains
bool set_spread(const Fits& fits, Finding& finding) {
  Explanation& found = finding.explanation;
  const Hypothesis& hypothesis = *found.hypothesis;
  const Explanation best = fits.trials(hypothesis, {found.shape}).front();
  found.gains = best.gains;
  const auto gains_reach = [&](const Explanation& trial, std::size_t output, Eigen::Index i) {
    const double gain = trial.gains[output][i];
    const double reach = normal_95 * gain_deviation(hypothesis, static_cast<std::size_t>(i), gain,
                                                    trial.gain_sd[output][i]);
    return std::pair(gain - reach, gain + reach);
  };
  finding.shape_ci.assign(found.shape.size(), {});
  finding.gains_ci.assign(found.gains.size(), {});
  bool is_known = hypothesis.gains.empty();
  if (!hypothesis.gains.empty())
    for (std::size_t output = 0; output < found.gains.size(); ++output)
      for (Eigen::Index i = 0; i < best.gains[output].size(); ++i) {
        const auto [low, high] = gains_reach(best, output, i);
        finding.gains_ci[output].push_back({low, high});
        is_known = is_known || low > 0.0 || high < 0.0;
      }
  for (std::size_t parameter = 0; parameter < found.shape.size(); ++parameter) {
    const ShapeParameter& of = hypothesis.shape[parameter];
    finding.shape_ci[parameter] = {found.shape[parameter], found.shape[parameter]};
    if (of.discrete) continue;
    Shapes shapes;
    const std::vector<double> values = values_of(of, found.shape[parameter]);
    for (const double value : values) {
      shapes.push_back(found.shape);
      shapes.back()[parameter] = value;
    }
    const std::vector<Explanation> trials = fits.trials(hypothesis, shapes);
    const double limit = best.score - 0.5 * std::pow(normal_95 * wider(hypothesis, of.name), 2);
    for (std::size_t i = 0; i < trials.size(); ++i) {
      if (trials[i].score < limit) continue;
      // Up to the middle between it and the next value, which may be outside.
      Interval& shape = finding.shape_ci[parameter];
      shape = hull(shape, 0.5 * (values[i] + values[i == 0 ? 0 : i - 1]),
                   0.5 * (values[i] + values[std::min(i + 1, values.size() - 1)]));
      for (std::size_t output = 0; output < finding.gains_ci.size(); ++output)
        for (std::size_t g = 0; g < finding.gains_ci[output].size(); ++g) {
          if (trials[i].gains[output].size() == 0) continue;
          const double gain = trials[i].gains[output][static_cast<Eigen::Index>(g)];
          finding.gains_ci[output][g] = hull(finding.gains_ci[output][g], gain, gain);
        }
    }
  }
  return is_known;
}

class Search {
 public:
  Search(const MeasuredData& data, const std::vector<Hypothesis>& hypotheses,
         const std::function<void()>& progress, double motion_share_min,
         const std::function<void(const std::vector<Explanation>&)>& accepted)
      : data_(data),
        hypotheses_(hypotheses),
        progress_(progress),
        motion_share_min_(motion_share_min),
        on_accepted_(accepted),
        readings_(data),
        groups_(place_groups(data)) {}

  SearchResult run() {
    SearchResult result;
    std::vector<Remainder> before;
    for (std::size_t round = 0; round < findings_max; ++round) {
      const Fits fits = fits_beside(explanations_of(result.findings));
      if (round == 0) before = remainders(fits, false);
      if (!add_finding(fits, round, result)) break;
    }
    std::vector<Remainder> after = before;
    if (!result.findings.empty()) {
      settle_together(result.findings);
      const Fits fits = fits_beside(explanations_of(result.findings));
      after = remainders(fits, true);
      for (std::size_t output = 0; output < after.size(); ++output)
        result.coefficient_errors.push_back(fits.coefficient_errors(output));
    }
    for (std::size_t output = 0; output < before.size(); ++output) {
      const Remainder& of = before[output];
      result.noise_share.push_back(of.noise_share);
      result.fitted.push_back(of.fitted);
      result.unexplained_share.push_back(
          of.structure > 0 ? std::min(1.0, after[output].structure / of.structure) : 0.0);
      result.unexplained = result.unexplained || (of.is_large && result.findings.empty());
    }
    return result;
  }

 private:
  static std::vector<Explanation> explanations_of(const std::vector<Finding>& findings) {
    std::vector<Explanation> all;
    all.reserve(findings.size());
    for (const Finding& each : findings) all.push_back(each.explanation);
    return all;
  }

  Fits fits_beside(const std::vector<Explanation>& accepted) {
    if (on_accepted_) on_accepted_(accepted);
    return Fits(data_, readings_, accepted);
  }

  /// Residual of an output.
  struct Remainder {
    double structure{0.0};    ///< variance above that of the noise
    double noise_share{1.0};  ///< of the variance
    bool is_large{false};     ///< the structure, relative to noise and motion
    bool fitted{false};       ///< the coefficients to these rows
  };

  std::vector<Remainder> remainders(const Fits& fits, bool corrected) const {
    std::vector<Remainder> all(data_.model.outputs.size());
    for (std::size_t output = 0; output < all.size(); ++output) {
      if (!fits.measured(output)) continue;
      const double rms = fits.rms_left(output, corrected);
      const double noise = fits.output(output).noise();
      Remainder& of = all[output];
      of.structure = std::max(0.0, rms * rms - noise * noise);
      of.noise_share = std::min(1.0, std::pow(noise / std::max(1e-12, rms), 2));
      of.is_large = std::sqrt(of.structure) > structure_over_noise * noise &&
                    std::sqrt(of.structure) > structure_of_motion * motion_of(data_, output);
      of.fitted = fits.fitted(output);
    }
    return all;
  }

  bool matters(const Fits& fits, const Explanation& explanation) const {
    for (std::size_t output = 0; output < explanation.gains.size(); ++output) {
      if (explanation.gains[output].size() == 0) continue;
      const Column effect = fits.effect_of(explanation, output);
      const double rms = std::sqrt(effect.squaredNorm() / static_cast<double>(effect.size()));
      if (rms > fits.output(output).noise_beside(effect) &&
          rms > motion_share_min_ * motion_of(data_, output))
        return true;
    }
    return false;
  }

  /// @return whether one was added
  bool add_finding(const Fits& fits, std::size_t round, SearchResult& result) const {
    std::vector<Explanation> all;
    for (const Hypothesis& each : hypotheses_) {
      if (progress_) progress_();
      if (is_known(each, result.findings)) continue;
      Explanation next = fits.weigh(each);
      if (all.empty() || !same_name(*all.back().hypothesis, each))
        all.push_back(std::move(next));
      else if (utility(next) > utility(all.back()) + as_much)
        all.back() = std::move(next);  // the form with one gain more is likelier
    }
    if (all.empty()) return false;
    const auto likelier = [](const Explanation& a, const Explanation& b) {
      return utility(a) > utility(b);
    };
    std::sort(all.begin(), all.end(), likelier);
    for (std::size_t i = 0; i < std::min(refined, all.size()); ++i) fits.refine(all[i]);
    std::sort(all.begin(), all.end(), likelier);
    bool fitted = false;
    for (std::size_t output = 0; output < data_.model.outputs.size(); ++output)
      fitted = fitted || fits.fitted(output);
    const Posterior posterior =
        weigh_against_each_other(all, round == 0 ? Round::first : Round::later, fitted);
    std::stable_sort(all.begin(), all.end(), [](const Explanation& a, const Explanation& b) {
      return a.probability > b.probability;
    });
    const Choice choice = likeliest(all, groups_);
    if (round == 0) {
      result.families = posterior.families;
      result.weighed = all;
    }
    if (choice.probability < probability_min || !matters(fits, all[choice.index]) ||
        (round > 0 && !(all[choice.index].score > 0)))
      return false;
    Finding finding{all[choice.index]};
    const Hypothesis& of = *finding.explanation.hypothesis;
    finding.probability = choice.probability;
    finding.family_probability =
        std::max(choice.probability, posterior.families.at(family_of(of.cause)));
    finding.group = group_of(groups_, of.subject, choice.other_subjects);
    finding.weighed = std::move(all);
    result.findings.push_back(std::move(finding));
    return true;
  }

  static bool same_name(const Hypothesis& a, const Hypothesis& b) {
    return a.cause == b.cause && a.subject == b.subject && a.run == b.run;
  }

  static bool is_known(const Hypothesis& hypothesis, const std::vector<Finding>& findings) {
    return std::any_of(findings.begin(), findings.end(), [&](const Finding& each) {
      return same_name(*each.explanation.hypothesis, hypothesis);
    });
  }

  /// Fits each finding jointly with the others and sets its intervals. Erases findings that the
  /// others now explain, and those whose gain may be 0.
  void settle_together(std::vector<Finding>& findings) {
    for (std::size_t i = 0; i < findings.size();) {
      Finding& finding = findings[i];
      std::vector<Explanation> others = explanations_of(findings);
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      const Fits fits = fits_beside(others);
      bool keep = true;
      if (!others.empty()) {
        fits.refine(finding.explanation);
        std::vector<Explanation> alone = {finding.explanation};
        keep = weigh_against_each_other(alone, Round::first).none <= 1.0 - probability_min &&
               matters(fits, finding.explanation);
      }
      if (keep) {
        fits.refine(finding.explanation, Fits::By::likelihood);
        keep = set_spread(fits, finding);
      }
      if (!keep) findings.erase(findings.begin() + static_cast<std::ptrdiff_t>(i));
      i = keep ? i + 1 : 0;
    }
  }

  const MeasuredData& data_;
  const std::vector<Hypothesis>& hypotheses_;
  const std::function<void()>& progress_;
  const double motion_share_min_;
  const std::function<void(const std::vector<Explanation>&)>& on_accepted_;
  Readings readings_;
  PlaceGroups groups_;
};

}  // namespace

SearchResult search(const MeasuredData& data, const std::vector<Hypothesis>& hypotheses,
                    const std::function<void()>& progress, double motion_share_min,
                    const std::function<void(const std::vector<Explanation>&)>& accepted) {
  return Search(data, hypotheses, progress, motion_share_min, accepted).run();
}

}  // namespace thermocomp::diagnosis
