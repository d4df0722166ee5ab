#include "modelling/diagnosis/rank/search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Weights of the utility, as research/calibrate_posterior.py prints them.
struct Weights {
  double score;
  double witness;
  double left_out;
  double share;
  double parameters;
  double one_run;
};
constexpr Weights weights{2.11, 2.66, 3.27, 12.04, -0.54, -0.27};
/// Weights of the log odds of any effect, for the figures of the likeliest hypothesis.
struct Presence {
  double constant;
  double score;
  double witness;
  double share;
};
constexpr Presence of_first{-2.69, 0.54, 0.49, 9.10};
/// In later rounds, and with coefficients fitted to the rows, the model's misfit resembles an
/// effect more often. Set for the same rate of false findings on untouched machines as in the first
/// round. Not for datum causes, since a fit does not produce a line, a jump or a shift.
constexpr Presence of_later{-5.70, 0.54, 0.49, 9.10};
constexpr Presence of_fitted{-7.70, 0.54, 0.49, 9.10};
constexpr double left_out_min = -0.5;
constexpr double left_out_max = 3.0;
/// Since neighbouring rows are correlated, ln L counts linearly up to about this value and
/// logarithmically above.
constexpr double score_scale = 20.0;
constexpr double score_min = -50.0;

double compressed(double score) {
  return std::copysign(std::log1p(std::abs(score) / score_scale), score);
}

/// Least probability of other subjects in the group, as a share of the likeliest one's.
constexpr double as_likely_min = 0.1;
constexpr double likelier_than_not = 0.5;

/// Inputs of the utility and of the odds.
struct Figures {
  double score;
  double witness;
  double left_out;  ///< ln of the RMS before over after, over the root of all outputs
  double share;     ///< reduction of the RMS, of the output with the largest
};

Figures figures_of(const Explanation& explanation) {
  // The outputs of one machine are correlated.
  const double root = std::sqrt(static_cast<double>(explanation.gains.size()));
  const double own = std::max(score_min, explanation.score) - explanation.witness;
  return {compressed(own / root), compressed(explanation.witness),
          std::clamp(explanation.left_out / root, left_out_min, left_out_max),
          -std::expm1(-std::clamp(explanation.left_out_of_best, left_out_min, left_out_max))};
}

}  // namespace

double utility(const Explanation& explanation) {
  const Figures of = figures_of(explanation);
  return weights.score * of.score + weights.witness * of.witness + weights.left_out * of.left_out +
         weights.share * of.share +
         weights.parameters * static_cast<double>(free_parameters(*explanation.hypothesis)) +
         (explanation.hypothesis->run ? weights.one_run : 0.0) + explanation.hypothesis->log_prior;
}

namespace {

/// True if a special case of this hypothesis is about as likely, or explains as much.
bool adds_nothing(const Explanation& explanation, const std::vector<Explanation>& all) {
  const Hypothesis& of = *explanation.hypothesis;
  if (of.simpler_cause.empty()) return false;
  return std::any_of(all.begin(), all.end(), [&](const Explanation& each) {
    return each.hypothesis->cause == of.simpler_cause &&
           each.hypothesis->subject == of.simpler_subject &&
           (each.score >= explanation.score || utility(each) + as_much >= utility(explanation));
  });
}

}  // namespace

Posterior weigh_against_each_other(std::vector<Explanation>& explanations, Round round,
                                   bool beside_fit) {
  Posterior posterior;
  for (const char* family : {"structure", "heat", "datum", "sensor"})
    posterior.families[family] = 0.0;
  posterior.families["none"] = 1.0;
  if (explanations.empty()) return posterior;
  const auto best = std::max_element(
      explanations.begin(), explanations.end(),
      [](const Explanation& a, const Explanation& b) { return utility(a) < utility(b); });
  const Figures of_best = figures_of(*best);
  const bool as_fits_leave = beside_fit && cause_named(best->hypothesis->cause).family != "datum";
  const Presence& presence = as_fits_leave           ? of_fitted
                             : round == Round::first ? of_first
                                                     : of_later;
  const double odds = std::exp(presence.constant + presence.score * of_best.score +
                               presence.witness * of_best.witness + presence.share * of_best.share);
  posterior.none = posterior.families["none"] = 1.0 / (1.0 + odds);
  const double most = utility(*best);
  double sum = 0.0;
  for (Explanation& each : explanations) {
    each.probability = adds_nothing(each, explanations) ? 0.0 : std::exp(utility(each) - most);
    sum += each.probability;
  }
  for (Explanation& each : explanations) {
    each.probability *= (1.0 - posterior.none) / sum;
    posterior.families[cause_named(each.hypothesis->cause).family] += each.probability;
  }
  return posterior;
}

namespace {

/// The likeliest of the accepted explanations, and the sum of their probabilities.
template <class Accept>
Choice sum_of(const std::vector<Explanation>& explanations, Accept accept) {
  Choice choice;
  double best = -1.0;
  for (std::size_t i = 0; i < explanations.size(); ++i) {
    const Explanation& each = explanations[i];
    if (!accept(*each.hypothesis)) continue;
    choice.probability += each.probability;
    if (each.probability <= best) continue;
    best = each.probability;
    choice.index = i;
  }
  return choice;
}

}  // namespace

