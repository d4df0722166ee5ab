#include "modelling/identification/families/families.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "modelling/identification/equation/heat_fit.hpp"
#include "modelling/identification/families/bank_fit.hpp"
#include "modelling/identification/printed.hpp"

namespace thermocomp::identification {
namespace {

constexpr std::size_t kept_for_lags = 200;
constexpr Eigen::Index stretches_of_only_run = 6;
/// With fewer runs, the error on a run left out is mostly due to states that the others lack, and
/// hardly depends on the family.
constexpr std::size_t runs_that_choose = 4;
constexpr std::size_t stretches_that_choose = 8;
constexpr double correlation_of_one = 0.98;
/// The bank is kept while its error exceeds that of few sensors by at most this share: on later
/// rows it had the smaller error on 68 of 86 splits of measured machines, and on 8 of the 12 in
/// which few sensors had the smaller error on the stretches.
constexpr double more_than_few = 0.1;
/// Least reduction of the bank's left-out error, in geometric mean and in total RMS of every
/// judgement, by gains of the gradual signals. Set on the single discharges of two battery cells;
/// with it, none of 204 irrelevant counters added to 51 splits of other machines got a gain.
constexpr double less_with_gradual = 0.1;
/// Lower limit of a fold's RMS as a share of that without a model on all folds; below it, families
/// are equal.
constexpr double least_share = 0.01;
constexpr double penalty_of_few = 0.003;  ///< ridge penalty, see FitOptions

std::size_t index_of_family(Family family) {
  return static_cast<std::size_t>(family);
}

Eigen::Index rows_of(const MeasuredTests& tests) {
  Eigen::Index rows = 0;
  for (const Fold& fold : tests.folds) rows += fold.end - fold.begin;
  return rows;
}

/// All folds but one, for a family that is judged on that one.
MeasuredTests without(const MeasuredTests& tests, std::size_t fold) {
  MeasuredTests rest = tests;
  const Fold out = tests.folds[fold];
  rest.folds.erase(rest.folds.begin() + static_cast<std::ptrdiff_t>(fold));
  std::erase_if(rest.hot.rows, [&](Eigen::Index row) { return row >= out.begin && row < out.end; });
  if (rest.folds.size() > 1) return rest;
  // Choosing on a single fold would use the rows of the fit: its stretches instead.
  const Fold only = rest.folds.front();
  rest.folds.clear();
  const Eigen::Index rows = only.end - only.begin;
  for (Eigen::Index i = 0; i < stretches_of_only_run; ++i)
    rest.folds.push_back({only.run, only.begin + rows * i / stretches_of_only_run,
                          only.begin + rows * (i + 1) / stretches_of_only_run});
  return rest;
}

/// Splits few runs into stretches that are left out in turn.
MeasuredTests in_stretches(const MeasuredTests& tests) {
  MeasuredTests cut = tests;
  cut.folds.clear();
  const auto of_a_run = static_cast<Eigen::Index>((stretches_that_choose + tests.folds.size() - 1) /
                                                  tests.folds.size());
  for (const Fold& fold : tests.folds) {
    const Eigen::Index rows = fold.end - fold.begin;
    for (Eigen::Index i = 0; i < of_a_run; ++i)
      if (rows * (i + 1) / of_a_run > rows * i / of_a_run)
        cut.folds.push_back(
            {fold.run, fold.begin + rows * i / of_a_run, fold.begin + rows * (i + 1) / of_a_run});
  }
  return cut;
}

FitOptions options_of(Family family, const MeasuredTests& tests, FitOptions options) {
  options.lags = family != Family::static_few;
  options.relaxes = true;
  options.kept_for_lags = kept_for_lags;
  options.penalty = penalty_of_few;
  // All combinations of five of so many places take more than a minute.
  if (tests.places.size() > 24) options.terms_max = std::min<std::size_t>(options.terms_max, 4);
  if (tests.places.size() > 40) options.terms_max = std::min<std::size_t>(options.terms_max, 3);
  return options;
}

HeatEquation few_of(Family family, const MeasuredTests& tests, const FitOptions& options) {
  const Equation equation = chosen_equation(tests, options_of(family, tests, options));
  if (family == Family::physical) return add_heats(tests, equation);
  return {equation.columns, {}, equation.coefficients};
}

Eigen::MatrixXd predicted(const TestRun& run, const HeatEquation& equation) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(run.time_s.size(), equation.coefficients.cols());
  Eigen::Index row = 0;
  for (const FitColumn& column : equation.columns)
    sum += column_of(run, column) * equation.coefficients.row(row++);
  for (const HeatColumn& heat : equation.heats)
    sum += column_of(run, heat) * equation.coefficients.row(row++);
  return sum;
}

void judge(const MeasuredTests& tests, FamilyResult& result) {
  const std::size_t outputs = tests.outputs.size();
  Eigen::VectorXd whole = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(outputs));
  Eigen::VectorXd left = whole;
  result.fold_um.assign(outputs, {});
  std::vector<Eigen::VectorXd> of_folds;
  Eigen::Index row = 0;
  for (const Fold& fold : tests.folds) {
    const Eigen::Index rows = fold.end - fold.begin;
    const auto y = tests.runs[fold.run].outputs_um.middleRows(fold.begin, rows);
    const Eigen::VectorXd squares =
        (y - result.left_out_um.middleRows(row, rows)).colwise().squaredNorm().transpose();
    whole += y.colwise().squaredNorm().transpose();
    left += squares;
    of_folds.push_back(squares);
    for (std::size_t o = 0; o < outputs; ++o)
      result.fold_um[o].push_back(
          std::sqrt(squares[static_cast<Eigen::Index>(o)] / static_cast<double>(rows)));
    row += rows;
  }
  for (std::size_t o = 0; o < outputs; ++o)
    result.left_out_rms_um.push_back(
        std::sqrt(left[static_cast<Eigen::Index>(o)] / static_cast<double>(row)));
  for (const Eigen::VectorXd& squares : of_folds)
    result.scores.push_back((squares.array() / whole.array().max(1e-30)).sum() /
                            static_cast<double>(outputs));
  result.answers = true;
}

