#include "modelling/diagnosis/diagnosis.hpp"

#include <algorithm>
#include <cmath>

#include "modelling/diagnosis/answer/extended_model.hpp"
#include "modelling/diagnosis/answer/gain_on_test.hpp"
#include "modelling/diagnosis/answer/named_finding.hpp"
#include "modelling/diagnosis/answer/remainder_bank.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/report/report_data.hpp"
#include "modelling/diagnosis/search/search_beside_fit.hpp"

namespace thermocomp::diagnosis {
namespace {

/// What a finding that no term can carry corrects, if it acts in every run.
std::optional<Correction> correction_of(const NamedFinding& name, std::size_t output) {
  const Cause& cause = cause_named(name.cause);
  if (cause.correction == nullptr) return std::nullopt;
  Correction correction = cause.correction(name.parameters);
  correction.output = output;
  return correction;
}

/// A search in rows that the model was fitted to must leave less by this share than one that takes
/// the coefficients as right.
constexpr double fitted_share = 0.2;

/// Adds terms; what one kind does to one subject stays one term.
void add_terms(ThermalModel& model, const std::vector<TermSpec>& terms) {
  for (const TermSpec& term : terms) {
    const auto known = std::find_if(model.terms.begin(), model.terms.end(), [&](const auto& each) {
      return each.kind == "wrong_coefficient" && each.kind == term.kind &&
             each.subject == term.subject;
    });
    if (known == model.terms.end()) {
      model.terms.push_back(term);
      continue;
    }
    for (const auto& [name, values] : term.per_output)
      for (const auto& [output, value] : values) known->per_output[name][output] += value;
  }
}

/// The model with each finding added after those before it, and what each gains. One that the test
/// runs speak against is told, and the model goes without it.
/// @return what terms cannot carry, over the test runs
/// @param fitted  if given, the search that they come from: what their causes had put into the
///                coefficients is taken out of them
Corrections extend(Diagnosis& diagnosis, const std::vector<Finding>& findings,
                   const SearchBesideFit* fitted, const PlaceGroups& groups,
                   const MeasuredData& train, const MeasuredData& test) {
  Corrections corrections;
  for (const Finding& finding : findings) {
    NamedFinding name = named_finding(finding, train, parameters_of(finding, train));
    name.group = group_of(groups, name.subject, finding.explanation.other_subjects);
    const std::optional<TermSpec> term = term_of(finding, train);
    ThermalModel longer = diagnosis.extended;
    Corrections more = corrections;
    if (term) longer.terms.push_back(*term);
    // Without what acts in every run the coefficients would be right for nothing.
    const bool new_coefficients = fitted != nullptr && (term || name.run);
    if (new_coefficients) {
      add_terms(longer, fitted->corrections(finding));
      name.evidence +=
          "; the model was fitted to these rows, which hides most of a cause: its coefficients "
          "change with it, and the gain on test rows says more than the name";
    }
    for (const std::string& output : name.outputs) {
      const auto index = static_cast<std::size_t>(
          std::find(train.model.outputs.begin(), train.model.outputs.end(), output) -
          train.model.outputs.begin());
      const std::optional<Correction> correction = correction_of(name, index);
      if (correction) more.push_back(*correction);
      if (!term && !correction && !new_coefficients) continue;
      const Residuals before = residuals(diagnosis.extended, corrections, test, index);
      if (std::isfinite(root_mean_square(before)))
        name.test[output] = test_gain(before, residuals(longer, more, test, index));
    }
    if (!fails_on_test_runs(name)) {
      diagnosis.extended = std::move(longer);
      corrections = std::move(more);
    }
    diagnosis.findings.push_back(std::move(name));
  }
  return corrections;
}

/// What no term carries, over the training runs.
Corrections train_corrections(const Diagnosis& diagnosis, const MeasuredData& train) {
  Corrections corrections;
  for (const NamedFinding& finding : diagnosis.findings) {
    if (fails_on_test_runs(finding)) continue;
    for (std::size_t output = 0; output < train.model.outputs.size(); ++output)
      if (finding.outputs.front() == train.model.outputs[output])
        if (const auto correction = correction_of(finding, output))
          corrections.push_back(*correction);
  }
  return corrections;
}

/// The bank last.
void add_remainder(ThermalModel& model, const RemainderBank& remainder) {
  model.terms.insert(model.terms.end(), remainder.hinges.begin(), remainder.hinges.end());
  model.terms.push_back(remainder.term);
}

void forget_output(RemainderBank& remainder, const std::string& output) {
  remainder.term.bank.gain_um_per_unit.erase(output);
  for (TermSpec& hinge : remainder.hinges) hinge.per_output["gain_um_per_unit"].erase(output);
}

/// Adds a bank of lags for the outputs of which enough can be predicted without a name.
void carry_remainder(Diagnosis& diagnosis, const std::vector<Headroom>& headroom,
                     const Corrections& of_train, const Corrections& of_test,
                     const MeasuredData& train, const MeasuredData& test) {
  std::vector<Residuals> left;
  std::vector<double> predictable;
  for (std::size_t output = 0; output < headroom.size(); ++output) {
    left.push_back(residuals(diagnosis.extended, of_train, train, output));
    predictable.push_back(headroom[output].predictable);
  }
  diagnosis.remainder = remainder_bank(train, left, predictable);
  if (!diagnosis.remainder) return;
  ThermalModel longer = diagnosis.extended;
  add_remainder(longer, *diagnosis.remainder);
  for (const auto& [name, gain] : diagnosis.remainder->left_out) {
    const auto output = static_cast<std::size_t>(
        std::find(train.model.outputs.begin(), train.model.outputs.end(), name) -
        train.model.outputs.begin());
    const Residuals before = residuals(diagnosis.extended, of_test, test, output);
    if (std::isfinite(root_mean_square(before)))
      diagnosis.remainder->test[name] = test_gain(before, residuals(longer, of_test, test, output));
  }
  for (const auto& [name, gain] : diagnosis.remainder->test)
    if (!(gain.reduction > 0)) forget_output(*diagnosis.remainder, name);
  if (!diagnosis.remainder->term.bank.gain_um_per_unit.empty())
    add_remainder(diagnosis.extended, *diagnosis.remainder);
}

}  // namespace

Diagnosis diagnose(const ThermalModel& model, std::vector<RunFile> train,
                   const std::vector<std::string>& train_names, std::vector<RunFile> test,
                   const std::vector<std::string>& test_names, ReportData* report) {
  const SharedColumns columns = shared_columns(model, train, test);
  const MeasuredData train_data = training_data(model, train, train_names, columns);
  const MeasuredData test_data = measured_data(model, test, test_names, columns);
  train.clear();
  test.clear();
  Search search(train_data, Thresholds{});
  SearchResult result = search.run();
  SearchBesideFit beside_fit(train_data, Thresholds{});
  SearchResult of_fitted = beside_fit.run();
  const bool fitted =
      !of_fitted.findings.empty() &&
      (result.findings.empty() || log_left_by(of_fitted) < log_left_by(result) - fitted_share);

  Diagnosis diagnosis;
  diagnosis.extended = model;
  diagnosis.weighed = result.weighed;
  diagnosis.weighed.insert(diagnosis.weighed.end(), of_fitted.weighed.begin(),
                           of_fitted.weighed.end());
  if (fitted) result = std::move(of_fitted);
  const Corrections corrections = extend(diagnosis, result.findings, fitted ? &beside_fit : nullptr,
                                         search.groups(), train_data, test_data);
  diagnosis.verdict = verdict_of(result);
  diagnosis.families = result.families;
  const std::vector<Headroom> headroom = search.headrooms(result);
  carry_remainder(diagnosis, headroom, train_corrections(diagnosis, train_data), corrections,
                  train_data, test_data);
  for (std::size_t output = 0; output < model.outputs.size(); ++output) {
    const Residuals base = residuals(test_data, output);
    const Residuals extended = residuals(diagnosis.extended, corrections, test_data, output);
    diagnosis.outputs[model.outputs[output]] = {root_mean_square(residuals(train_data, output)),
                                                root_mean_square(base),
                                                peak(base),
                                                root_mean_square(extended),
                                                peak(extended),
                                                result.unexplained_share[output],
                                                headroom[output]};
  }
  if (report != nullptr) {
    add_runs(*report, diagnosis, model, train_corrections(diagnosis, train_data), train_data,
             false);
    add_runs(*report, diagnosis, model, corrections, test_data, true);
  }
  return diagnosis;
}

}  // namespace thermocomp::diagnosis
