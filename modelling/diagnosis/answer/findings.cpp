#include "modelling/diagnosis/answer/findings.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <random>
#include <utility>

#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/identification/families/bank_fit.hpp"

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
  name.family = cause_named(name.cause).family;
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
  for (MeasuredRun run : data.runs) {
    for (const Correction& correction : extended.corrections)
      if (correction.readings) correction.readings(data, run);
    std::vector<Column> predictions = model_over(extended.model, run, data);
    for (std::size_t output = 0; output < all.size(); ++output) {
      Column& predicted = predictions[output];
      const Column& measured = run.measured_um[output];
      Eigen::Index start = 0;
      while (start < run.rows() && !std::isfinite(measured[start])) ++start;
      for (const Correction& correction : extended.corrections)
        if (correction.prediction && correction.affects[output])
          correction.prediction(run, output, predicted);
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

namespace {

using identification::BankColumns;
using identification::BankEquations;
using identification::MeasuredTests;

constexpr std::size_t blocks = 8;
constexpr double gain_min = 0.1;
/// Rows of all runs; more are thinned. Steps remain short against the shortest low pass.
constexpr Eigen::Index rows_max = 6000;

/// Every n-th row.
Eigen::VectorXd thinned(const Column& values, Eigen::Index apart) {
  return values(Eigen::seq(0, values.size() - 1, apart));
}

bool varies(const MeasuredData& data, std::size_t signal) {
  const double first = data.runs.front().signals[signal][0];
  return std::any_of(data.runs.begin(), data.runs.end(), [&](const MeasuredRun& run) {
    return (run.signals[signal].array() != first).any();
  });
}

/// Recorded temperatures and signals as input of a bank, without an output.
MeasuredTests inputs_of(const MeasuredData& data, Eigen::Index apart) {
  MeasuredTests tests;
  tests.places = data.temperatures;
  std::vector<std::size_t> moving;
  for (std::size_t i = 0; i < data.signals.size(); ++i) {
    if (!varies(data, i)) continue;
    moving.push_back(i);
    tests.signals.push_back(data.signals[i]);
  }
  for (const MeasuredRun& run : data.runs) {
    identification::TestRun& test = tests.runs.emplace_back();
    test.name = run.name;
    test.time_s = thinned(run.time_s, apart);
    test.begin = (run.begin + apart - 1) / apart;
    const Eigen::Index rows = test.time_s.size();
    test.places_K.resize(rows, std::ssize(tests.places));
    for (Eigen::Index place = 0; place < test.places_K.cols(); ++place)
      test.places_K.col(place) = thinned(run.temps_K[static_cast<std::size_t>(place)], apart);
    test.signals.resize(rows, std::ssize(moving));
    for (std::size_t i = 0; i < moving.size(); ++i)
      test.signals.col(static_cast<Eigen::Index>(i)) = thinned(run.signals[moving[i]], apart);
  }
  return tests;
}

/// Eight blocks over all runs, at least one of each.
void add_folds(MeasuredTests& tests) {
  const std::size_t of_a_run = std::max<std::size_t>(1, blocks / tests.runs.size());
  for (std::size_t run = 0; run < tests.runs.size(); ++run) {
    const Eigen::Index begin = tests.runs[run].begin;
    const Eigen::Index rows = tests.runs[run].time_s.size() - begin;
    const auto edge = [&](std::size_t i) {
      return begin + rows * static_cast<Eigen::Index>(i) / static_cast<Eigen::Index>(of_a_run);
    };
    for (std::size_t i = 0; i < of_a_run; ++i)
      if (edge(i + 1) > edge(i)) tests.folds.push_back({run, edge(i), edge(i + 1)});
  }
}

/// Sets the residuals of an output; NaN before the selection.
void set_output(MeasuredTests& tests, const MeasuredData& data, const Residuals& left,
                Eigen::Index apart) {
  for (std::size_t run = 0; run < tests.runs.size(); ++run) {
    Column whole = Column::Constant(data.runs[run].rows(), not_a_number);
    whole.tail(left[run].size()) = left[run];
    tests.runs[run].outputs_um = thinned(whole, apart);
  }
}

/// Adds the displacement of the matrix, so that its coefficients can be fitted again.
void add_matrix(MeasuredTests& tests, const Eigen::VectorXd& row) {
  for (identification::TestRun& run : tests.runs)
    run.outputs_um += run.places_K.leftCols(row.size()) * row;
}

/// Static equations of the model's inputs for the displacement including that of the matrix.
BankEquations static_equations(MeasuredTests tests, const ThermalModel& model,
                               const Eigen::VectorXd& row) {
  tests.places = model.inputs;
  tests.signals.clear();
  for (identification::TestRun& run : tests.runs) {
    run.places_K = run.places_K.leftCols(row.size()).eval();
    run.signals.resize(run.time_s.size(), 0);
  }
  add_matrix(tests, row);
  const BankColumns at_once{model.inputs, std::vector<double>(model.inputs.size(), 1.0), {0.0}, {}};
  return {tests, at_once};
}

/// Sums over rows with a value.
struct Sums {
  double rows{0.0};
  double values{0.0};
  double squares{0.0};

  void add(const Eigen::VectorXd& each) {
    const auto present = each.array().isFinite();
    rows += static_cast<double>(present.count());
    values += present.select(each.array(), 0.0).sum();
    squares += present.select(each.array().square(), 0.0).sum();
  }
  [[nodiscard]] double about_the_mean() const {
    return rows > 0 ? squares - values * values / rows : 0.0;
  }
};

double total(const std::vector<Sums>& all) {
  double sum = 0.0;
  for (const Sums& each : all) sum += each.about_the_mean();
  return sum;
}

struct Judged {
  LeftOutRms gain;
  bool helps{false};
};

/// Residual of a left-out fold; without a bank the output itself.
Eigen::VectorXd left_of(const MeasuredTests& tests, std::size_t f, const BankEquations* bank) {
  const identification::Fold& fold = tests.folds[f];
  const Eigen::Index count = fold.end - fold.begin;
  Eigen::VectorXd y = tests.runs[fold.run].outputs_um.middleRows(fold.begin, count);
  if (bank != nullptr) y -= bank->rows()[fold.run].middleRows(fold.begin, count) * bank->fit(f);
  return y;
}

/// The noise of a run's first row is an offset of all others, which a bank could fit, so the
/// residual must also fall about each run's mean.
/// @param static_fit  the fit to compare with; none: no prediction
Judged judged(const MeasuredTests& tests, const BankEquations& bank,
              const BankEquations* static_fit) {
  std::vector<double> gains;
  std::vector<Sums> was(tests.runs.size());
  std::vector<Sums> is(tests.runs.size());
  double before = 0.0;
  double after = 0.0;
  double rows = 0.0;
  for (std::size_t f = 0; f < tests.folds.size(); ++f) {
    const std::size_t run = tests.folds[f].run;
    const Eigen::VectorXd without = left_of(tests, f, static_fit);
    const Eigen::VectorXd with = left_of(tests, f, &bank);
    Sums of_without;
    Sums of_with;
    of_without.add(without);
    of_with.add(with);
    was[run].add(without);
    is[run].add(with);
    before += of_without.squares;
    after += of_with.squares;
    rows += of_without.rows;
    gains.push_back(of_without.squares - of_with.squares);
  }
  Judged left;
  if (!(rows > 0) || !(before > 0)) return left;
  left.gain = {std::sqrt(before / rows), std::sqrt(after / rows)};
  const auto folds = static_cast<double>(gains.size());
  const double mean = (before - after) / folds;
  double squares = 0.0;
  for (const double each : gains) squares += (each - mean) * (each - mean);
  const double error = folds > 1 ? std::sqrt(squares / (folds * (folds - 1.0))) : mean;
  constexpr double kept_squares = (1.0 - gain_min) * (1.0 - gain_min);
  left.helps =
      mean > error && after < kept_squares * before && total(is) < kept_squares * total(was);
  return left;
}

}  // namespace

std::optional<RemainderBank> remainder_bank(const MeasuredData& train,
                                            const std::vector<Residuals>& left,
                                            const std::vector<bool>& fitted,
                                            std::vector<double>& predictable) {
  predictable.assign(left.size(), 0.0);
  Eigen::Index rows = 0;
  for (const MeasuredRun& run : train.runs) rows += run.rows();
  const Eigen::Index apart = 1 + (rows - 1) / rows_max;
  MeasuredTests tests = inputs_of(train, apart);
  add_folds(tests);
  BankColumns columns = identification::bank_columns(tests);
  identification::add_hinges(tests, columns);
  std::vector<std::string> outputs;
  std::vector<Eigen::VectorXd> gains;
  RemainderBank bank;
  for (std::size_t output = 0; output < left.size(); ++output) {
    set_output(tests, train, left[output], apart);
    const std::vector<double>& coefficients = train.model.matrix_um_per_K[output];
    const Eigen::VectorXd row =
        Eigen::Map<const Eigen::VectorXd>(coefficients.data(), std::ssize(coefficients));
    std::optional<BankEquations> static_fit;
    if (fitted[output]) {
      static_fit = static_equations(tests, train.model, row);
      add_matrix(tests, row);
    }
    const BankEquations equations(tests, columns);
    const Judged of_output = judged(tests, equations, static_fit ? &*static_fit : nullptr);
    if (of_output.gain.before_um > 0)
      predictable[output] =
          std::max(0.0, 1.0 - std::pow(of_output.gain.after_um / of_output.gain.before_um, 2));
    if (!of_output.helps) continue;
    outputs.push_back(train.model.outputs[output]);
    gains.emplace_back(equations.fit(tests.folds.size()));
    if (static_fit) {
      gains.back().head(row.size()) -= row;
      bank.changes_coefficients = true;
    }
    bank.left_out[outputs.back()] = of_output.gain;
  }
  if (outputs.empty()) return std::nullopt;
  Eigen::MatrixXd all(std::ssize(gains.front()), std::ssize(gains));
  for (std::size_t i = 0; i < gains.size(); ++i) all.col(static_cast<Eigen::Index>(i)) = gains[i];
  bank.term = identification::bank_term(columns, outputs, all);
  bank.hinges = identification::hinge_terms(columns, outputs, all);
  return bank;
}

}  // namespace thermocomp::diagnosis