bool any_start_differs(const MeasuredTests& tests) {
  for (std::size_t place = 0; place < tests.places.size(); ++place)
    if (starts_differ(tests, place)) return true;
  return false;
}

FamilyResult judge_few(Family family, const MeasuredTests& tests, const FitOptions& options,
                       const std::function<void()>& done) {
  FamilyResult result;
  result.family = family;
  if (family == Family::physical && tests.signals.empty() && !any_start_differs(tests)) {
    result.why_not = "no operating signal varies, and no three runs start 1 K apart";
    return result;
  }
  try {
    result.left_out_um =
        Eigen::MatrixXd::Zero(rows_of(tests), static_cast<Eigen::Index>(tests.outputs.size()));
    Eigen::Index row = 0;
    for (std::size_t f = 0; f < tests.folds.size(); ++f) {
      const HeatEquation equation = few_of(family, without(tests, f), options);
      const Fold& fold = tests.folds[f];
      const Eigen::Index rows = fold.end - fold.begin;
      result.left_out_um.middleRows(row, rows) =
          predicted(tests.runs[fold.run], equation).middleRows(fold.begin, rows);
      row += rows;
      done();
    }
    judge(tests, result);
  } catch (const std::runtime_error& error) {
    result.why_not = error.what();
  }
  return result;
}

FamilyResult judge_bank(const MeasuredTests& tests, const BankEquations& bank,
                        const std::function<void()>& done) {
  FamilyResult result;
  result.family = Family::lag_bank;
  result.left_out_um =
      Eigen::MatrixXd::Zero(rows_of(tests), static_cast<Eigen::Index>(tests.outputs.size()));
  Eigen::Index row = 0;
  for (std::size_t f = 0; f < tests.folds.size(); ++f) {
    const Fold& fold = tests.folds[f];
    const Eigen::Index rows = fold.end - fold.begin;
    result.left_out_um.middleRows(row, rows) =
        bank.rows()[fold.run].middleRows(fold.begin, rows) * bank.fit(f);
    row += rows;
    done();
  }
  judge(tests, result);
  return result;
}

