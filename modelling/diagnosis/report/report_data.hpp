/// The material of the report: residuals beside the operating signals, by phase.
#pragma once

#include <string>
#include <vector>

#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/answer/gain_on_test.hpp"

namespace thermocomp::diagnosis {

enum class Phase { change, heating, cooling, standstill, steady };
inline constexpr std::size_t phase_count = 5;
[[nodiscard]] const char* phase_name(Phase phase);

/// The phase of each selected row: `change` in the ten minutes after a change of an operating
/// signal, otherwise by the slope of the inputs' mean rise and by whether any signal is on.
[[nodiscard]] std::vector<Phase> phases_of(const MeasuredRun& run, const MeasuredData& data);

/// How white a residual is.
struct Whiteness {
  double noise_um{0.0};            ///< of a single value, from second differences
  double noise_share{0.0};         ///< of the variance
  double correlation_time_s{0.0};  ///< until the autocorrelation falls below 1/e
};
[[nodiscard]] Whiteness whiteness_of(const Column& time_s, const Column& residual);

struct ReportRun {
  std::string name;
  bool test{false};
  Column time_s{};
  std::vector<Phase> phases{};
  std::vector<Column> measured_um{};  ///< one an output, from the run's first row; NaN: missing
  std::vector<Column> before_um{};    ///< residual of the model
  std::vector<Column> after_um{};     ///< of the extended model
  std::vector<Column> signals{};
  std::vector<Column> inputs_K{};
};

struct ReportData {
  std::vector<std::string> outputs;
  std::vector<std::string> signals;
  std::vector<std::string> inputs;  ///< of the model, and the other temperatures that are named
  std::vector<ReportRun> runs;
};

/// Adds the runs; `corrections` are what no term of the extended model carries.
void add_runs(ReportData& report, const Diagnosis& diagnosis, const ThermalModel& model,
              const Corrections& corrections, const MeasuredData& data, bool test);

}  // namespace thermocomp::diagnosis
