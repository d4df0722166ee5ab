#include "modelling/diagnosis/search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "modelling/diagnosis/left_out.hpp"
#include "modelling/diagnosis/shortlist.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr std::size_t shortlist_of_each = 20;
/// Structure is called unexplained when its RMS is above this share of the measured motion's ...
constexpr double structure_share_min = 0.03;
/// ... and this many times the noise.
constexpr double structure_noises_min = 1.5;
constexpr int refit_rounds = 2;
/// Explanations are as good as each other when what they leave differs by less than this share.
constexpr double tie_share = 0.1;
/// Errors of the coefficients are reckoned with when they leave less by this share.
constexpr double doubt_share = 0.2;
constexpr std::size_t weighed_shown = 12;

/// @param equations  [setting][explanation]
const Setting* likeliest_of(const std::vector<const Setting*>& settings,
                            const std::vector<std::vector<Setting::Equations>>& equations,
                            std::size_t place, const Explanation& explanation, std::size_t output) {
  const Setting* likeliest = settings.front();
  double best = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const Setting::Equations& of = equations[i][place];
    const Eigen::VectorXd gains =
        explanation.hypothesis->form == Form::own_gains ? of.gains() : explanation.gains[output];
    const double squares =
        settings[i]->squares() - 2.0 * gains.dot(of.right) + gains.dot(of.square * gains);
    const double likelihood = settings[i]->twice_log_likelihood(squares);
    if (!(likelihood > best)) continue;
    best = likelihood;
    likeliest = settings[i];
  }
  return likeliest;
}

}  // namespace

Search::Search(const MeasuredData& data, const Thresholds& thresholds)
    : Search(data, thresholds, hypotheses(data, stacked_rows(data)), {}) {}

Search::Search(const MeasuredData& data, const Thresholds& thresholds,
               std::vector<Hypothesis> hypotheses, Accepted accepted)
    : data_(data),
      thresholds_(thresholds),
      rows_(stacked_rows(data)),
      witness_(data_, rows_),
      hypotheses_(std::move(hypotheses)),
      accepted_(std::move(accepted)) {
  readings_.resize(rows_.time_s.size(), std::ssize(data.model.inputs));
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    const Block& block = rows_.runs[i];
    const Eigen::Index count = block.end - block.begin;
    for (std::size_t input = 0; input < data.runs[i].calm_inputs_K.size(); ++input)
      readings_.col(static_cast<Eigen::Index>(input)).segment(block.begin, count) =
          data.runs[i].calm_inputs_K[input].tail(count);
  }
  for (std::size_t output = 0; output < data.model.outputs.size(); ++output) {
    outputs_.emplace_back(data, rows_, output);
    if (outputs_.back().measured()) measured_.push_back(output);
  }
}

bool Search::concerns(const Hypothesis& hypothesis, std::size_t output) const {
  return outputs_[output].measured() && (!hypothesis.output || *hypothesis.output == output);
}

double Search::price(const Hypothesis& hypothesis) const {
  const double rows = static_cast<double>(rows_.time_s.size());
  double sum = 0.0;
  for (const ShapeParameter& parameter : hypothesis.shape)
    if (!parameter.discrete) sum += std::log(rows);
  if (hypothesis.form == Form::shared_gain) sum += std::log(rows);
  return sum + hypothesis.handicap;
}

bool Search::acts(const Explanation& explanation) {
  return std::any_of(explanation.gains.begin(), explanation.gains.end(),
                     [](const Eigen::VectorXd& gains) { return gains.size() > 0; });
}

