/// The report of a diagnosis as one self-contained HTML page: its data and pictures.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/answer/findings.hpp"

namespace thermocomp::diagnosis {

enum class Phase { change, heating, cooling, standstill, steady };
inline constexpr std::array phase_names{"speed change", "heating", "cooling", "standstill",
                                        "steady"};

struct ReportRun {
  std::string name;
  bool test{false};
  Column time_s{};
  std::vector<Phase> phases{};
  std::vector<Column>
      measured_um{};  ///< one per output, relative to the run's first row; NaN: missing
  std::vector<Column> before_um{};  ///< residual of the model
  std::vector<Column> after_um{};   ///< of the extended model
  std::vector<Column> signals{};
  std::vector<Column> inputs_K{};
  bool of_the_model{false};  ///< in the model's [made_from]
};

struct ReportData {
  std::vector<std::string> outputs;
  std::vector<std::string> signals;
  std::vector<std::string> inputs;  ///< of the model, and other temperatures of findings
  std::vector<ReportRun> runs;
};

/// Adds the runs.
/// @param before, after  residuals of the model and of the extended model, per output
void add_runs(ReportData& report, const Diagnosis& diagnosis, const MeasuredData& data,
              const std::vector<Residuals>& before, const std::vector<Residuals>& after, bool test);

/// The whole page.
[[nodiscard]] std::string report_html(const Diagnosis& diagnosis, const ReportData& report);

}  // namespace thermocomp::diagnosis
