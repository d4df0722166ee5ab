/// The recording itself, before any model: how it was sampled, what each reading says against its
/// neighbours and its own past, and what the recording can tell apart at all. docs/inspection.md
/// has the method and the figures behind each number.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/inspection/finding.hpp"

namespace thermocomp::inspection {

/// @param told_min  findings less probable than this are not listed
/// @param progress  called now and then with the share of the work that is done; may be empty
/// @pre given is not empty
[[nodiscard]] Inspection inspect(const std::vector<RunFile>& given, double told_min = 0.5,
                                 const std::function<void(double)>& progress = {});

/// The recording without what is wrong with it.
struct Cleaned {
  std::vector<RunFile> runs;
  std::vector<std::string> notes;  ///< what was changed and why, one line each
};

/// Takes findings from `probability_min` on: spikes and outliers become the median of their
/// neighbours; a step or creep is taken out by its size; what is stuck or loose is left out
/// (missing) from there on.
[[nodiscard]] Cleaned cleaned(const std::vector<RunFile>& runs, const Inspection& inspection,
                              double probability_min = 0.9);

/// Takes steps of these displacements out (a probe that was hit, another datum) and nothing else,
/// before something is fitted to them. Rows behind a run's selection are not looked at.
[[nodiscard]] Cleaned without_steps(const std::vector<RunFile>& runs,
                                    const std::vector<std::string>& outputs,
                                    double probability_min = 0.8);

/// "10 s", "3.71 h": the time between two rows.
[[nodiscard]] std::string step_text(double step_s);
/// Groups of two and more, names joined.
[[nodiscard]] std::vector<std::string> alike(const Inspection& inspection);
inline constexpr const char* none_alike = "No two places move alike.";
/// @param departure  a JSON value, or empty
[[nodiscard]] std::string inspection_json(const Inspection& inspection,
                                          const std::string& departure = "");
/// What is printed for a person.
[[nodiscard]] std::string inspection_text(const Inspection& inspection);
/// A page with pictures of what was found.
[[nodiscard]] std::string inspection_html(const std::vector<RunFile>& runs,
                                          const Inspection& inspection);

}  // namespace thermocomp::inspection