/// Each explanation's noise becomes the one under which it is likeliest, gains fitted anew where
/// they are its own.
void Search::take_likeliest_settings(const std::vector<Explanation*>& explanations) const {
  for (const std::size_t output : measured_) {
    std::map<std::size_t, std::vector<Explanation*>> by_gains;
    for (Explanation* each : explanations)
      if (concerns(*each->hypothesis, output) &&
          (each->hypothesis->form == Form::own_gains || each->gains[output].size() > 0))
        by_gains[each->hypothesis->gains.size()].push_back(each);
    std::vector<const Setting*> settings;
    for (const auto& setting : outputs_[output].settings()) settings.push_back(setting.get());
    for (const auto& [gains, alike] : by_gains) {
      Panel columns;
      for (std::size_t i = 0; i < alike.size(); ++i) {
        const Panel of =
            columns_of(*alike[i]->hypothesis, Shapes{alike[i]->shape}, outputs_[output]);
        if (i == 0) columns.resize(of.rows(), of.cols() * std::ssize(alike));
        columns.middleCols(of.cols() * static_cast<Eigen::Index>(i), of.cols()) = of;
      }
      const auto equations =
          Setting::equations_of_groups(settings, columns, columns.cols() / std::ssize(alike));
      for (std::size_t i = 0; i < alike.size(); ++i)
        alike[i]->settings[output] = likeliest_of(settings, equations, i, *alike[i], output);
    }
  }
}

Search::Trial Search::refine(Explanation& explanation) const {
  const Hypothesis& hypothesis = *explanation.hypothesis;
  Trial best = weigh(hypothesis, explanation.shape, explanation.settings);
  for (std::size_t i = 0; i < hypothesis.shape.size(); ++i) {
    const ShapeParameter& parameter = hypothesis.shape[i];
    if (parameter.discrete || parameter.grid.size() < 2) continue;
    const auto value_of = [&](double x) { return parameter.logarithmic ? std::exp(x) : x; };
    const auto x_of = [&](double value) { return parameter.logarithmic ? std::log(value) : value; };
    const auto above = std::upper_bound(parameter.grid.begin(), parameter.grid.end(),
                                        explanation.shape[i] * (1.0 + 1e-12));
    const auto below =
        std::lower_bound(parameter.grid.begin(), parameter.grid.end(), explanation.shape[i]);
    double low = below == parameter.grid.begin() ? parameter.grid.front() : *(below - 1);
    double high = above == parameter.grid.end() ? parameter.grid.back() : *above;
    if (parameter.logarithmic && !(low > 0)) continue;  // no lag at all is a point of its own
    low = x_of(low);
    high = x_of(high);
    double best_x = x_of(explanation.shape[i]);
    constexpr int points = 6;
    for (int round = 0; round < 4; ++round) {
      const double step = (high - low) / (points + 1);
      Shapes shapes(points, explanation.shape);
      for (int k = 1; k <= points; ++k)
        shapes[static_cast<std::size_t>(k - 1)][i] = value_of(low + step * k);
      std::vector<Trial> trials = weigh_all(hypothesis, shapes, explanation.settings);
      const double origin = low;
      for (int k = 1; k <= points; ++k) {
        Trial& trial = trials[static_cast<std::size_t>(k - 1)];
        if (!(trial.score > best.score)) continue;
        best = std::move(trial);
        best_x = origin + step * k;
      }
      low = std::max(low, best_x - step);
      high = std::min(high, best_x + step);
    }
    explanation.shape[i] = value_of(best_x);
  }
  explanation.gains = best.gains;
  return best;
}

/// Shapes, noise and gains of explanations whose shapes are near the peak.
void Search::settle(std::vector<Explanation*> explanations) const {
  // Near the peak first: under wandering noise a jump that is a few rows off explains nothing.
  for (Explanation* each : explanations) refine(*each);
  for (int round = 0; round < 2; ++round) {
    take_likeliest_settings(explanations);
    for (Explanation* each : explanations) each->score = refine(*each).score;
    std::erase_if(explanations, [](const Explanation* each) { return !acts(*each); });
  }
  for (Explanation* each : explanations) {
    each->score -= price(*each->hypothesis);
    // The other noise has a price too: what counts is against the likeliest without the hypothesis.
    for (const std::size_t output : measured_) {
      if (each->gains[output].size() == 0) continue;
      const Setting& without = outputs_[output].setting();
      const Setting& with = *each->settings[output];
      each->score += with.twice_log_likelihood(with.squares()) -
                     without.twice_log_likelihood(without.squares());
    }
  }
}