/// Lags and heats of few sensors only on request: their gains cancel each other, and on no measured
/// machine were they clearly better than the bank (docs/measurements.md).
bool offered(Family family, std::optional<Family> forced) {
  return (family != Family::lagged_few && family != Family::physical) || family == forced;
}

/// Judges every family on the left-out folds; order of all_families.
std::vector<FamilyResult> judged(const MeasuredTests& tests, const FitOptions& options,
                                 std::optional<Family> forced, const BankColumns& columns,
                                 const std::function<void()>& done) {
  std::vector<FamilyResult> results(1);
  results[0].left_out_um =
      Eigen::MatrixXd::Zero(rows_of(tests), static_cast<Eigen::Index>(tests.outputs.size()));
  judge(tests, results[0]);
  for (const Family family : {Family::static_few, Family::lagged_few, Family::physical}) {
    if (offered(family, forced)) {
      results.push_back(judge_few(family, tests, options, done));
      continue;
    }
    FamilyResult& result = results.emplace_back();
    result.family = family;
    result.why_not = "only on request: --family " + std::string(to_string(family));
  }
  results.push_back(judge_bank(tests, BankEquations(tests, columns), done));
  return results;
}

using Judgement = std::pair<MeasuredTests, std::vector<FamilyResult>>;
using Judgements = std::vector<Judgement>;
using Outputs = std::vector<std::size_t>;

Outputs all_outputs(const Judgement& judgement) {
  Outputs outputs(judgement.first.outputs.size());
  std::iota(outputs.begin(), outputs.end(), std::size_t{0});
  return outputs;
}

/// Geometric mean RMS of a family over outputs and folds: outputs that move little have the same
/// weight, and one stretch does not decide.
double left_by(const Judgement& judgement, std::size_t family, const Outputs& outputs) {
  const auto& [tests, results] = judgement;
  double sum = 0.0;
  for (const std::size_t o : outputs) {
    const double least_um = std::max(least_share * results[0].left_out_rms_um[o], 1e-30);
    for (const double rms_um : results[family].fold_um[o])
      sum += std::log(std::max(rms_um, least_um));
  }
  return std::exp(sum / static_cast<double>(outputs.size() * tests.folds.size()));
}

/// Geometric mean over judgements.
double left_by(const Judgements& judgements, std::size_t family, const Outputs& outputs) {
  double product = 1.0;
  for (const Judgement& each : judgements) product *= left_by(each, family, outputs);
  return std::pow(product, 1.0 / static_cast<double>(judgements.size()));
}

/// Sum over outputs of the family's squares relative to those of no model.
double total_squares(const Judgement& judgement, std::size_t family, const Outputs& outputs) {
  const std::vector<FamilyResult>& results = judgement.second;
  double sum = 0.0;
  for (const std::size_t o : outputs)
    sum += std::pow(
        results[family].left_out_rms_um[o] / std::max(results[0].left_out_rms_um[o], 1e-30), 2.0);
  return sum;
}

bool answers(const Judgements& judgements, std::size_t family) {
  return std::all_of(judgements.begin(), judgements.end(),
                     [&](const Judgement& each) { return each.second[family].answers; });
}

/// Judgement in which the family's total error is not below that of no model; empty: none.
std::string worse_than_none(const Judgements& judgements, std::size_t family,
                            const Outputs& outputs) {
  for (const Judgement& each : judgements) {
    const MeasuredTests& tests = each.first;
    if (!(total_squares(each, family, outputs) < total_squares(each, 0, outputs)))
      return tests.runs.size() > 1 && tests.folds.size() == tests.runs.size() ? "whole runs"
             : tests.folds.size() == 2                                        ? "halves"
                                                                              : "stretches";
  }
  return "";
}