Choice likeliest(const std::vector<Explanation>& explanations, const PlaceGroups& groups) {
  Choice of_place;
  Choice of_cause;
  for (const Explanation& each : explanations) {
    if (each.probability < 1e-6) continue;
    const Hypothesis& centre = *each.hypothesis;
    const auto same_cause = [&](const Hypothesis& of) { return of.cause == centre.cause; };
    const Choice place = sum_of(explanations, [&](const Hypothesis& of) {
      return same_cause(of) && same_places(groups, centre.subject, of.subject);
    });
    if (place.probability > of_place.probability) of_place = place;
    const Choice cause = sum_of(explanations, same_cause);
    if (cause.probability > of_cause.probability) of_cause = cause;
  }
  if (of_place.probability >= likelier_than_not || of_cause.probability < likelier_than_not)
    return of_place;
  const Explanation& best = explanations[of_cause.index];
  for (const Explanation& each : explanations)
    if (each.hypothesis->cause == best.hypothesis->cause &&
        each.hypothesis->subject != best.hypothesis->subject &&
        each.probability > as_likely_min * best.probability)
      of_cause.other_subjects.push_back(each.hypothesis->subject);
  return of_cause;
}

namespace {

constexpr int zooms = 2;
constexpr int points_of_zoom = 9;

/// The best by `second` among the trials that are nearly the best by `first`.
template <class First, class Second>
std::size_t best_of(const std::vector<Explanation>& trials, First first, Second second) {
  double most = -std::numeric_limits<double>::infinity();
  for (const Explanation& trial : trials) most = std::max(most, first(trial));
  std::size_t best = trials.size();
  for (std::size_t i = 0; i < trials.size(); ++i)
    if (first(trials[i]) >= most - as_much &&
        (best == trials.size() || second(trials[i]) > second(trials[best])))
      best = i;
  return best;
}

double score_of(const Explanation& explanation) {
  return explanation.score;
}

/// An effect of approximate form makes several values about equally likely; the one with the least
/// cross-validated residual is taken.
std::size_t likeliest_of(const std::vector<Explanation>& trials) {
  return best_of(trials, score_of, [](const Explanation& each) { return each.left_out; });
}

/// Fit at the best point of its grid.
Explanation weigh(const Fits& fits, const Hypothesis& hypothesis) {
  const std::vector<Explanation> all = fits.trials(hypothesis, grid_of(hypothesis));
  return all[best_of(all, utility, score_of)];
}

/// Criterion for the values of shape parameters.
enum class By { worth, likelihood };

/// Refines the shape between the points of the grid.
void refine(const Fits& fits, Explanation& explanation, By by = By::worth) {
  const Hypothesis& hypothesis = *explanation.hypothesis;
  for (std::size_t parameter = 0; parameter < hypothesis.shape.size(); ++parameter) {
    const ShapeParameter& of = hypothesis.shape[parameter];
    if (of.discrete || of.grid.size() < 2) continue;
    auto at = std::min_element(of.grid.begin(), of.grid.end(), [&](double a, double b) {
      return std::abs(a - explanation.shape[parameter]) <
             std::abs(b - explanation.shape[parameter]);
    });
    double low = at == of.grid.begin() ? *at : *(at - 1);
    double high = at + 1 == of.grid.end() ? *at : *(at + 1);
    const bool logarithmic = of.logarithmic && low > 0;
    for (int zoom = 0; zoom < zooms; ++zoom) {
      Shapes shapes;
      for (const double value : logarithmic ? logarithmic_grid(low, high, points_of_zoom)
                                            : linear_grid(low, high, points_of_zoom)) {
        shapes.push_back(explanation.shape);
        shapes.back()[parameter] = value;
      }
      const std::vector<Explanation> all = fits.trials(hypothesis, shapes);
      const std::size_t best =
          by == By::worth ? best_of(all, utility, score_of) : likeliest_of(all);
      const double probability = explanation.probability;
      explanation = all[best];
      explanation.probability = probability;
      low = shapes[best == 0 ? 0 : best - 1][parameter];
      high = shapes[std::min(best + 1, shapes.size() - 1)][parameter];
    }
  }
}

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
      Explanation next = weigh(fits, each);
      if (all.empty() || !same_name(*all.back().hypothesis, each))
        all.push_back(std::move(next));
      else if (utility(next) > utility(all.back()) + as_much)
        all.back() = std::move(next);  // the form with one more gain is likelier
    }
    if (all.empty()) return false;
    const auto likelier = [](const Explanation& a, const Explanation& b) {
      return utility(a) > utility(b);
    };
    std::sort(all.begin(), all.end(), likelier);
    for (std::size_t i = 0; i < std::min(refined, all.size()); ++i) refine(fits, all[i]);
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
        std::max(choice.probability, posterior.families.at(cause_named(of.cause).family));
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
        refine(fits, finding.explanation);
        std::vector<Explanation> alone = {finding.explanation};
        keep = weigh_against_each_other(alone, Round::first).none <= 1.0 - probability_min &&
               matters(fits, finding.explanation);
      }
      if (keep) {
        refine(fits, finding.explanation, By::likelihood);
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