/// Settles an explanation beside others than before, from the shape that it had. A new search over
/// the grid could lose it: under wandering noise a jump that is a few rows off explains nothing.
void Search::settle_anew(Explanation& explanation) const {
  for (const std::size_t output : measured_)
    explanation.settings[output] = outputs_[output].settings().front().get();
  explanation.gains = weigh(*explanation.hypothesis, explanation.shape, explanation.settings).gains;
  settle({&explanation});
}

std::vector<Explanation> Search::ranked() {
  return judged(profile(profiled_settings()));
}

/// The best few under each of the settings, settled and chosen among.
std::vector<Explanation> Search::judged(std::vector<std::vector<Explanation>> under_each) {
  std::vector<Place> places;
  for (std::vector<Explanation>& all : under_each)
    for (Place& place : shortlist(std::move(all), measured_, shortlist_of_each))
      places.push_back(std::move(place));
  std::vector<Explanation*> first;
  first.reserve(places.size());
  for (Place& place : places) first.push_back(&place.first);
  settle(std::move(first));
  std::vector<Explanation> candidates;
  for (const Place& place : places)
    for (Explanation& each : witnessed(place, measured_, witness_))
      candidates.push_back(std::move(each));
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.score > b.score; });
  std::vector<Explanation> once;
  for (Explanation& candidate : candidates) {
    const bool known = std::any_of(once.begin(), once.end(), [&](const Explanation& each) {
      return each.hypothesis == candidate.hypothesis;
    });
    if (!known) once.push_back(std::move(candidate));
  }
  std::erase_if(once, [](const Explanation& each) { return !acts(each); });
  choose(once);
  return once;
}

/// By what each leaves of rows it was not fitted to; among those that leave nearly the same, by
/// likelihood.
void Search::choose(std::vector<Explanation>& candidates) const {
  measure_left_out(candidates);
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.log_left < b.log_left; });
  if (candidates.empty()) return;
  const double least = candidates.front().log_left;
  const auto tie = std::find_if(candidates.begin(), candidates.end(), [&](const auto& each) {
    return each.log_left > least + tie_share;
  });
  std::stable_sort(candidates.begin(), tie,
                   [](const auto& a, const auto& b) { return a.score > b.score; });
}

void Search::measure_left_out(std::vector<Explanation>& candidates) const {
  LeftOut left_out(rows_, outputs_);
  for (auto each = candidates.begin(); each != candidates.end(); ++each) {
    const auto twin = std::find_if(candidates.begin(), each, [&](const Explanation& before) {
      return of_one_place(before, *each, measured_);
    });
    if (twin == each) {
      measure_left_out(*each, left_out);
    } else {
      each->left_out_gain = twin->left_out_gain;
      each->log_left = twin->log_left;
    }
  }
}

void Search::measure_left_out(Explanation& explanation, LeftOut& left_out) const {
  const LeftOutGain gain = explanation.hypothesis->run
                               ? left_out.gain_on_fitted_rows(explanation)
                               : left_out.gain_on_left_out_blocks(explanation);
  explanation.left_out_gain = thresholds_.one_unit ? gain.share_of_all : gain.share;
  explanation.log_left = gain.log_left;
  for (const std::size_t output : measured_)
    if (explanation.gains[output].size() == 0) explanation.log_left += log_left_without_[output];
}

void Search::accept(const std::vector<Finding>& findings, std::size_t but) {
  std::vector<Explanation> found;
  for (std::size_t i = 0; i < findings.size(); ++i)
    if (i != but) found.push_back(findings[i].explanation);
  if (accepted_) accepted_(found);
  for (OutputEvidence& output : outputs_) output.accept(found);
  measure_without();
}

