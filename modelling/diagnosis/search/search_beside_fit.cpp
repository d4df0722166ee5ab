#include "modelling/diagnosis/search/search_beside_fit.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {
namespace {

/// What a fit leaves has little of what is slow, and much can be said of it: a cause takes more of
/// left-out rows than one in other rows needs to.
constexpr double left_out_gain_min = 0.4;
/// Factors between which a shape parameter is sought beside a grid point.
constexpr double first_step = 1.2;
constexpr double last_step = 1.003;

/// The data of some of the outputs. The model's terms are in its predictions already.
MeasuredData data_of(const MeasuredData& all, const std::vector<std::size_t>& outputs) {
  MeasuredData some = all;
  some.coefficient_sd = 0.0;  // they are what the fit made them
  some.model.terms.clear();
  some.model.outputs.clear();
  some.model.matrix_um_per_K.clear();
  some.least_noise_um.clear();
  for (MeasuredRun& run : some.runs) {
    run.model_um.clear();
    run.measured_um.clear();
  }
  for (const std::size_t output : outputs) {
    some.model.outputs.push_back(all.model.outputs[output]);
    some.model.matrix_um_per_K.push_back(all.model.matrix_um_per_K[output]);
    if (output < all.least_noise_um.size())
      some.least_noise_um.push_back(all.least_noise_um[output]);
    for (std::size_t run = 0; run < all.runs.size(); ++run) {
      some.runs[run].model_um.push_back(all.runs[run].model_um[output]);
      some.runs[run].measured_um.push_back(all.runs[run].measured_um[output]);
    }
  }
  return some;
}

TakenByFit taken_of(const Hypothesis& hypothesis) {
  return cause_named(hypothesis.cause).taken_by_fit;
}

/// A fit takes all of what is a sum of the inputs: nothing of it can be seen.
bool taken_by_fit(const Hypothesis& hypothesis) {
  return taken_of(hypothesis) == TakenByFit::all;
}

Eigen::MatrixXd columns_of(const Hypothesis& hypothesis, const Shape& shape, std::size_t output) {
  return hypothesis.columns({shape}, output);
}

/// Of its columns what a fit takes something of. The pivot of a position is a coefficient: the fit
/// has it.
Eigen::MatrixXd absorbable(const Hypothesis& hypothesis, Eigen::MatrixXd columns) {
  if (taken_of(hypothesis) == TakenByFit::but_a_pivot) columns.col(1).setZero();
  return columns;
}

/// Whether the fit can be made again with its columns beside the inputs.
bool stands_beside_inputs(const Finding& finding) {
  const Hypothesis& of = *finding.explanation.hypothesis;
  return of.form == Form::own_gains && !of.run && taken_of(of) != TakenByFit::but_a_pivot;
}

bool same_first(const SearchResult& a, const SearchResult& b) {
  const Hypothesis& first = *a.findings.front().explanation.hypothesis;
  const Hypothesis& other = *b.findings.front().explanation.hypothesis;
  return first.cause == other.cause && first.subject == other.subject;
}

}  // namespace

SearchBesideFit::SearchBesideFit(const MeasuredData& data, const Thresholds& thresholds)
    : data_(data),
      thresholds_(thresholds),
      rows_(stacked_rows(data)),
      fit_(OwnFit::recognised(data, rows_)) {
  thresholds_.left_out_gain_min = left_out_gain_min;
  thresholds_.in_pairs = false;
  thresholds_.by_gates = true;
}

std::unique_ptr<SearchBesideFit::Group> SearchBesideFit::searched(
    const std::vector<std::size_t>& outputs) const {
  auto group = std::make_unique<Group>();
  group->outputs = outputs;
  group->data = std::make_unique<MeasuredData>(data_of(data_, outputs));
  group->acting = hypotheses(*group->data, rows_);
  std::vector<Hypothesis> left;
  for (const Hypothesis& acting : group->acting) {
    if (taken_by_fit(acting)) continue;
    Hypothesis& beside = left.emplace_back(acting);
    beside.write_columns =
        one_by_one([&acting, fit = &*fit_, outputs](const Shape& shape,
                                                    std::size_t output) -> Eigen::MatrixXd {
          const Eigen::MatrixXd columns = columns_of(acting, shape, output);
          return columns - fit->predicted(absorbable(acting, columns), outputs[output]);
        });
    // The ways around a hypothesis' columns lead to what acts.
    beside.of_readings = {};
    beside.from_onset = {};
    // What is possible is so beside a coefficient that the cause has not gone into.
    if (beside.form == Form::own_gains) beside.possible = {};
  }
  group->search =
      std::make_unique<Search>(*group->data, thresholds_, std::move(left), Search::Accepted{});
  group->result = group->search->run();
  const std::vector<Finding>& findings = group->result.findings;
  if (std::all_of(findings.begin(), findings.end(), stands_beside_inputs)) fit_again(*group);
  return group;
}

/// The likelihood of the search leaves out what it can of slow changes, and so what the causes did
/// to the coefficients. The extended model is to predict all of it: what the model's own fit makes
/// of the causes when their columns stand beside the inputs.
void SearchBesideFit::fit_again(Group& group) const {
  std::vector<Finding>& findings = group.result.findings;
  for (std::size_t round = 0; round < findings.size(); ++round)
    for (Finding& finding : findings) fit_shape_again(group, finding);
  refit_gains(group);
}

