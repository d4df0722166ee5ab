/// The report of a diagnosis as one self-contained HTML page: its data, texts and pictures.
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

/// Phase of each selected row: `change` in the ten minutes after a change of an operating signal,
/// else by the slope of the inputs' mean rise and by whether any signal is on.
[[nodiscard]] std::vector<Phase> phases_of(const MeasuredRun& run, const MeasuredData& data);

/// Time after which the autocorrelation of a residual is below 1/e; 0 if it is white.
[[nodiscard]] double correlation_time_s(const Column& time_s, const Column& residual);

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

/// Two digits, three if the first is 1: "53", "0.0040", "1810".
[[nodiscard]] std::string figure(double value);
/// In s, min or h: "40 s", "53 min", "2.5 h".
[[nodiscard]] std::string duration(double seconds);
/// The name without its unit: "z_um" is "z".
[[nodiscard]] std::string name_of_column(const std::string& column);
/// "time constant 53 min (51 to 55 min)", for several outputs in sequence. The subject determines
/// the unit in a denominator.
[[nodiscard]] std::string parameter_words(const std::string& cause, const Parameter& parameter,
                                          const std::string& subject);

/// Short title with the subject.
[[nodiscard]] std::string title_of(const std::string& cause, const std::string& subject);
/// One or two sentences with the finding's figures.
[[nodiscard]] std::string sentence_of(const NamedFinding& finding);
[[nodiscard]] std::string what_to_do(const NamedFinding& finding);
/// The experiment that separates two explanations.
[[nodiscard]] std::string experiment_between(const Alternative& one, const Alternative& other);

/// Measured, predicted and residual displacement of a run's outputs, operating signals and
/// temperatures over one axis of time.
/// @param units  one per output
[[nodiscard]] std::string course_picture(const ReportRun& run, const ReportData& report,
                                         const std::vector<std::string>& units);
/// Residual against the temperatures with the largest correlation.
[[nodiscard]] std::string scatter_pictures(const ReportRun& run, const ReportData& report,
                                           std::size_t output);
/// One bar per output with the parts of the model's error; empty if they are unknown.
[[nodiscard]] std::string headroom_picture(const Diagnosis& diagnosis);

/// The whole page.
[[nodiscard]] std::string report_html(const Diagnosis& diagnosis, const ReportData& report);

}  // namespace thermocomp::diagnosis