void Search::measure_without() {
  LeftOut left_out(rows_, outputs_);
  log_left_without_.assign(outputs_.size(), 0.0);
  for (const std::size_t output : measured_)
    log_left_without_[output] = left_out.log_left_without(output);
}

/// The explanations for the first finding in both stances. The columns of all hypotheses are made
/// once for both.
Search::BothStances Search::first_candidates() {
  std::vector<Settings> settings;
  std::vector<std::vector<Settings>> of_stance;
  accept({}, 0);
  for (const bool doubted : {false, true}) {
    if (doubted && !(data_.coefficient_sd > 0)) continue;
    doubt(doubted);
    of_stance.push_back(profiled_settings());
    settings.insert(settings.end(), of_stance.back().begin(), of_stance.back().end());
  }
  std::vector<std::vector<Explanation>> under_each = profile(settings);
  const auto middle = under_each.begin() + std::ssize(of_stance.front());
  BothStances both;
  if (of_stance.size() > 1)
    both.beside_errors =
        judged({std::make_move_iterator(middle), std::make_move_iterator(under_each.end())});
  doubt(false);
  both.right =
      judged({std::make_move_iterator(under_each.begin()), std::make_move_iterator(middle)});
  return both;
}

void Search::doubt(bool doubted) {
  for (OutputEvidence& output : outputs_) output.doubt_coefficients(doubted);
  measure_without();
}

void Search::refit(std::vector<Finding>& findings) {
  for (int round = 0; findings.size() > 1 && round < refit_rounds; ++round) {
    for (std::size_t i = 0; i < findings.size(); ++i) {
      accept(findings, i);
      Explanation& each = findings[i].explanation;
      settle_anew(each);
      if (!acts(each)) findings.erase(findings.begin() + static_cast<std::ptrdiff_t>(i--));
    }
  }
}

/// From the curvature of 2 ln L at its peak: it falls by 1 a standard deviation away.
double Search::shape_sd(const Explanation& explanation, std::size_t parameter) const {
  const ShapeParameter& of = explanation.hypothesis->shape[parameter];
  if (of.discrete || !(explanation.score > 0)) return 0.0;
  const double value = explanation.shape[parameter];
  if (of.logarithmic && !(value > 0)) return 0.0;
  const double range = of.logarithmic ? 1.0 : of.grid.back() - of.grid.front();
  const auto at = [&](double move) {
    std::vector<double> shape = explanation.shape;
    shape[parameter] = of.logarithmic ? value * std::exp(move) : value + move;
    return weigh(*explanation.hypothesis, shape, explanation.settings).score;
  };
  const double peak = at(0.0);
  // The curvature is taken where it can be seen above rounding: a fall of a few units.
  for (double step = 1e-3 * range; step < range; step *= 2.0) {
    const double fall = peak - 0.5 * (at(step) + at(-step));
    if (fall > 4.0) return step / std::sqrt(fall);
  }
  return range;
}

void Search::measure_spread(std::vector<Finding>& findings) {
  for (std::size_t i = 0; i < findings.size(); ++i) {
    accept(findings, i);
    Finding& finding = findings[i];
    Explanation& each = finding.explanation;
    settle_anew(each);
    if (!acts(each)) {
      findings.erase(findings.begin() + static_cast<std::ptrdiff_t>(i--));
      continue;
    }
    finding.shape_sd.clear();
    for (std::size_t k = 0; k < each.shape.size(); ++k)
      finding.shape_sd.push_back(shape_sd(each, k));
    finding.gain_sd.assign(outputs_.size(), Eigen::VectorXd());
    for (const std::size_t output : measured_) {
      if (each.gains[output].size() == 0) continue;
      const Setting& setting = *each.settings[output];
      const Setting::Equations of =
          setting.equations(columns_of(*each.hypothesis, each.shape, outputs_[output]));
      const double squares = setting.squares() - 2.0 * each.gains[output].dot(of.right) +
                             each.gains[output].dot(of.square * each.gains[output]);
      const double variance = std::max(0.0, squares) / setting.present_rows();
      finding.gain_sd[output] = (variance * of.square.inverse().diagonal()).array().sqrt();
    }
  }
}

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
    const double share = each.left_out_gain / thresholds_.clear_share;
    const double likelihood = std::min(1.0, each.score / thresholds_.clear_score);
    if (share >= 1.0 || share + likelihood >= thresholds_.clear_sum) return true;
    if (likelihood >= 1.0 && each.left_out_gain >= thresholds_.seen_share) return true;
    left *= 1.0 - each.left_out_gain;
    score += each.score;
  }
  return 1.0 - left >= thresholds_.together_share && score >= thresholds_.clear_score;
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

