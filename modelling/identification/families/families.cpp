#include "modelling/identification/families/families.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "modelling/identification/equation/heat_fit.hpp"
#include "modelling/identification/families/bank_fit.hpp"
#include "modelling/identification/families/made_from_tests.hpp"

namespace thermocomp::identification {
namespace {

constexpr std::size_t kept_for_lags = 200;
constexpr Eigen::Index stretches_of_only_run = 6;
/// Fewer runs say too little of a family by each predicting another: what is left of them then is
/// mostly what a single run has not shown.
constexpr std::size_t runs_that_choose = 4;
constexpr std::size_t stretches_that_choose = 8;
/// Squares, over those of no model, that a family may leave of a whole run: beyond, it is out.
constexpr double runaway_score = 10.0;
/// Shares of the RMS left out that a family must leave less. By the first no model was made of
/// noise alone in 60 sets of four to seven simulated runs, three in 30 sets whose noise wanders for
/// hours.
constexpr double less_than_none = 0.1;
constexpr double less_than_simpler = 0.01;

std::size_t index_of_family(Family family) {
  return static_cast<std::size_t>(family);
}

Eigen::Index rows_of(const MeasuredTests& tests) {
  Eigen::Index rows = 0;
  for (const Fold& fold : tests.folds) rows += fold.end - fold.begin;
  return rows;
}

/// All but one fold, as what a family may see when that one judges it.
MeasuredTests without(const MeasuredTests& tests, std::size_t fold) {
  MeasuredTests rest = tests;
  const Fold out = tests.folds[fold];
  rest.folds.erase(rest.folds.begin() + static_cast<std::ptrdiff_t>(fold));
  std::erase_if(rest.hot.rows, [&](Eigen::Index row) { return row >= out.begin && row < out.end; });
  if (rest.folds.size() > 1) return rest;
  // A choice judged on one fold would be judged on what it was fitted to: stretches of it instead.
  const Fold only = rest.folds.front();
  rest.folds.clear();
  const Eigen::Index rows = only.end - only.begin;
  for (Eigen::Index i = 0; i < stretches_of_only_run; ++i)
    rest.folds.push_back({only.run, only.begin + rows * i / stretches_of_only_run,
                          only.begin + rows * (i + 1) / stretches_of_only_run});
  return rest;
}

/// Few runs, cut in stretches that are left out in turn.
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
  // Every combination of five of so many is more than a minute's work.
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

/// Fills in what follows from left_out_um.
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

FamilyResult judge_few(Family family, const MeasuredTests& tests, const FitOptions& options,
                       const std::function<void()>& done) {
  FamilyResult result;
  result.family = family;
  if (family == Family::physical && tests.signals.empty()) {
    result.why_not = "no operating signal varies";
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

/// Every family on the folds left out, order of all_families.
std::vector<FamilyResult> judged(const MeasuredTests& tests, const FitOptions& options,
                                 const BankEquations& bank, const std::function<void()>& done) {
  std::vector<FamilyResult> results(1);
  results[0].left_out_um =
      Eigen::MatrixXd::Zero(rows_of(tests), static_cast<Eigen::Index>(tests.outputs.size()));
  judge(tests, results[0]);
  for (const Family family : {Family::static_few, Family::lagged_few, Family::physical})
    results.push_back(judge_few(family, tests, options, done));
  results.push_back(judge_bank(tests, bank, done));
  return results;
}

double total(const FamilyResult& result) {
  return std::accumulate(result.scores.begin(), result.scores.end(), 0.0);
}

/// The family whose left-out RMS, as geometric mean of the outputs, is least: a factor counts alike
/// in an output that moves little. Of those that leave the same to 1 % the simplest, and no model
/// at all unless one leaves a tenth less. Nothing more is given away for simplicity: one standard
/// error of a handful of runs that differ much from each other is so large that on measured
/// machines no model at all was often within it (docs/measurements.md).
Family least_left(const std::vector<FamilyResult>& results) {
  const auto left = [](const FamilyResult& result) {
    double sum = 0.0;
    for (const double rms_um : result.left_out_rms_um) sum += std::log(std::max(rms_um, 1e-30));
    return sum / static_cast<double>(result.left_out_rms_um.size());
  };
  const FamilyResult* best = &results[0];
  for (const FamilyResult& result : results) {
    const double less = best == &results[0] ? less_than_none : less_than_simpler;
    if (result.answers && left(result) < left(*best) + std::log(1.0 - less)) best = &result;
  }
  return best->family;
}

/// @param by_runs  the same families on whole runs
std::vector<FamilyResult> without_runaways(std::vector<FamilyResult> results,
                                           const std::vector<FamilyResult>& by_runs) {
  for (std::size_t i = 0; i < results.size(); ++i)
    if (total(by_runs[i]) > runaway_score) results[i].answers = false;
  return results;
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
    term.kind = "missing_heat_source";
    term.subject = tests.signals[heat.signal];
    term.shared["tau_s"] = heat.tau_s;
    term.shared["power"] = heat.power;
    for (std::size_t o = 0; o < tests.outputs.size(); ++o)
      term.per_output["gain_um_per_unit"][tests.outputs[o]] =
          equation.coefficients(row, static_cast<Eigen::Index>(o));
    model.terms.push_back(std::move(term));
    ++row;
  }
  return model;
}

/// What acts at once is the matrix's, the rest one term.
ThermalModel bank_model(const MeasuredTests& tests, const BankColumns& columns,
                        Eigen::MatrixXd gains) {
  ThermalModel model;
  model.inputs = tests.places;
  model.outputs = tests.outputs;
  const auto places = static_cast<Eigen::Index>(tests.places.size());
  for (Eigen::Index o = 0; o < gains.cols(); ++o) {
    const auto at_once = gains.col(o).head(places);
    model.matrix_um_per_K.emplace_back(at_once.begin(), at_once.end());
  }
  gains.topRows(places).setZero();
  model.terms = hinge_terms(columns, tests.outputs, gains);
  model.terms.insert(model.terms.begin(), bank_term(columns, tests.outputs, gains));
  return model;
}

void add_warnings(const MeasuredTests& tests, FamiliesFit& fit) {
  if (tests.runs.size() < 2)
    fit.warnings.emplace_back(
        "judged within one run: not valid for other days. Next: a run of another day with another "
        "course of speeds or loads; fit both, and each judges the other");
  const FamilyResult& chosen = fit.chosen_result();
  const FamilyResult& none = fit.results[index_of_family(Family::none)];
  if (fit.chosen == Family::none) {
    fit.warnings.emplace_back("no model is better than none on what was left out: its matrix is 0");
    return;
  }
  for (std::size_t o = 0; o < tests.outputs.size(); ++o)
    for (std::size_t f = 0; f < tests.folds.size(); ++f)
      if (!(chosen.fold_um[o][f] < none.fold_um[o][f]))
        fit.warnings.push_back(tests.outputs[o] + ": on " + tests.fold_name(f) +
                               ", left out, it does worse than no model at all");
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

const FamilyResult& FamiliesFit::chosen_result() const {
  return results[index_of_family(chosen)];
}

FamiliesFit fit_families(const MeasuredTests& tests, const FitOptions& options,
                         std::optional<Family> forced,
                         const std::function<void(double)>& progress) {
  FamiliesFit fit;
  const bool few_runs = tests.runs.size() > 1 && tests.runs.size() < runs_that_choose;
  const MeasuredTests choosing = few_runs && !forced ? in_stretches(tests) : MeasuredTests{};
  const double steps = 4.0 * static_cast<double>(tests.folds.size() + choosing.folds.size());
  double step = 0.0;
  const auto done = [&] { progress(++step / steps); };
  BankColumns columns = bank_columns(tests);
  add_hinges(tests, columns);
  const BankEquations bank(tests, columns);
  fit.results = judged(tests, options, bank, done);
  if (forced)
    fit.chosen = *forced;
  else if (choosing.folds.empty())
    fit.chosen = least_left(fit.results);
  else
    fit.chosen = least_left(without_runaways(
        judged(choosing, options, BankEquations(choosing, columns), done), fit.results));
  fit.chosen_as_asked = forced.has_value();
  fit.chosen_by_stretches = !choosing.folds.empty();
  if (!fit.chosen_result().answers)
    throw std::runtime_error(std::string(to_string(fit.chosen)) + ": " +
                             fit.chosen_result().why_not);
  if (fit.chosen == Family::none)
    fit.model = no_model(tests);
  else if (fit.chosen == Family::lag_bank)
    fit.model = bank_model(tests, columns, bank.fit(tests.folds.size()));
  else
    fit.model = few_model(tests, few_of(fit.chosen, tests, options));
  if (fit.chosen == Family::static_few || fit.chosen == Family::lagged_few) {
    fit.few = fit_equation(tests, options_of(fit.chosen, tests, options));
    fit.model = model_of(tests, *fit.few);
  }
  fit.model.made_from = made_from_tests(tests, fit);
  add_warnings(tests, fit);
  return fit;
}

}  // namespace thermocomp::identification
