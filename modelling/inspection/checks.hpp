/// Checks of inspect(). They give a `score`, which inspect() converts to a probability.
#pragma once

#include <functional>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/inspection/finding.hpp"
#include "modelling/inspection/recording.hpp"

namespace thermocomp::inspection {

/// A candidate finding with its score relative to the column's usual level.
struct Suspicion {
  Finding finding;
  double score{0.0};
};
using Suspicions = std::vector<Suspicion>;

/// Rows, step, gaps; jumps of time without a change of the machine (`gap`, `clock`).
[[nodiscard]] RunSampling sampling_of(const RunFile& run);
void check_clock(const RunFile& run, std::size_t index, const RunSampling& sampling,
                 Suspicions& found);
/// Longest stretch of rows without a value of a column; `other`: the further columns.
void check_empty(const RunFile& run, std::size_t index, Suspicions& found);

/// Values that jump and return (`spikes` of a reading, `outliers` of a displacement). In `run` they
/// are replaced by the median of their neighbours.
void check_spikes(RunFile& run, std::size_t index, Suspicions& found);
/// Columns that are constant while temperatures move, that have coarse steps, or readings that
/// duplicate another.
void check_values(const std::vector<RunFile>& runs, Suspicions& found);

/// Columns in another unit: readings that begin like the others in kelvin, or multiplied;
/// displacements that agree with other runs only when multiplied.
void check_units(const std::vector<RunFile>& runs, const Recording& recording, Suspicions& found);
/// Stretches of several times the usual noise, which no other column and no signal explains.
void check_noises(const RunFile& run, std::size_t index, Suspicions& found);
/// A time in minutes: beside another run, or since most of three or more temperatures change faster
/// than those of a machine without heaters.
void check_time_unit(const std::vector<RunFile>& runs, Suspicions& found);

/// Compares each reading with its expectation from the others: steps, drift and loosening of
/// temperatures, steps of displacements. Findings are removed from `recording` and the rest is
/// checked again, so that a sensor's fault is not attributed to its neighbours.
enum class Looked { all, displacements };
void check_changes(Recording recording, Looked looked, Suspicions& found,
                   const std::function<void(double)>& progress);
/// Finds pairs of readings that agree with the other runs only if exchanged.
void check_exchanged(const Recording& recording, Suspicions& found);

[[nodiscard]] std::vector<std::vector<std::string>> groups_of(const Recording& recording);
/// Fills `excited` and `experiments`.
void judge_excitation(const Recording& recording, Inspection& inspection);

/// Fills `text`.
void describe(Finding& finding, const std::vector<RunFile>& runs);

}  // namespace thermocomp::inspection
