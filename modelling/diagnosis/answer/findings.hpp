/// Turns findings of the search into names, parameters with intervals and terms of the model file,
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

/// Share by which the RMS of left-out rows falls, of the output that gains most.
[[nodiscard]] double share_of_remainder(const Explanation& explanation);

/// Everything but the gain on test runs.
/// @param data  whose outputs and runs the finding is of
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

/// A model with the findings that no term can carry.
struct Extended {
  ThermalModel model;
  std::vector<Correction> corrections;
};

/// Of each run, over its selected rows; NaN where nothing was measured.
using Residuals = std::vector<Column>;

/// measured - model of every output over the selected rows of every run, both from the run's first
/// row on: the data's own model, or another.
[[nodiscard]] std::vector<Residuals> residuals(const MeasuredData& data);
[[nodiscard]] std::vector<Residuals> residuals(const Extended& extended, const MeasuredData& data);
[[nodiscard]] double root_mean_square(const Residuals& residuals);
[[nodiscard]] double peak(const Residuals& residuals);
/// Figures of the model's remainder in training and test runs, and of the extended model's in test
/// runs.
[[nodiscard]] OutputFigures output_figures(const Residuals& train, const Residuals& test,
                                           const Residuals& extended_test,
                                           double unexplained_fraction);
/// The interval comes from resampled blocks of rows.
[[nodiscard]] TestGain test_gain(const Residuals& before, const Residuals& after);
/// Whether the finding improves no output of the test runs; the extended model then omits it.
[[nodiscard]] bool fails_on_test_runs(const NamedFinding& finding);

/// A bank for each output whose left-out rows it predicts better: each of eight blocks of the
/// training rows is left out, and what is left of them must fall by a tenth (RMS), about the
/// run's mean too, and by more than the standard error over the blocks. Everything counts from the
/// run's first row, as it will in use: with a free offset a run twice as many outputs get a bank,
/// and some are worse for it. Columns, penalties and gains: identification::BankEquations.
///
/// Coefficients that were fitted to these very rows say nothing of what they leave of others: such
/// an output is fitted anew without the blocks, from the inputs as they are and with the bank, and
/// compared so; the bank then holds what the coefficients change by, too.
/// @param left         by the model with the findings, over the training runs, order of the outputs
/// @param fitted       of each output, whether its coefficients were fitted to these rows
/// @param predictable  receives of each output the share of the variance of its left-out rows that
///                     the bank predicts, whether it gets one or not
/// @return nullopt: no output gains
[[nodiscard]] std::optional<RemainderBank> remainder_bank(const MeasuredData& train,
                                                          const std::vector<Residuals>& left,
                                                          const std::vector<bool>& fitted,
                                                          std::vector<double>& predictable);

}  // namespace thermocomp::diagnosis
