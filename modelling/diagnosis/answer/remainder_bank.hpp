/// What is left after the findings and follows from what was recorded, though no cause of the
/// catalogue says how: carried by a bank of lags, and called that.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "modelling/diagnosis/answer/gain_on_test.hpp"

namespace thermocomp::diagnosis {

/// A bank for each output whose left-out rows it predicts better: each of eight blocks of the
/// training rows is left out, and what is left of them must fall by a tenth (RMS), about the
/// run's mean too, and by more than the standard error over the blocks. Everything counts from the
/// run's first row, as it will in use: with a free offset a run twice as many outputs get a bank,
/// and some are worse for it. Columns, penalties and gains: identification::BankEquations.
///
/// Coefficients that were fitted to these very rows say nothing of what they leave of others. Where
/// the matrix leaves no more of them than a fit of its inputs would, the output is fitted anew
/// without the blocks, from the inputs as they are and with the bank, and compared so; the bank
/// then holds what the coefficients change by, too.
/// @param left         by the model with the findings, over the training runs, order of the outputs
/// @param predictable  receives of each output the share of the variance of its left-out rows that
///                     the bank predicts, whether it gets one or not
/// @return nullopt: no output gains
[[nodiscard]] std::optional<RemainderBank> remainder_bank(const MeasuredData& train,
                                                          const std::vector<Residuals>& left,
                                                          std::vector<double>& predictable);

}  // namespace thermocomp::diagnosis
