// Two causes sought together, where one after the other leaves a doubt.
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "modelling/diagnosis/evidence/left_out.hpp"
#include "modelling/diagnosis/evidence/posterior.hpp"
#include "modelling/diagnosis/search/search.hpp"

namespace thermocomp::diagnosis {
namespace {

/// The best few explanations of the first round ...
constexpr std::size_t firsts_tried = 8;
/// ... each with the best few that are left beside it.
constexpr std::size_t seconds_tried = 3;
/// The best pairs to which further findings are sought.
constexpr std::size_t pairs_followed = 2;
/// Paths are as good as each other when what they leave differs by less than this share.
constexpr double tie_share = 0.1;
/// What is named where one finding after another came to nothing takes this share together.
constexpr double plain_share = 0.8;

double log_determinant(const Eigen::MatrixXd& columns, const Eigen::VectorXd& precision) {
  Eigen::MatrixXd square = columns.transpose() * columns;
  square.diagonal() += precision;
  return 2.0 * square.llt().matrixLLT().diagonal().array().log().sum();
}

/// 2 ln L of one output with the accepted columns, each of which costs ln N in place of its prior.
double twice_log_likelihood(const OutputEvidence& evidence) {
  const Setting& setting = evidence.setting();
  const Eigen::MatrixXd common = setting.against().rightCols(setting.precision().size());
  const Eigen::Index free = evidence.free_columns().cols();
  const Eigen::Index last = evidence.coefficient_columns().cols();
  const Eigen::Index first = common.cols() - last - free;
  Eigen::MatrixXd others(common.rows(), first + last);
  others << common.leftCols(first), common.rightCols(last);
  Eigen::VectorXd precision(first + last);
  precision << setting.precision().head(first), setting.precision().tail(last);
  const double prior = setting.precision().segment(first, free).array().log().sum() -
                       log_determinant(common, setting.precision()) +
                       log_determinant(others, precision);
  return setting.twice_log_likelihood(setting.squares()) - prior -
         static_cast<double>(free) * std::log(setting.present_rows());
}

/// What is found already is no candidate.
void leave_out_others(std::vector<Explanation>& candidates, const std::vector<Finding>& findings,
                      std::size_t but) {
  std::erase_if(candidates, [&](const Explanation& each) {
    for (std::size_t i = 0; i < findings.size(); ++i)
      if (i != but && findings[i].explanation.hypothesis == each.hypothesis) return true;
    return false;
  });
}

bool same_causes(const std::vector<Finding>& a, const std::vector<Finding>& b) {
  return std::is_permutation(a.begin(), a.end(), b.begin(), b.end(),
                             [](const Finding& one, const Finding& other) {
                               return one.explanation.hypothesis == other.explanation.hypothesis;
                             });
}

bool less_left(const auto& a, const auto& b) {
  return a.log_left < b.log_left;
}

}  // namespace

/// Whether a path of findings could be a wrong one. On measured machines a pair in the place of one
/// finding, or of none, was hardly ever right.
bool Search::in_doubt(const Path& path) const {
  return thresholds_.in_pairs && path.findings.size() > 1;
}

/// What all findings of a path leave of rows left out, and their common likelihood. Each finding
/// costs the share that a later one has to explain.
void Search::measure(Path& path) {
  accept(path.findings, path.findings.size());
  LeftOut left_out(rows_, outputs_);
  path.score = 0.0;
  path.log_left =
      -std::log(1.0 - thresholds_.later_share_min) * static_cast<double>(path.findings.size());
  for (const std::size_t output : measured_) {
    path.log_left += left_out.log_left_by_accepted(output);
    path.score += twice_log_likelihood(outputs_[output]);
  }
  for (const Finding& finding : path.findings) {
    const Explanation& each = finding.explanation;
    path.score -= price(*each.hypothesis);
    if (each.hypothesis->sensor)
      path.score += witness_.says(each, {{*each.hypothesis->sensor, 1.0}}).front();
  }
}

/// Whether each of the findings may be named beside the others. Measures them so and puts first
/// what takes most.
bool Search::each_earned(std::vector<Finding>& findings) {
  for (std::size_t i = 0; i < findings.size(); ++i) {
    accept(findings, i);
    Explanation& each = findings[i].explanation;
    settle_anew(each);
    if (!acts(each)) return false;
    if (each.hypothesis->sensor)
      add_witness(each, witness_.says(each, {{*each.hypothesis->sensor, 1.0}}).front());
    LeftOut left_out(rows_, outputs_);
    measure_left_out(each, left_out);
    if (!earned(each, false)) return false;
    if (!thresholds_.by_probability) continue;
    each.probability = each.family_probability = posterior({each}, Round::later).of.front();
    if (!(each.probability >= thresholds_.probability_min)) return false;
  }
  std::sort(findings.begin(), findings.end(), [](const Finding& a, const Finding& b) {
    return less_left(a.explanation, b.explanation);
  });
  return true;
}

bool Search::stands(Path& path) {
  if (!each_earned(path.findings) || !convincing(path.findings)) return false;
  measure(path);
  return true;
}

/// Every pair once, least left first.
std::vector<Search::Path> Search::pairs(const std::vector<Explanation>& firsts) {
  std::vector<Path> found;
  std::vector<std::pair<const Hypothesis*, const Hypothesis*>> known;
  for (std::size_t i = 0; i < std::min(firsts_tried, firsts.size()); ++i) {
    if (!(firsts[i].score > 0)) continue;
    const Finding first = finding_of(firsts, i);
    accept({first}, 1);
    const std::vector<Explanation> seconds = ranked();
    std::size_t tried = 0;
    for (std::size_t k = 0; k < seconds.size() && tried < seconds_tried; ++k) {
      if (seconds[k].hypothesis == firsts[i].hypothesis || !(seconds[k].score > 0) ||
          seconds[k].left_out_gain < thresholds_.left_out_gain_min)
        continue;
      ++tried;
      const std::pair<const Hypothesis*, const Hypothesis*> both =
          std::minmax(firsts[i].hypothesis, seconds[k].hypothesis);
      if (std::find(known.begin(), known.end(), both) != known.end()) continue;
      known.push_back(both);
      Path path{{first, finding_of(seconds, k)}};
      refit(path.findings);
      if (path.findings.size() == 2 && stands(path)) found.push_back(std::move(path));
    }
  }
  std::sort(found.begin(), found.end(), less_left<Path, Path>);
  return found;
}

/// Whether each of the findings is likelier beside the others than everything else together.
bool Search::each_likely(std::vector<Finding>& findings) {
  for (std::size_t i = 0; i < findings.size(); ++i) {
    accept(findings, i);
    std::vector<Explanation> candidates = ranked();
    leave_out_others(candidates, findings, i);
    Explanation& each = findings[i].explanation;
    const auto own =
        std::find_if(candidates.begin(), candidates.end(),
                     [&](const Explanation& other) { return other.hypothesis == each.hypothesis; });
    if (own == candidates.end()) return false;
    const Posterior all = posterior(candidates, Round::later);
    each.probability = probability_of_group(candidates, all, groups_,
                                            static_cast<std::size_t>(own - candidates.begin()));
    each.family_probability = all.families.at(family_of(each.hypothesis->cause));
    if (!(each.probability >= thresholds_.probability_min)) return false;
  }
  return true;
}

/// Puts a pair, or what was found from a pair on, in the place of the path when that leaves less of
/// rows left out; of those that leave nearly the same, the likeliest. In the place of a single
/// clear finding it must leave less and be likelier by as much as a finding has to gain. Where
/// nothing could be named, all together must be plain.
void Search::reconsider(Path& path, const std::vector<Explanation>& firsts) {
  std::vector<Path> paths = pairs(firsts);
  const std::size_t followed = std::min(pairs_followed, paths.size());
  for (std::size_t i = 0; i < followed; ++i) {
    Path longer = paths[i];
    follow(longer, {}, 3);
    if (longer.findings.size() > 2 && stands(longer)) paths.push_back(std::move(longer));
  }
  const bool is_named = named(path);
  if (is_named) measure(path);
  const bool single = path.findings.size() == 1;
  std::erase_if(paths, [&](const Path& each) {
    if (is_named && same_causes(each.findings, path.findings)) return true;
    if (!is_named) return each.log_left > std::log(1.0 - plain_share);
    return single &&
           (each.log_left > path.log_left || each.score < path.score + thresholds_.score_min);
  });
  if (is_named && !single) paths.push_back(path);
  if (paths.empty()) return;
  const double least =
      std::min_element(paths.begin(), paths.end(), less_left<Path, Path>)->log_left;
  std::erase_if(paths, [&](const Path& each) { return each.log_left > least + tie_share; });
  const auto best = std::max_element(
      paths.begin(), paths.end(), [](const Path& a, const Path& b) { return a.score < b.score; });
  if (same_causes(best->findings, path.findings)) return;
  if (thresholds_.by_probability && !each_likely(best->findings)) return;
  path.findings = std::move(best->findings);
  // Each was measured beside the others; all findings' sum is to be what they leave together.
  const double count = static_cast<double>(path.findings.size());
  for (Finding& finding : path.findings)
    finding.explanation.log_left =
        best->log_left / count + std::log(1.0 - thresholds_.later_share_min);
}

}  // namespace thermocomp::diagnosis