void SearchBesideFit::fit_shape_again(Group& group, Finding& finding) const {
  std::vector<double>& shape = finding.explanation.shape;
  std::vector<double> best = shape;
  double least = refit_gains(group);
  const auto consider = [&](const Shape& other) {
    shape = other;
    const double left = refit_gains(group);
    if (!(left < least)) return;
    least = left;
    best = other;
  };
  const Hypothesis& hypothesis = *finding.explanation.hypothesis;
  for (const Shape& point : grid_of(hypothesis)) consider(point);
  for (std::size_t i = 0; i < hypothesis.shape.size(); ++i) {
    if (!hypothesis.shape[i].logarithmic || !(best[i] > 0)) continue;
    for (double factor = first_step; factor > last_step; factor = std::sqrt(factor)) {
      const double centre = best[i];
      for (const double value : {centre * factor, centre / factor}) {
        Shape other = best;
        other[i] = value;
        consider(other);
      }
    }
  }
  shape = best;
}

/// Gains of all findings together, the model's own fit made again beside them.
/// @return what it leaves: the sum over outputs of ln(share)
double SearchBesideFit::refit_gains(Group& group) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < group.outputs.size(); ++i) {
    Eigen::MatrixXd columns(rows_.time_s.size(), 0);
    for (const Finding& finding : group.result.findings) {
      const Explanation& each = finding.explanation;
      if (each.gains[i].size() == 0) continue;
      const Eigen::MatrixXd acting = columns_of(acting_of(group, each), each.shape, i);
      columns.conservativeResize(Eigen::NoChange, columns.cols() + acting.cols());
      columns.rightCols(acting.cols()) = acting;
    }
    if (columns.cols() == 0) continue;
    const OwnFit::Refit refit = fit_->refit_with(columns, group.outputs[i]);
    Eigen::Index at = 0;
    for (Finding& finding : group.result.findings) {
      Eigen::VectorXd& gains = finding.explanation.gains[i];
      gains = refit.gains.segment(at, gains.size()).eval();
      at += gains.size();
    }
    sum += std::log(std::max(refit.left_share, 1e-12));
  }
  return sum;
}

/// Findings are told by all outputs of the data.
void SearchBesideFit::take(std::unique_ptr<Group> group, SearchResult& result) {
  const auto spread = [&](std::vector<Eigen::VectorXd>& of_group) {
    std::vector<Eigen::VectorXd> all(data_.model.outputs.size());
    for (std::size_t i = 0; i < group->outputs.size(); ++i)
      all[group->outputs[i]] = std::move(of_group[i]);
    of_group = std::move(all);
  };
  for (std::size_t i = 0; i < group->outputs.size(); ++i)
    result.unexplained_share[group->outputs[i]] = group->result.unexplained_share[i];
  for (Finding finding : group->result.findings) {
    spread(finding.explanation.gains);
    spread(finding.gain_sd);
    result.findings.push_back(std::move(finding));
  }
  if (result.families.empty()) result.families = group->result.families;
  groups_.push_back(std::move(group));
}

SearchResult SearchBesideFit::run() {
  SearchResult result;
  result.unexplained_share.assign(data_.model.outputs.size(), 1.0);
  if (!fit_) return result;
  std::size_t searches = 0;
  const auto note_weighed = [&](const Group& group) {
    ++searches;
    for (Weighed each : group.result.weighed) {
      each.beside_fit = searches;
      result.weighed.push_back(std::move(each));
    }
  };
  std::vector<std::unique_ptr<Group>> alone;
  for (const std::size_t output : fit_->outputs()) {
    std::unique_ptr<Group> group = searched({output});
    note_weighed(*group);
    if (!group->result.findings.empty()) alone.push_back(std::move(group));
  }
  while (!alone.empty()) {
    const auto others = std::stable_partition(alone.begin(), alone.end(), [&](const auto& each) {
      return same_first(each->result, alone.front()->result);
    });
    std::vector<std::size_t> outputs;
    for (auto each = alone.begin(); each != others; ++each)
      outputs.push_back((*each)->outputs.front());
    std::unique_ptr<Group> together;
    if (outputs.size() > 1) together = searched(outputs);
    if (together) note_weighed(*together);
    if (together && !together->result.findings.empty())
      take(std::move(together), result);
    else
      for (auto each = alone.begin(); each != others; ++each) take(std::move(*each), result);
    alone.erase(alone.begin(), others);
  }
  return result;
}

/// The displacement itself, of which the hypothesis of an explanation is what the fit leaves.
const Hypothesis& SearchBesideFit::acting_of(const Group& group, const Explanation& explanation) {
  const Hypothesis& of = *explanation.hypothesis;
  return *std::find_if(group.acting.begin(), group.acting.end(), [&](const Hypothesis& acting) {
    return acting.cause == of.cause && acting.subject == of.subject && acting.run == of.run;
  });
}

std::vector<TermSpec> SearchBesideFit::corrections(const Finding& finding) const {
  const Explanation& each = finding.explanation;
  std::vector<TermSpec> terms;
  for (const std::string& input : data_.model.inputs)
    terms.push_back({"wrong_coefficient", input, {}, {{"delta_um_per_K", {}}}});
  for (const auto& group : groups_) {
    for (std::size_t i = 0; i < group->outputs.size(); ++i) {
      const std::size_t output = group->outputs[i];
      if (each.gains[output].size() == 0) continue;
      const Hypothesis& acting = acting_of(*group, each);
      const Eigen::VectorXd delta =
          -fit_->absorbed(absorbable(acting, columns_of(acting, each.shape, i)), output) *
          each.gains[output];
      for (std::size_t input = 0; input < terms.size(); ++input)
        terms[input].per_output.at("delta_um_per_K")[data_.model.outputs[output]] =
            delta[static_cast<Eigen::Index>(input)];
    }
  }
  return terms;
}

double log_left_by(const SearchResult& result) {
  double sum = 0.0;
  for (const Finding& finding : result.findings) sum += finding.explanation.log_left;
  return sum;
}

}  // namespace thermocomp::diagnosis
