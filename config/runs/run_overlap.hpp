/// Runs that share rows.
#pragma once

#include <span>

#include "config/runs/run_file.hpp"

namespace thermocomp {

/// Whether both are of the same file and some row is selected in both. Files are the same when
/// their names lead to the same place.
[[nodiscard]] bool share_rows(const RunFile& a, const RunFile& b);

/// Runs that are to be left out in turn, or one to be judged by another, must not share rows.
/// @throws ConfigurationError naming the file
void refuse_overlap(std::span<const RunFile> runs);
/// Rows that a model is fitted to, and rows that it is judged on.
void refuse_overlap(std::span<const RunFile> train, std::span<const RunFile> test);

}  // namespace thermocomp
