/// The result of a diagnosis: findings with parameters and intervals, the extended model, and its
/// gain on runs that were not used. Its form in words, on the terminal and as JSON.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/thermal_model.hpp"
#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {

struct TestGain {
  double before_um{0.0};
  double after_um{0.0};
  double reduction{0.0};  ///< 1 - after / before
  Interval ci95;          ///< of the reduction, from resampled blocks
};

struct Alternative {
  std::string cause;
  std::string subject;
  double relative_support{0.0};
};

struct NamedFinding {
  std::string cause;
  std::string subject;
  std::vector<std::string> outputs;
  std::vector<Parameter> parameters;
  std::optional<std::string> run;  ///< run argument of a fault in one run only
  std::string evidence;
  std::vector<Alternative> alternatives;
  /// By output; empty if no test run has the output or no term represents the finding.
  std::map<std::string, TestGain> test;
  double probability{not_a_number};  ///< of this cause at any place of the group
  std::string family{};
  double family_probability{not_a_number};
  std::vector<std::string> group{};  ///< indistinguishable places, the subject's first
};

constexpr std::size_t candidates_reported = 3;

/// A hypothesis considered for the first finding, accepted or not.
struct Candidate {
  std::string cause;
  std::string subject;
  std::optional<std::string> run;
  double probability{0.0};
  double share_of_remainder{0.0};  ///< of the RMS of left-out training rows, of the best output
  /// On test rows, as the only extension; not used for ranking. Empty if no term represents it.
  std::map<std::string, TestGain> test{};
  std::string would_decide{};  ///< experiment that separates it from the likeliest rival
  /// Inputs of the probability (rank/search.hpp), by name.
  std::vector<std::pair<const char*, double>> figures{};
};

/// Cross-validated RMS of the training rows.
struct LeftOutRms {
  double before_um{0.0};
  double after_um{0.0};
};

/// Predictable remainder without a named cause, as a `lag_bank` term and hinges of signals.
struct RemainderBank {
  TermSpec term;
  std::vector<TermSpec> hinges;
  std::map<std::string, LeftOutRms> left_out;  ///< of the outputs that have a bank
  bool changes_coefficients{false};            ///< which were fitted to the training rows
  /// In addition to the findings; an output without a gain gets no bank.
  std::map<std::string, TestGain> test;
};

/// Shares of an output's residual variance; they add up to 1.
struct Headroom {
  double noise{0.0};         ///< of single values
  double named{0.0};         ///< explained by the findings
  double predictable{0.0};   ///< predictable from the recorded columns, without a named cause
  double not_recorded{1.0};  ///< not predictable from this recording
};

struct OutputFigures {
  double train_rms_um{0.0};
  double test_rms_um{0.0};
  double test_peak_um{0.0};
  double extended_test_rms_um{0.0};
  double extended_test_peak_um{0.0};
  double unexplained_fraction{0.0};
  std::optional<Headroom> headroom{};
};

/// Figures named `_um` are in `unit`.
struct Diagnosis {
  std::string unit{"um"};  ///< "K" where temperatures were compared
  std::string verdict;     ///< "effect", "none" or "unexplained"
  std::vector<NamedFinding> findings;
  std::map<std::string, OutputFigures> outputs;
  /// With every finding that a term represents and the test runs do not contradict.
  ThermalModel extended;
  std::optional<RemainderBank> remainder;  ///< its terms are the last of the extended model
  std::vector<Candidate> weighed;          ///< likeliest first
  /// Probability of each family, including `none`; empty if no hypotheses were weighed.
  std::map<std::string, double> families{};
  std::vector<std::string> warnings{};  ///< of the data, such as a displacement of reversed sign
};

/// True if the finding improves no output of the test runs; the extended model then omits it.
[[nodiscard]] bool fails_on_test_runs(const NamedFinding& finding);

/// True if there are findings, and the test runs contradict each.
[[nodiscard]] bool all_fail_on_test_runs(const Diagnosis& diagnosis);

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

void print(const Diagnosis& diagnosis);

/// The answer as JSON (indented, a newline at the end). Unknown numbers are null.
/// @param weighed  adds every candidate with the inputs of its probability
[[nodiscard]] std::string diagnosis_json(const Diagnosis& diagnosis, bool weighed = false);

}  // namespace thermocomp::diagnosis
