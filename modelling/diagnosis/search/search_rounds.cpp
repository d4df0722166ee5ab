// One finding after another, refitted together.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/LU>

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
/// Student's t of seven degrees of freedom over the normal distribution at 97.5 %: what eight
/// blocks tell is itself uncertain.
constexpr double few_blocks = 1.2;

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

/// From the curvature of 2 ln L at its peak: it falls by 1 a standard deviation away. Where a side
/// of the peak is physically impossible, the other one tells.
double Search::shape_sd(const Explanation& explanation, std::size_t parameter) const {
  const ShapeParameter& of = explanation.hypothesis->shape[parameter];
  if (of.discrete || !(explanation.score > 0)) return 0.0;
  const double value = explanation.shape[parameter];
  if (of.logarithmic && !(value > 0)) return 0.0;
  const double range = of.logarithmic ? 1.0 : of.grid.back() - of.grid.front();
  const auto at = [&](double move) -> std::optional<double> {
    Explanation moved = explanation;
    moved.shape[parameter] = of.logarithmic ? value * std::exp(move) : value + move;
    Trial trial = weigh(*moved.hypothesis, moved.shape, moved.settings);
    moved.gains = std::move(trial.gains);
    return acts(moved) ? std::optional<double>(trial.score) : std::nullopt;
  };
  const std::optional<double> peak = at(0.0);
  if (!peak) return range;
  // The curvature is taken where it can be seen above rounding: a fall of a few units.
  for (double step = 1e-3 * range; step < range; step *= 2.0) {
    const std::optional<double> above = at(step);
    const std::optional<double> below = at(-step);
    if (!above && !below) return range;
    const double fall =
        *peak - 0.5 * (above.value_or(below.value_or(0.0)) + below.value_or(above.value_or(0.0)));
    if (fall > 4.0) return step / std::sqrt(fall);
  }
  return range;
}

/// How many times wider intervals are than if whitened rows were independent, since no noise of
/// this search is quite that of a machine: scores summed over each of the blocks that can be left
/// out tell, the blocks being far longer than what correlates neighbours.
///
///   factor^2 = B / (B - 1) sum_b (sum_(i in b) x_i w_i)^2 / (sigma^2 sum_i x_i^2)
///
/// with x the whitened column beside the common ones and w what the fit leaves of the residual.
/// Source: the cluster-robust covariance of Liang and Zeger (1986), for one column.
double Search::widening(const Setting& setting, const Panel& columns,
                        const Eigen::VectorXd& gains) const {
  const double count = static_cast<double>(rows_.blocks.size());
  if (count < 2) return 1.0;
  const Panel acting = columns * gains;
  const Eigen::MatrixXd white = setting.whitener().apply(acting);
  const Eigen::MatrixXd common = setting.against().rightCols(setting.precision().size());
  Eigen::MatrixXd square = common.transpose() * common;
  square.diagonal() += setting.precision();
  const Eigen::LLT<Eigen::MatrixXd> factor(square);
  const auto beside = [&](const Eigen::VectorXd& of) -> Eigen::VectorXd {
    return of - common * factor.solve(common.transpose() * of);
  };
  const Eigen::VectorXd x = beside(white.col(0));
  const Eigen::VectorXd residual = beside(setting.against().col(0));
  const double squares = x.squaredNorm();
  if (!(squares > 0)) return 1.0;
  const Eigen::VectorXd left = residual - x * (x.dot(residual) / squares);
  double scores = 0.0;
  for (const Block& block : rows_.blocks) {
    const Eigen::Index rows = block.end - block.begin;
    scores += std::pow(x.segment(block.begin, rows).dot(left.segment(block.begin, rows)), 2);
  }
  const double variance = left.squaredNorm() / setting.present_rows();
  const double wider = count / (count - 1.0) * scores / std::max(1e-300, variance * squares);
  return few_blocks * std::sqrt(std::max(1.0, wider));
}

double Search::row_step_s() const {
  double length_s = 0.0;
  double steps = 0.0;
  for (const Block& run : rows_.runs) {
    length_s += rows_.time_s[run.end - 1] - rows_.time_s[run.begin];
    steps += static_cast<double>(run.end - 1 - run.begin);
  }
  return steps > 0 ? length_s / steps : 0.0;
}

/// White noise instead of the likeliest, where rows left out are predicted better by it.
void Search::settle_for_left_out_rows(Explanation& explanation) const {
  if (explanation.hypothesis->run) return;  // nothing of it stays in other rows
  Explanation plain = in_white_noise(explanation);
  if (plain.settings == explanation.settings) return;
  refine(plain);
  if (!acts(plain)) return;
  LeftOut left_out(rows_, outputs_);
  if (left_out.gain_on_left_out_blocks(plain).log_left <
      left_out.gain_on_left_out_blocks(explanation).log_left)
    explanation = std::move(plain);
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
    settle_for_left_out_rows(each);
    finding.shape_sd.clear();
    for (std::size_t k = 0; k < each.shape.size(); ++k)
      finding.shape_sd.push_back(shape_sd(each, k));
    finding.gain_sd.assign(outputs_.size(), Eigen::VectorXd());
    double wider = 1.0;
    for (const std::size_t output : measured_) {
      if (each.gains[output].size() == 0) continue;
      const Setting& setting = *each.settings[output];
      const Panel columns = columns_of(*each.hypothesis, Shapes{each.shape}, outputs_[output]);
      const EquationsTable of =
          Setting::equations_of_groups({&setting}, columns, columns.cols()).front();
      const double squares = setting.squares() - of.taken(0, each.gains[output]);
      const double variance = std::max(0.0, squares) / setting.present_rows();
      const bool no_gain = each.hypothesis->form == Form::no_gain;
      const double times = widening(setting, columns,
                                    no_gain ? Eigen::VectorXd(Eigen::VectorXd::Ones(columns.cols()))
                                            : Eigen::VectorXd(each.gains[output]));
      wider = std::max(wider, times);
      finding.gain_sd[output] =
          times * (variance * Eigen::MatrixXd(of.square(0)).inverse().diagonal()).array().sqrt();
    }
    for (std::size_t k = 0; k < finding.shape_sd.size(); ++k) {
      finding.shape_sd[k] *= wider;
      // An onset is anywhere between two rows.
      if (each.hypothesis->run && !each.hypothesis->shape[k].logarithmic)
        finding.shape_sd[k] = std::hypot(finding.shape_sd[k], row_step_s() / std::sqrt(3.0));
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
    for (std::size_t i = 0; i < std::min(weighed_shown, candidates.size()); ++i)
      path.weighed.push_back({round, candidates[i].hypothesis->cause,
                              candidates[i].hypothesis->subject, candidates[i].score,
                              candidates[i].left_out_gain, candidates[i].log_left});
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
/// probabilities.
void Search::put_likeliest_first(std::vector<Explanation>& candidates, Path& path) const {
  if (!thresholds_.by_probability || candidates.empty()) return;
  const Posterior all = posterior(candidates);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    candidates[i].probability = all.of[i];
    candidates[i].family_probability = all.families.at(family_of(candidates[i].hypothesis->cause));
  }
  std::size_t best = 0;
  double most = 0.0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const double of_group = probability_of_group(candidates, all, groups_, i);
    const bool likelier = of_group > most * (1.0 + 1e-9) ||
                          (of_group > most * (1.0 - 1e-9) && all.of[i] > all.of[best]);
    if (!likelier) continue;
    most = of_group;
    best = i;
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
  const bool little =
      !thresholds_.by_probability && 1.0 - left_variance < thresholds_.carried_share_min;
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