/// Coefficients are doubted when the best explanation beside their errors predicts rows left out
/// clearly better than the best one without. These errors can take so much of a large cause that
/// nothing is clear; then it is sought as if the coefficients were right. What is small stays
/// theirs.
SearchResult Search::run() {
  const auto least_left = [](const std::vector<Explanation>& of) {
    return of.empty() ? 0.0 : of.front().log_left;
  };
  BothStances first = first_candidates();
  if (least_left(first.beside_errors) < least_left(first.right) - doubt_share) {
    doubt(true);
    SearchResult result = run_from(std::move(first.beside_errors));
    if (!result.unexplained) return result;
    for (OutputEvidence& output : outputs_) output.doubt_coefficients(false);
    first = {first_candidates().right, {}};
  }
  return run_from(std::move(first.right));
}

SearchResult Search::run_from(std::vector<Explanation> candidates) {
  SearchResult result;
  // A refit can drop what a later finding explains better: rounds are counted, not findings.
  for (std::size_t round = 1; round <= thresholds_.findings_max; ++round) {
    if (round > 1) {
      accept(result.findings, result.findings.size());
      candidates = ranked();
    }
    std::erase_if(candidates, [&](const Explanation& each) {
      return std::any_of(result.findings.begin(), result.findings.end(), [&](const Finding& found) {
        return found.explanation.hypothesis == each.hypothesis;
      });
    });
    for (std::size_t i = 0; i < std::min(weighed_shown, candidates.size()); ++i)
      result.weighed.push_back({round, candidates[i].hypothesis->cause,
                                candidates[i].hypothesis->subject, candidates[i].score,
                                candidates[i].left_out_gain, candidates[i].log_left});
    if (thresholds_.one_unit) {
      const auto first = std::find_if(
          candidates.begin(), candidates.end(),
          [&](const Explanation& each) { return earned(each, result.findings.empty()); });
      if (first != candidates.end()) std::rotate(candidates.begin(), first, first + 1);
    }
    if (candidates.empty() || !earned(candidates.front(), result.findings.empty())) break;
    Finding finding{candidates.front(), {}, {}, {}};
    for (std::size_t i = 1; i < candidates.size(); ++i) {
      const Hypothesis& other = *candidates[i].hypothesis;
      if (other.cause != candidates.front().hypothesis->cause ||
          other.subject != candidates.front().hypothesis->subject)
        finding.alternatives.push_back(candidates[i]);
    }
    result.findings.push_back(std::move(finding));
    refit(result.findings);
  }
  const bool named = convincing(result.findings);
  measure_spread(result.findings);
  accept(result.findings, result.findings.size());
  double left_variance = 1.0;
  for (const Finding& finding : result.findings)
    left_variance *= std::pow(1.0 - finding.explanation.left_out_gain, 2);
  result.unexplained_share.assign(outputs_.size(), 0.0);
  for (const std::size_t output : measured_)
    result.unexplained_share[output] =
        std::clamp(1.0 - carried_share(result.findings, output), 0.0, 1.0);
  if (!named || 1.0 - left_variance < thresholds_.carried_share_min) {
    result.findings.clear();
    for (const std::size_t output : measured_) result.unexplained_share[output] = 1.0;
    result.unexplained = structure_left();
  }
  return result;
}

}  // namespace thermocomp::diagnosis