/// The family leaves a tenth less of the output than no model, and nowhere more.
bool predicts(const Judgements& judgements, std::size_t family, std::size_t output) {
  return answers(judgements, family) && worse_than_none(judgements, family, {output}).empty() &&
         left_by(judgements, family, {output}) <
             (1.0 - less_than_none) * left_by(judgements, 0, {output});
}

/// The outputs that a family predicts; all, if there is none.
Outputs predictable(const Judgements& judgements) {
  const Outputs all = all_outputs(judgements.front());
  Outputs outputs;
  for (const std::size_t o : all)
    for (std::size_t family = 1; family < judgements.front().second.size(); ++family)
      if (predicts(judgements, family, o)) {
        outputs.push_back(o);
        break;
      }
  return outputs.empty() ? all : outputs;
}

/// Gives the gradual signals gains in the bank if every judgement is better with them; no hinges,
/// which would follow any course of time.
void add_gradual(Judgements& judgements, const BankColumns& columns,
                 const std::function<void()>& done) {
  const std::vector<std::string> gradual = judgements[0].first.gradual;
  const Outputs outputs = all_outputs(judgements[0]);
  Judgements with = judgements;
  for (auto& [tests, results] : with) {
    std::erase_if(tests.unmoved, [&](const std::string& name) {
      return std::find(gradual.begin(), gradual.end(), name) != gradual.end();
    });
    results.back() = judge_bank(tests, BankEquations(tests, columns), done);
  }
  const std::size_t bank = index_of_family(Family::lag_bank);
  const double share = 1.0 - less_with_gradual;
  for (std::size_t i = 0; i < with.size(); ++i)
    if (!(left_by(with[i], bank, outputs) < share * left_by(judgements[i], bank, outputs)) ||
        !(total_squares(with[i], bank, outputs) <
          share * share * total_squares(judgements[i], bank, outputs)))
      return;
  judgements = std::move(with);
}

/// Chooses no model unless a family leaves a tenth less; the bank unless its error exceeds that of
/// few sensors by a tenth. Families worse than no model in any judgement are excluded. Outputs that
/// no family predicts do not count.
void choose(const Judgements& judgements, FamiliesFit& fit) {
  const Outputs outputs = predictable(judgements);
  std::size_t chosen = 0;
  std::vector<double> left_um{left_by(judgements, 0, outputs)};
  std::string worse;
  for (std::size_t i = 1; i < fit.results.size(); ++i) {
    left_um.push_back(std::numeric_limits<double>::infinity());
    if (!answers(judgements, i)) continue;
    left_um[i] = left_by(judgements, i, outputs);
    const std::string where = worse_than_none(judgements, i, outputs);
    if (!where.empty()) {
      worse.append("; ").append(to_string(all_families[i])).append(" is worse than no model on ");
      worse += where;
    } else if (left_um[i] <
               (chosen == 0 ? 1.0 - less_than_none : 1.0 + more_than_few) * left_um[chosen]) {
      chosen = i;
    }
  }
  fit.chosen = all_families[chosen];
  fit.chosen_because = printed(
                           "leaves %.3g um of left-out data (geometric mean), no "
                           "model %.3g um",
                           left_um[chosen], left_um[0]) +
                       worse;
  if (chosen == 0) return;
  for (const std::size_t o : all_outputs(judgements.front()))
    if (!predicts(judgements, chosen, o)) fit.without_gains.push_back(o);
  if (fit.without_gains.size() < fit.results.front().left_out_rms_um.size()) return;
  fit.chosen = Family::none;
  fit.chosen_because += ", but is no better than no model for any output alone";
  fit.without_gains.clear();
}

/// Sets every coefficient of the output to 0.
void clear_gains(ThermalModel& model, std::size_t output) {
  const std::string& name = model.outputs[output];
  std::fill(model.matrix_um_per_K[output].begin(), model.matrix_um_per_K[output].end(), 0.0);
  for (TermSpec& term : model.terms) {
    if (const auto bank = term.bank.gain_um_per_unit.find(name);
        bank != term.bank.gain_um_per_unit.end())
      for (std::vector<double>& gains : bank->second) std::fill(gains.begin(), gains.end(), 0.0);
    for (auto& [key, by_output] : term.per_output) by_output[name] = 0.0;
  }
}

