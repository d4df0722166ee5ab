// One finding after another, refitted together.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "modelling/diagnosis/evidence/headroom.hpp"
#include "modelling/diagnosis/evidence/left_out.hpp"
#include "modelling/diagnosis/evidence/posterior.hpp"
#include "modelling/diagnosis/search/search.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr int refit_rounds = 2;
/// Errors of the coefficients are reckoned with when they leave less by this share.
constexpr double doubt_share = 0.2;
constexpr std::size_t weighed_shown = 12;

}  // namespace

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

/// Coefficients are doubted when the best explanation beside their errors predicts rows left out
/// clearly better than the best one without. These errors can take so much of a large cause that
/// nothing is clear; then it is sought as if the coefficients were right. What is small stays
/// theirs.
SearchResult Search::run() {
  const auto least_left = [](const std::vector<Explanation>& of) {
    return of.empty() ? 0.0 : of.front().log_left;
  };
  BothStances first = first_candidates();
  const bool errors_seen = least_left(first.beside_errors) < least_left(first.right) - doubt_share;
  if (errors_seen) {
    doubt(true);
    SearchResult result = run_from(first.beside_errors, false);
    if (!result.unexplained) return result;
    for (OutputEvidence& output : outputs_) output.doubt_coefficients(false);
    first = {first_candidates().right, {}};
  }
  return run_from(first.right, errors_seen);
}

void Search::follow(Path& path, std::vector<Explanation> candidates, std::size_t from_round) {
  // A refit can drop what a later finding explains better: rounds are counted, not findings.
  for (std::size_t round = from_round; round <= thresholds_.findings_max; ++round) {
    if (round > 1) {
      accept(path.findings, path.findings.size());
      candidates = ranked();
    }
    std::erase_if(candidates, [&](const Explanation& each) {
      return std::any_of(path.findings.begin(), path.findings.end(), [&](const Finding& found) {
        return found.explanation.hypothesis == each.hypothesis;
      });
    });
    for (std::size_t i = 0; i < std::min(weighed_shown, candidates.size()); ++i) {
      const Explanation& each = candidates[i];
      path.weighed.push_back({round, each.hypothesis->cause, each.hypothesis->subject, each.score,
                              each.left_out_gain, each.left_out_gain_of_best, each.log_left,
                              each.witness, free_parameters(each)});
    }
    if (thresholds_.one_unit) {
      const auto first = std::find_if(
          candidates.begin(), candidates.end(),
          [&](const Explanation& each) { return earned(each, path.findings.empty()); });
      if (first != candidates.end()) std::rotate(candidates.begin(), first, first + 1);
    }
    put_likeliest_first(candidates, path);
    if (candidates.empty() || !may_be_named(candidates.front(), path.findings.empty())) break;
    path.findings.push_back(finding_of(candidates, 0));
    refit(path.findings);
  }
}

/// The likeliest cause with its group of places, of them the likeliest; the others by their own
/// probabilities. Where no group is likely enough, the likeliest cause wherever it is: which of
/// many places it is may be all that is not known.
void Search::put_likeliest_first(std::vector<Explanation>& candidates, Path& path) const {
  if (!thresholds_.by_probability || candidates.empty()) return;
  // A fit takes most of a cause, as a finding does: names beside it are right as often as those of
  // later rounds.
  const bool first = path.findings.empty() && !thresholds_.by_gates;
  const Posterior all = posterior(candidates, first ? Round::first : Round::later);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    candidates[i].probability = all.of[i];
    candidates[i].family_probability = all.families.at(family_of(candidates[i].hypothesis->cause));
  }
  std::size_t best = likeliest(candidates, all, groups_);
  double most = probability_of_group(candidates, all, groups_, best);
  if (most < thresholds_.probability_min && first) {
    CauseAnywhere cause = cause_anywhere(candidates, all);
    if (cause.probability >= thresholds_.probability_min) {
      best = cause.likeliest;
      most = cause.probability;
      candidates[best].other_subjects = std::move(cause.others);
    }
  }
  candidates[best].probability = most;
  if (path.findings.empty()) path.families = all.families;
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.probability > b.probability; });
}

Finding Search::finding_of(const std::vector<Explanation>& candidates, std::size_t chosen) {
  Finding finding{candidates[chosen], {}, {}, {}};
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const Hypothesis& other = *candidates[i].hypothesis;
    if (other.cause != candidates[chosen].hypothesis->cause ||
        other.subject != candidates[chosen].hypothesis->subject)
      finding.alternatives.push_back(candidates[i]);
  }
  return finding;
}

SearchResult Search::run_from(const std::vector<Explanation>& candidates, bool errors_seen) {
  Path path;
  follow(path, candidates, 1);
  // What a clear finding leaves is the errors' then.
  const bool settled = errors_seen && path.findings.size() == 1 && named(path);
  if (!settled && in_doubt(path)) reconsider(path, candidates);
  return result_of(std::move(path));
}

SearchResult Search::result_of(Path path) {
  SearchResult result;
  const bool is_named = named(path);
  result.findings = std::move(path.findings);
  result.weighed = std::move(path.weighed);
  result.families = std::move(path.families);
  measure_spread(result.findings);
  accept(result.findings, result.findings.size());
  double left_variance = 1.0;
  for (const Finding& finding : result.findings)
    left_variance *= std::pow(1.0 - finding.explanation.left_out_gain, 2);
  result.unexplained_share.assign(outputs_.size(), 0.0);
  for (const std::size_t output : measured_)
    result.unexplained_share[output] =
        std::clamp(1.0 - carried_share(result.findings, output), 0.0, 1.0);
  const bool little = thresholds_.by_gates && 1.0 - left_variance < thresholds_.carried_share_min;
  if (!is_named || little) {
    result.findings.clear();
    for (const std::size_t output : measured_) result.unexplained_share[output] = 1.0;
    result.unexplained = structure_left();
  }
  return result;
}

std::vector<Headroom> Search::headrooms(const SearchResult& result) const {
  const Eigen::MatrixXd bank = lag_bank(data_, rows_);
  std::vector<Headroom> all(outputs_.size());
  for (const std::size_t output : measured_) {
    const OutputEvidence& evidence = outputs_[output];
    const double noise = evidence.noise_um() * evidence.noise_um();
    const double residual_um = evidence.centred_rms(evidence.measured_residual());
    const double variance = residual_um * residual_um;
    const double carried = result.findings.empty() ? 0.0 : 1.0 - result.unexplained_share[output];
    all[output] = headroom(variance > 0 ? noise / variance : 1.0, carried,
                           predictable_share(rows_, evidence, bank));
  }
  return all;
}

}  // namespace thermocomp::diagnosis
