/// Converts findings of the search to names, parameters with intervals and terms of the model file,
/// measures their gain on the test runs, and fits a bank of lags to the predictable remainder.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/rank/search.hpp"

namespace thermocomp::diagnosis {

/// Reduction of the cross-validated RMS, of the output with the largest reduction.
[[nodiscard]] double share_of_remainder(const Explanation& explanation);

/// All members but the gain on test runs.
/// @param data  training data
[[nodiscard]] NamedFinding named_finding(const Finding& finding, const MeasuredData& data,
                                         std::vector<Parameter> parameters);

/// "effect", "none" or "unexplained".
[[nodiscard]] std::string verdict_of(const SearchResult& result);

[[nodiscard]] std::vector<Parameter> parameters_of(const Finding& finding,
                                                   const MeasuredData& data);
/// @return the terms that the daemon evaluates: the cause's own and, for a gain that it lacks, that
///         of the simpler cause. None for faults of one run, a shift in time and a disturbance
///         without an input
[[nodiscard]] std::vector<TermSpec> terms_of(const Finding& finding, const MeasuredData& data);

/// A model with corrections for findings that no term represents.
struct Extended {
  ThermalModel model;
  std::vector<Correction> corrections;
};

/// One column per run over its selected rows; NaN: not measured.
using Residuals = std::vector<Column>;

/// measured - model of every output and run over the selected rows, both relative to the run's
/// first row; of the data's own model or of another.
[[nodiscard]] std::vector<Residuals> residuals(const MeasuredData& data);
[[nodiscard]] std::vector<Residuals> residuals(const Extended& extended, const MeasuredData& data);
[[nodiscard]] double root_mean_square(const Residuals& residuals);
[[nodiscard]] double peak(const Residuals& residuals);
/// Figures of the model's remainder in training and test runs, and of the extended model's in test
/// runs.
[[nodiscard]] OutputFigures output_figures(const Residuals& train, const Residuals& test,
                                           const Residuals& extended_test,
                                           double unexplained_fraction);
/// The interval is bootstrapped over blocks of rows.
[[nodiscard]] TestGain test_gain(const Residuals& before, const Residuals& after);
/// A bank for each output that it predicts better in cross-validation over eight blocks of the
/// training rows: their residual RMS must fall by a tenth, about the run's mean too, and by more
/// than its standard error over the blocks. Displacements are relative to the run's first row, as
/// in use: with a free offset per run twice as many outputs get a bank, and some become worse.
/// Columns, penalties and gains: identification::BankEquations.
///
/// The residuals of coefficients that were fitted to the same rows are too small for this
/// comparison. Such an output is fitted without each block, by its inputs alone and by the bank;
/// the bank then includes the change of the coefficients.
/// @param left         residuals of the model with the findings over the training runs, per output
/// @param fitted       whether an output's coefficients were fitted to these rows, per output
/// @param predictable  receives per output the share of the variance that the bank predicts in
///                     cross-validation, with or without a bank in the result
/// @return nullopt: no output gets a bank
[[nodiscard]] std::optional<RemainderBank> remainder_bank(const MeasuredData& train,
                                                          const std::vector<Residuals>& left,
                                                          const std::vector<bool>& fitted,
                                                          std::vector<double>& predictable);

}  // namespace thermocomp::diagnosis
