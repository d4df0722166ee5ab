/// The diagnosis for the owner of the machine, one HTML page that needs nothing but itself:
/// residuals beside the operating signals by phase, words, pictures, the page.
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

/// The phase of each selected row: `change` in the ten minutes after a change of an operating
/// signal, otherwise by the slope of the inputs' mean rise and by whether any signal is on.
[[nodiscard]] std::vector<Phase> phases_of(const MeasuredRun& run, const MeasuredData& data);

/// Time until the autocorrelation of a residual falls below 1/e; 0 where it is white.
[[nodiscard]] double correlation_time_s(const Column& time_s, const Column& residual);

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
  bool of_the_model{false};  ///< the model names it as one that it was made from
};

struct ReportData {
  std::vector<std::string> outputs;
  std::vector<std::string> signals;
  std::vector<std::string> inputs;  ///< of the model, and the other temperatures that are named
  std::vector<ReportRun> runs;
};

/// Adds the runs.
/// @param before, after  what model and extended model leave of each output
void add_runs(ReportData& report, const Diagnosis& diagnosis, const MeasuredData& data,
              const std::vector<Residuals>& before, const std::vector<Residuals>& after, bool test);

/// Two digits, three where the first is a 1: "53", "0.0040", "1810".
[[nodiscard]] std::string figure(double value);
/// In s, min or h: "40 s", "53 min", "2.5 h".
[[nodiscard]] std::string duration(double seconds);
/// "z_um": "z"; "um" where a name has no more.
[[nodiscard]] std::string name_of_column(const std::string& column);
/// "time constant 53 min (51 to 55 min)"; of several outputs one after the other. What the values
/// are per is the subject's unit.
[[nodiscard]] std::string parameter_words(const std::string& cause, const Parameter& parameter,
                                          const std::string& subject);

/// What was found, in a few words, and where.
[[nodiscard]] std::string title_of(const std::string& cause, const std::string& subject);
/// One or two sentences with the finding's own figures.
[[nodiscard]] std::string sentence_of(const NamedFinding& finding);
[[nodiscard]] std::string what_to_do(const NamedFinding& finding);
/// The experiment that tells one explanation from another.
[[nodiscard]] std::string experiment_between(const Alternative& one, const Alternative& other);

/// The outputs of a run: measured, model and extended model, and what they leave; under them the
/// operating signals and the temperatures, over one axis of time.
/// @param units  one an output
[[nodiscard]] std::string course_picture(const ReportRun& run, const ReportData& report,
                                         const std::vector<std::string>& units);
/// What the model leaves over the temperatures that it goes with most.
[[nodiscard]] std::string scatter_pictures(const ReportRun& run, const ReportData& report,
                                           std::size_t output);
/// A bar an output: what the model's error is made of. Empty where that is not known.
[[nodiscard]] std::string headroom_picture(const Diagnosis& diagnosis);

/// What was found, what to do about it, how far the model could get, and the courses as pictures.
[[nodiscard]] std::string report_html(const Diagnosis& diagnosis, const ReportData& report);

}  // namespace thermocomp::diagnosis