/// The chosen family's result, and that of no model for the outputs without gains.
FamilyResult result_of_model(const std::vector<FamilyResult>& results, const FamiliesFit& fit) {
  const FamilyResult& none = results.front();
  FamilyResult result = results[index_of_family(fit.chosen)];
  for (const std::size_t o : fit.without_gains) {
    const auto column = static_cast<Eigen::Index>(o);
    result.left_out_um.col(column) = none.left_out_um.col(column);
    result.left_out_rms_um[o] = none.left_out_rms_um[o];
    result.fold_um[o] = none.fold_um[o];
  }
  return result;
}

/// Groups of places, and of signals, whose courses are too correlated to be separated.
std::vector<std::vector<std::string>> moved_together(const MeasuredTests& tests) {
  std::vector<std::string> names = tests.places;
  std::vector<Eigen::Index> moved;
  for (std::size_t i = 0; i < tests.signals.size(); ++i) {
    if (!tests.moved(tests.signals[i])) continue;
    names.push_back(tests.signals[i]);
    moved.push_back(static_cast<Eigen::Index>(i));
  }
  const auto count = std::ssize(names);
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(count, count);
  for (const TestRun& run : tests.runs) {
    const Eigen::Index rows = run.places_K.rows() - run.begin;
    Eigen::MatrixXd courses(rows, count);
    courses << run.places_K.bottomRows(rows), run.signals(Eigen::all, moved).bottomRows(rows);
    courses.rowwise() -= courses.colwise().mean().eval();
    squares.noalias() += courses.transpose() * courses;
  }
  std::vector<std::vector<std::string>> groups;
  std::vector<bool> taken(names.size(), false);
  for (Eigen::Index a = 0; a < count; ++a) {
    if (taken[static_cast<std::size_t>(a)]) continue;
    std::vector<std::string> group{names[static_cast<std::size_t>(a)]};
    for (Eigen::Index b = a + 1; b < count; ++b) {
      const double correlation = squares(a, b) / std::sqrt(squares(a, a) * squares(b, b));
      if (taken[static_cast<std::size_t>(b)] || !(std::abs(correlation) > correlation_of_one))
        continue;
      taken[static_cast<std::size_t>(b)] = true;
      group.push_back(names[static_cast<std::size_t>(b)]);
    }
    if (group.size() > 1) groups.push_back(std::move(group));
  }
  return groups;
}

ThermalModel no_model(const MeasuredTests& tests) {
  ThermalModel model;
  model.inputs = {tests.places.front()};
  model.outputs = tests.outputs;
  model.matrix_um_per_K.assign(tests.outputs.size(), {0.0});
  return model;
}

ThermalModel few_model(const MeasuredTests& tests, const HeatEquation& equation) {
  Fit fit;
  fit.columns = equation.columns;
  for (const FitColumn& column : equation.columns)
    if (!(column.tau_s > 0)) fit.places.push_back(column.place);
  for (Eigen::Index o = 0; o < equation.coefficients.cols(); ++o)
    fit.outputs.emplace_back().coefficients = equation.coefficients.col(o);
  ThermalModel model = model_of(tests, fit);
  auto row = static_cast<Eigen::Index>(equation.columns.size());
  for (const HeatColumn& heat : equation.heats) {
    TermSpec term;
    term.kind = heat.factor ? "start_dependence" : "missing_heat_source";
    term.subject = heat.place ? tests.places[*heat.place] : tests.signals[heat.signal];
    term.shared["tau_s"] = heat.tau_s;
    if (heat.factor) {
      term.subject += "|" + tests.places[heat.factor->place];
      term.shared["at_start"] = heat.factor->at_start ? 1.0 : 0.0;
      term.shared["place0_degC"] = heat.factor->place0_degC;
    } else {
      term.shared["power"] = heat.power;
    }
    for (std::size_t o = 0; o < tests.outputs.size(); ++o)
      term.per_output[heat.factor ? "gain_um_per_unit_K" : "gain_um_per_unit"][tests.outputs[o]] =
          equation.coefficients(row, static_cast<Eigen::Index>(o));
    model.terms.push_back(std::move(term));
    ++row;
  }
  return model;
}

}  // namespace

