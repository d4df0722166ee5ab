/// Inspection of recordings before any model: sampling, each reading compared with its neighbours
/// and its own past, and identifiable inputs. Method and constants: docs/inspection.md.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/inspection/finding.hpp"

namespace thermocomp::inspection {

/// @param probability_min  least probability of a listed finding
/// @param progress  called with the completed share of the work; may be empty
/// @pre given is not empty
[[nodiscard]] Inspection inspect(const std::vector<RunFile>& given, double probability_min = 0.5,
                                 const std::function<void(double)>& progress = {});

/// Recording with its faults removed.
struct Cleaned {
  std::vector<RunFile> runs;
  std::vector<std::string> notes;  ///< changes with reasons, one line each
};

/// Removes findings of at least `probability_min`: spikes and outliers become the median of their
/// neighbours; a step or drift is subtracted; stuck or loose readings become missing.
[[nodiscard]] Cleaned cleaned(const std::vector<RunFile>& runs, const Inspection& inspection,
                              double probability_min = 0.9);

/// Removes only steps of these displacements (a hit probe, another datum) within the selections.
[[nodiscard]] Cleaned without_steps(const std::vector<RunFile>& runs,
                                    const std::vector<std::string>& outputs,
                                    double probability_min = 0.8);

/// Time between two rows: "10 s", "3.71 h".
[[nodiscard]] std::string step_text(double step_s);
/// Groups of at least two places, names joined. `thermocomp group` uses another measure.
[[nodiscard]] std::vector<std::string> alike(const Inspection& inspection);
inline constexpr const char* none_alike = "No two places correlate above 0.98.";
/// @param departure  JSON value, or empty
[[nodiscard]] std::string inspection_json(const Inspection& inspection,
                                          const std::string& departure = "");
[[nodiscard]] std::string inspection_text(const Inspection& inspection);
/// HTML page with a picture of each finding.
[[nodiscard]] std::string inspection_html(const std::vector<RunFile>& runs,
                                          const Inspection& inspection);

}  // namespace thermocomp::inspection
