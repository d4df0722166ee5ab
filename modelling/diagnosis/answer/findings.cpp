#include "modelling/diagnosis/answer/findings.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <random>
#include <utility>

#include <Eigen/Cholesky>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/series.hpp"
#include "modelling/diagnosis/rank/posterior.hpp"

namespace thermocomp::diagnosis {

namespace {

constexpr double support_shown_min = 0.001;
constexpr std::size_t alternatives_max = 4;

std::vector<Alternative> alternatives_of(const Finding& finding) {
  std::vector<Alternative> all;
  for (const Explanation& other : finding.weighed) {
    if (other.hypothesis == finding.explanation.hypothesis) continue;
    const double support = other.probability / finding.explanation.probability;
    if (!(support > support_shown_min) || all.size() >= alternatives_max) break;
    const Hypothesis& of = *other.hypothesis;
    const bool known = std::any_of(all.begin(), all.end(), [&](const Alternative& each) {
      return each.cause == of.cause && each.subject == of.subject;
    });
    if (!known) all.push_back({of.cause, of.subject, std::min(1.0, support)});
  }
  return all;
}

std::string evidence_text(const Explanation& of) {
  char text[160];
  std::snprintf(text, sizeof text,
                "takes %.0f %% of the RMS of %s training rows; ln L exceeds that of no cause by "
                "%.0f, its parameters paid for",
                100.0 * share_of_remainder(of), of.hypothesis->run ? "the fitted" : "left-out",
                of.score);
  return text;
}

}  // namespace

double share_of_remainder(const Explanation& explanation) {
  return 1.0 - std::exp(-explanation.left_out_of_best);
}

NamedFinding named_finding(const Finding& finding, const MeasuredData& data,
                           std::vector<Parameter> parameters) {
  const Explanation& each = finding.explanation;
  NamedFinding name{each.hypothesis->cause, each.hypothesis->subject, {}, {}, {}, {}, {}, {}};
  for (std::size_t output = 0; output < each.gains.size(); ++output)
    if (each.gains[output].size() > 0) name.outputs.push_back(data.model.outputs[output]);
  name.parameters = std::move(parameters);
  if (each.hypothesis->run) name.run = data.runs[*each.hypothesis->run].name;
  name.evidence = evidence_text(each);
  name.alternatives = alternatives_of(finding);
  name.family = family_of(name.cause);
  name.probability = finding.probability;
  name.family_probability = finding.family_probability;
  name.group = finding.group;
  return name;
}

std::string verdict_of(const SearchResult& result) {
  if (!result.findings.empty()) return "effect";
  return result.unexplained ? "unexplained" : "none";
}

std::vector<Parameter> parameters_of(const Finding& finding, const MeasuredData& data) {
  const Explanation& each = finding.explanation;
  const Hypothesis& hypothesis = *each.hypothesis;
  const Cause& cause = cause_named(hypothesis.cause);
  std::vector<Parameter> all;
  for (std::size_t i = 0; i < hypothesis.shape.size(); ++i) {
    Parameter parameter{hypothesis.shape[i].name, {{"", each.shape[i]}}, {}};
    if (!hypothesis.shape[i].discrete) parameter.ci95[""] = finding.shape_ci[i];
    all.push_back(std::move(parameter));
  }
  if (hypothesis.gains.empty()) return all;
  const FoundGains found{hypothesis.gains, data.model.outputs, each.gains, finding.gains_ci};
  if (cause.gains != nullptr) {
    for (Parameter& parameter : cause.gains(found)) all.push_back(std::move(parameter));
    return all;
  }
  for (std::size_t i = 0; i < hypothesis.gains.size(); ++i) {
    Parameter gains = gain_table(found, static_cast<Eigen::Index>(i));
    if (hypothesis.output || hypothesis.form == Form::shared_gain) {
      const std::string& output = data.model.outputs[first_output(found)];
      gains = {gains.name, {{"", gains.values.at(output)}}, {{"", gains.ci95.at(output)}}};
    }
    all.push_back(std::move(gains));
  }
  return all;
}

std::vector<TermSpec> terms_of(const Finding& finding, const MeasuredData& data) {
  const Hypothesis& hypothesis = *finding.explanation.hypothesis;
  const std::vector<Parameter> parameters = parameters_of(finding, data);
  std::vector<TermSpec> terms;
  const auto add = [&](const std::string& cause, const std::string& subject) {
    const TermKind* const kind = find_term_kind(cause, subject);
    if (kind == nullptr) return;
    TermSpec term{cause, subject, {}, {}};
    for (const Parameter& parameter : parameters) {
      if (std::none_of(kind->parameters.begin(), kind->parameters.end(),
                       [&](const TermParameter& each) { return each.name == parameter.name; }))
        continue;
      if (parameter.values.contains(""))
        term.shared[parameter.name] = parameter.values.at("");
      else
        term.per_output[parameter.name] = parameter.values;
    }
    if (terms.empty() || !term.per_output.empty()) terms.push_back(std::move(term));
  };
  add(hypothesis.cause, hypothesis.subject);
  if (!terms.empty()) add(hypothesis.simpler_cause, hypothesis.simpler_subject);
  return terms;
}

namespace {

constexpr int resamples = 400;
constexpr int test_blocks = 16;
constexpr double turn = 6.283185307179586;

/// Sine of known period and amplitude, fitted to the residual: only phase and level are free.
Column sine_in(const Column& time_s, const Column& residual, const Correction& correction) {
  const Eigen::ArrayXd angle = turn / correction.period_s * time_s.array();
  Eigen::MatrixXd waves(time_s.size(), 3);
  waves << angle.sin(), angle.cos(), Eigen::ArrayXd::Ones(time_s.size());
  const Eigen::ArrayXd there = residual.array().isFinite().cast<double>();
  const Column values = residual.array().isFinite().select(residual.array(), 0.0);
  waves.array().colwise() *= there;
  const Eigen::Vector3d of = (waves.transpose() * waves).ldlt().solve(waves.transpose() * values);
  return correction.amplitude_um * (angle + std::atan2(of[1], of[0])).sin();
}

/// Sums of squares before and after, by blocks of rows.
std::vector<Eigen::Array2d> squares_by_block(const Residuals& before, const Residuals& after) {
  std::vector<Eigen::Array2d> blocks;
  Eigen::Index rows = 0;
  for (const Column& run : before) rows += run.size();
  const Eigen::Index length = std::max<Eigen::Index>(1, rows / test_blocks);
  for (std::size_t i = 0; i < before.size(); ++i) {
    for (Eigen::Index row = 0; row < before[i].size(); ++row) {
      if (row % length == 0) blocks.emplace_back(Eigen::Array2d::Zero());
      const Eigen::Array2d both(before[i][row], after[i][row]);
      if (both.isFinite().all()) blocks.back() += both.square();
    }
  }
  return blocks;
}

/// The finite values of all runs.
Column present(const Residuals& residuals) {
  std::vector<double> values;
  for (const Column& run : residuals)
    std::copy_if(run.begin(), run.end(), std::back_inserter(values),
                 [](double value) { return std::isfinite(value); });
  return Eigen::Map<const Column>(values.data(), std::ssize(values));
}

}  // namespace

std::vector<Residuals> residuals(const MeasuredData& data) {
  std::vector<Residuals> all(data.model.outputs.size());
  for (const MeasuredRun& run : data.runs)
    for (std::size_t output = 0; output < all.size(); ++output)
      all[output].emplace_back(
          (run.measured_um[output] - run.model_um[output]).tail(run.rows() - run.begin));
  return all;
}

std::vector<Residuals> residuals(const Extended& extended, const MeasuredData& data) {
  std::vector<Residuals> all(data.model.outputs.size());
  for (const MeasuredRun& run : data.runs) {
    std::vector<Column> predictions = model_over(extended.model, run, data);
    for (std::size_t output = 0; output < all.size(); ++output) {
      Column& predicted = predictions[output];
      const Column& measured = run.measured_um[output];
      Eigen::Index start = 0;
      while (start < run.rows() && !std::isfinite(measured[start])) ++start;
      for (const Correction& correction : extended.corrections) {
        if (correction.output != output) continue;
        if (correction.period_s > 0)
          predicted += sine_in(run.time_s, measured - predicted, correction);
        else
          predicted = shifted(run.time_s, predicted, correction.shift_s);
      }
      if (start < run.rows()) predicted.array() -= double(predicted[start]);
      all[output].emplace_back((measured - predicted).tail(run.rows() - run.begin));
    }
  }
  return all;
}

double root_mean_square(const Residuals& residuals) {
  const Column values = present(residuals);
  return values.size() > 0 ? std::sqrt(values.squaredNorm() / static_cast<double>(values.size()))
                           : not_a_number;
}

double peak(const Residuals& residuals) {
  const Column values = present(residuals);
  return values.size() > 0 ? values.cwiseAbs().maxCoeff() : not_a_number;
}

OutputFigures output_figures(const Residuals& train, const Residuals& test,
                             const Residuals& extended_test, double unexplained_fraction) {
  return {root_mean_square(train),         root_mean_square(test), peak(test),
          root_mean_square(extended_test), peak(extended_test),    unexplained_fraction};
}

TestGain test_gain(const Residuals& before, const Residuals& after) {
  TestGain gain{root_mean_square(before), root_mean_square(after), 0.0, {}};
  gain.reduction = 1.0 - gain.after_um / gain.before_um;
  const std::vector<Eigen::Array2d> blocks = squares_by_block(before, after);
  std::mt19937_64 random(1);  // reproducible
  std::uniform_int_distribution<std::size_t> draw(0, blocks.size() - 1);
  std::vector<double> reductions;
  for (int i = 0; i < resamples; ++i) {
    Eigen::Array2d sum = Eigen::Array2d::Zero();
    for (std::size_t j = 0; j < blocks.size(); ++j) sum += blocks[draw(random)];
    if (sum[0] > 0) reductions.push_back(1.0 - std::sqrt(sum[1] / sum[0]));
  }
  if (reductions.empty()) return gain;
  std::sort(reductions.begin(), reductions.end());
  const auto at = [&](double share) {
    return reductions[static_cast<std::size_t>(share * static_cast<double>(reductions.size() - 1))];
  };
  gain.ci95 = {at(0.025), at(0.975)};
  return gain;
}

bool fails_on_test_runs(const NamedFinding& finding) {
  return !finding.test.empty() &&
         std::none_of(finding.test.begin(), finding.test.end(),
                      [](const auto& of_output) { return of_output.second.reduction > 0; });
}

}  // namespace thermocomp::diagnosis
