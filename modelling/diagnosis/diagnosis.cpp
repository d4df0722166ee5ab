#include "modelling/diagnosis/diagnosis.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "modelling/diagnosis/extended_model.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr int resamples = 400;
constexpr int test_blocks = 16;
/// Rows are correlated: 2 ln L overstates what a difference is worth. Support is told as if one row
/// in ten were a new one.
constexpr double independent_share = 0.1;
constexpr double support_shown_min = 0.001;
constexpr std::size_t alternatives_max = 4;

struct Residuals {
  std::vector<Column> by_run;  ///< over the selected rows; NaN where nothing was measured
};

/// measured - model over the selected rows of every run, both from the run's first row on.
Residuals residuals(const ThermalModel& model, const MeasuredData& data, std::size_t output) {
  Residuals all;
  for (const MeasuredRun& run : data.runs) {
    Column predicted = model_over(model, run, data)[output];
    const Column& measured = run.measured_um[output];
    Eigen::Index start = 0;
    while (start < run.rows() && !std::isfinite(measured[start])) ++start;
    if (start < run.rows()) predicted.array() -= double(predicted[start]);
    all.by_run.emplace_back((measured - predicted).tail(run.rows() - run.begin));
  }
  return all;
}

double root_mean_square(const Residuals& residuals) {
  double sum = 0.0;
  double count = 0.0;
  for (const Column& run : residuals.by_run) {
    for (const double value : run) {
      if (!std::isfinite(value)) continue;
      sum += value * value;
      count += 1.0;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : not_a_number;
}

double peak(const Residuals& residuals) {
  double largest = not_a_number;
  for (const Column& run : residuals.by_run)
    for (const double value : run)
      if (std::isfinite(value) && !(std::abs(value) <= largest)) largest = std::abs(value);
  return largest;
}

struct BlockSquares {
  double before{0.0};
  double after{0.0};
};

std::vector<BlockSquares> squares_by_block(const Residuals& before, const Residuals& after) {
  std::vector<BlockSquares> blocks;
  Eigen::Index rows = 0;
  for (const Column& run : before.by_run) rows += run.size();
  const Eigen::Index length = std::max<Eigen::Index>(1, rows / test_blocks);
  for (std::size_t i = 0; i < before.by_run.size(); ++i) {
    for (Eigen::Index row = 0; row < before.by_run[i].size(); ++row) {
      if (row % length == 0) blocks.emplace_back();
      const double a = before.by_run[i][row];
      const double b = after.by_run[i][row];
      if (!std::isfinite(a) || !std::isfinite(b)) continue;
      blocks.back().before += a * a;
      blocks.back().after += b * b;
    }
  }
  return blocks;
}

TestGain test_gain(const Residuals& before, const Residuals& after) {
  TestGain gain{root_mean_square(before), root_mean_square(after), 0.0, {}};
  gain.reduction = 1.0 - gain.after_um / gain.before_um;
  const std::vector<BlockSquares> blocks = squares_by_block(before, after);
  std::mt19937_64 random(1);  // the same answer for the same data
  std::uniform_int_distribution<std::size_t> draw(0, blocks.size() - 1);
  std::vector<double> reductions;
  for (int i = 0; i < resamples; ++i) {
    BlockSquares sum;
    for (std::size_t j = 0; j < blocks.size(); ++j) {
      const BlockSquares& block = blocks[draw(random)];
      sum.before += block.before;
      sum.after += block.after;
    }
    if (sum.before > 0) reductions.push_back(1.0 - std::sqrt(sum.after / sum.before));
  }
  if (reductions.empty()) return gain;
  std::sort(reductions.begin(), reductions.end());
  const auto at = [&](double share) {
    return reductions[static_cast<std::size_t>(share * static_cast<double>(reductions.size() - 1))];
  };
  gain.ci95 = {at(0.025), at(0.975)};
  return gain;
}

std::vector<Alternative> alternatives_of(const Finding& finding) {
  std::vector<Alternative> all;
  for (const Explanation& other : finding.alternatives) {
    const double support =
        std::exp(-0.5 * independent_share * (finding.explanation.score - other.score));
    if (support < support_shown_min || all.size() >= alternatives_max) break;
    const Hypothesis& of = *other.hypothesis;
    const bool known = std::any_of(all.begin(), all.end(), [&](const Alternative& each) {
      return each.cause == of.cause && each.subject == of.subject;
    });
    if (!known) all.push_back({of.cause, of.subject, std::min(1.0, support)});
  }
  return all;
}

std::string evidence_text(const Finding& finding) {
  char text[160];
  std::snprintf(
      text, sizeof text,
      "takes %.0f %% of the RMS of %s training rows; 2 ln L gains %.0f beyond the price of "
      "its parameters",
      100.0 * finding.explanation.left_out_gain,
      finding.explanation.hypothesis->run ? "the fitted" : "left-out", finding.explanation.score);
  return text;
}

NamedFinding named(const Finding& finding, const MeasuredData& train) {
  const Explanation& each = finding.explanation;
  NamedFinding name{each.hypothesis->cause, each.hypothesis->subject, {}, {}, {}, {}, {}, {}};
  for (std::size_t output = 0; output < each.gains.size(); ++output)
    if (each.gains[output].size() > 0) name.outputs.push_back(train.model.outputs[output]);
  name.parameters = parameters_of(finding, train);
  if (each.hypothesis->run) name.run = train.runs[*each.hypothesis->run].name;
  name.evidence = evidence_text(finding);
  name.alternatives = alternatives_of(finding);
  return name;
}

/// The model with each finding added after those before it, and what each gains.
void extend(Diagnosis& diagnosis, const std::vector<Finding>& findings, const MeasuredData& train,
            const MeasuredData& test) {
  for (const Finding& finding : findings) {
    NamedFinding name = named(finding, train);
    const std::optional<TermSpec> term = term_of(finding, train);
    if (term) {
      ThermalModel longer = diagnosis.extended;
      longer.terms.push_back(*term);
      for (const std::string& output : name.outputs) {
        const auto index = static_cast<std::size_t>(
            std::find(train.model.outputs.begin(), train.model.outputs.end(), output) -
            train.model.outputs.begin());
        const Residuals before = residuals(diagnosis.extended, test, index);
        if (std::isfinite(root_mean_square(before)))
          name.test[output] = test_gain(before, residuals(longer, test, index));
      }
      diagnosis.extended = std::move(longer);
    }
    diagnosis.findings.push_back(std::move(name));
  }
}

}  // namespace

Diagnosis diagnose(const ThermalModel& model, const std::vector<RunFile>& train,
                   const std::vector<std::string>& train_names, const std::vector<RunFile>& test,
                   const std::vector<std::string>& test_names) {
  std::vector<RunFile> all = train;
  all.insert(all.end(), test.begin(), test.end());
  const SharedColumns columns = shared_columns(model, all);
  const MeasuredData train_data = measured_data(model, train, train_names, columns);
  const MeasuredData test_data = measured_data(model, test, test_names, columns);
  Search search(train_data, Thresholds{});
  const SearchResult result = search.run();

  Diagnosis diagnosis;
  diagnosis.extended = model;
  diagnosis.weighed = result.weighed;
  extend(diagnosis, result.findings, train_data, test_data);
  diagnosis.verdict = !diagnosis.findings.empty() ? "effect"
                      : result.unexplained        ? "unexplained"
                                                  : "none";
  for (std::size_t output = 0; output < model.outputs.size(); ++output) {
    const Residuals base = residuals(model, test_data, output);
    const Residuals extended = residuals(diagnosis.extended, test_data, output);
    diagnosis.outputs[model.outputs[output]] = {
        root_mean_square(residuals(model, train_data, output)),
        root_mean_square(base),
        peak(base),
        root_mean_square(extended),
        peak(extended),
        result.unexplained_share[output]};
  }
  return diagnosis;
}

}  // namespace thermocomp::diagnosis
