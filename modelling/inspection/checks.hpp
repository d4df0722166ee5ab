/// The checks that inspect() is made of. Each gives findings with a `score` in place of the
/// probability; inspect() says what it is worth.
#pragma once

#include <functional>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/inspection/finding.hpp"
#include "modelling/inspection/recording.hpp"

namespace thermocomp::inspection {

/// A candidate finding, with how far it stands out from what the same column does otherwise.
struct Suspicion {
  Finding finding;
  double score{0.0};
};
using Suspicions = std::vector<Suspicion>;

/// Rows, step, gaps; times that jump although nothing on the machine did (`gap`, `clock`).
[[nodiscard]] RunSampling sampling_of(const RunFile& run);
void check_clock(const RunFile& run, std::size_t index, const RunSampling& sampling,
                 Suspicions& found);
/// The longest stretch in which rows are there and a column has no value; `other`: the further
/// columns.
void check_empty(const RunFile& run, std::size_t index, Suspicions& found);

/// Values that leap away and come back (`spikes` of a reading, `outliers` of a displacement). What
/// leapt is replaced in `run` by the median of its neighbours.
void check_spikes(RunFile& run, std::size_t index, Suspicions& found);
/// Readings that do not move while others do, that move in coarse steps, or that are another's.
void check_values(const std::vector<RunFile>& runs, Suspicions& found);

/// Each reading against its expectation from the others: steps, creep, loosening of temperatures;
/// steps of displacements. What is found is taken out of `recording`, and what is left is looked at
/// again, so that one sensor's fault is not blamed on its neighbours.
enum class Looked { all, displacements };
void check_changes(Recording recording, Looked looked, Suspicions& found,
                   const std::function<void(double)>& progress);
/// Pairs of readings that agree with the other runs only when they are exchanged.
void check_exchanged(const Recording& recording, Suspicions& found);

[[nodiscard]] std::vector<std::vector<std::string>> groups_of(const Recording& recording);
/// Fills `excited` and `experiments`.
void judge_excitation(const Recording& recording, Inspection& inspection);

/// Writes `text`.
void describe(Finding& finding, const std::vector<RunFile>& runs);

}  // namespace thermocomp::inspection