std::string_view to_string(Family family) noexcept {
  switch (family) {
    case Family::none:
      return "none";
    case Family::static_few:
      return "static_few";
    case Family::lagged_few:
      return "lagged_few";
    case Family::physical:
      return "physical";
    case Family::lag_bank:
      return "lag_bank";
  }
  return "unknown";
}

std::optional<Family> family_of(std::string_view name) {
  for (const Family family : all_families)
    if (to_string(family) == name) return family;
  return std::nullopt;
}

MeasuredTests in_halves(const MeasuredTests& tests) {
  MeasuredTests halves = tests;
  const Fold& first = tests.folds[tests.folds.size() / 2];
  const Eigen::Index middle = first.begin;
  halves.folds = {{0, tests.folds.front().begin, middle}, {0, middle, tests.folds.back().end}};
  return halves;
}

FamiliesFit fit_families(const MeasuredTests& given, const FitOptions& options,
                         std::optional<Family> forced,
                         const std::function<void(double)>& progress) {
  FamiliesFit fit;
  const bool one_run = given.runs.size() < 2;
  const bool few_runs = !one_run && given.runs.size() < runs_that_choose;
  const MeasuredTests further = few_runs                            ? in_stretches(given)
                                : one_run && given.folds.size() > 1 ? in_halves(given)
                                                                    : MeasuredTests{};
  const double steps = (given.gradual.empty() ? 3.0 : 4.0) *
                       static_cast<double>(given.folds.size() + further.folds.size());
  double step = 0.0;
  const auto done = [&] { progress(std::min(1.0, ++step / steps)); };
  BankColumns columns = bank_columns(given);
  add_hinges(given, columns);
  Judgements judgements;
  for (const MeasuredTests* each : {&given, &further})
    if (!each->folds.empty())
      judgements.emplace_back(*each, judged(*each, options, forced, columns, done));
  if (!given.gradual.empty()) add_gradual(judgements, columns, done);
  const MeasuredTests& tests = judgements[0].first;
  fit.results = judgements[0].second;
  fit.unmoved = tests.unmoved;
  choose(judgements, fit);
  if (forced) {
    fit.chosen = *forced;
    fit.chosen_because = as_requested;
    fit.without_gains.clear();
  }
  fit.together = moved_together(tests);
  const FamilyResult& of_family = fit.results[index_of_family(fit.chosen)];
  if (!of_family.answers)
    throw std::runtime_error(std::string(to_string(fit.chosen)) + ": " + of_family.why_not);
  fit.of_model = result_of_model(fit.results, fit);
  if (one_run && judgements.size() > 1)
    fit.other_half_um = result_of_model(judgements[1].second, fit).left_out_rms_um;
  if (fit.chosen == Family::none)
    fit.model = no_model(tests);
  else if (fit.chosen == Family::lag_bank)
    fit.model = bank_model(tests.places, tests.outputs, columns,
                           BankEquations(tests, columns).fit(tests.folds.size()));
  else if (fit.chosen == Family::physical)
    fit.model = few_model(tests, few_of(fit.chosen, tests, options));
  else
    fit.model = model_of(
        tests, fit.few.emplace(fit_equation(tests, options_of(fit.chosen, tests, options))));
  for (const std::size_t o : fit.without_gains) {
    clear_gains(fit.model, o);
    if (fit.few) fit.few->outputs[o].coefficients.setZero();
  }
  fit.model.made_from = made_from_tests(tests, fit);
  add_warnings(tests, fit);
  return fit;
}

}  // namespace thermocomp::identification
