/// What a diagnosis answers: findings with parameters and intervals, the extended model, and what
/// knowing them gains on runs that were not used.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/thermal_model.hpp"
#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

namespace thermocomp::diagnosis {

struct TestGain {
  double before_um{0.0};
  double after_um{0.0};
  double reduction{0.0};  ///< 1 - after / before
  Interval ci95;          ///< of the reduction, by blocks drawn anew
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
  std::optional<std::string> run;  ///< of a fault of one run: its argument
  std::string evidence;
  std::vector<Alternative> alternatives;
  /// By output; empty where no test run has it or no prediction can carry it.
  std::map<std::string, TestGain> test;
  double probability{not_a_number};  ///< of the cause with any place of the group
  std::string family{};
  double family_probability{not_a_number};
  std::vector<std::string> group{};  ///< places that cannot be told apart, the subject's first
};

constexpr std::size_t candidates_reported = 3;

/// What was weighed for the first finding, whether it became one or not.
struct Candidate {
  std::string cause;
  std::string subject;
  std::optional<std::string> run;
  double probability{0.0};
  double share_of_remainder{0.0};  ///< of the RMS of left-out training rows, of the best output
  /// Alone in the model, on test rows, which decide nothing; empty where no term carries it.
  std::map<std::string, TestGain> test{};
  std::string would_decide{};  ///< the experiment that tells it from the likeliest other one
  /// What the probability comes from (rank/posterior.hpp), by name.
  std::vector<std::pair<const char*, double>> figures{};
};

/// RMS of training rows that were left out in turn.
struct LeftOutRms {
  double before_um{0.0};
  double after_um{0.0};
};

/// The rest that is predictable and has no name, as a `lag_bank` term and hinges of signals.
struct RemainderBank {
  TermSpec term;
  std::vector<TermSpec> hinges;
  std::map<std::string, LeftOutRms> left_out;  ///< of the outputs that it serves
  bool changes_coefficients{false};            ///< that had been fitted to the training rows
  /// Beside the findings; an output that does not gain goes without it.
  std::map<std::string, TestGain> test;
};

/// Shares of the variance that a model leaves of an output; they add to 1.
struct Headroom {
  double noise{0.0};         ///< of single values
  double named{0.0};         ///< what the findings carry
  double predictable{0.0};   ///< from what was recorded, but without a name
  double not_recorded{1.0};  ///< by nothing in this recording
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
  /// With every finding that a term can carry and the test runs do not speak against.
  ThermalModel extended;
  std::optional<RemainderBank> remainder;  ///< its terms are the extended model's last
  std::vector<Candidate> weighed;          ///< likeliest first
  /// Probability of each family, whether it is named or not, and of `none`; empty where nothing was
  /// weighed so.
  std::map<std::string, double> families{};
};

/// The answer as JSON (indented, a newline at the end). Numbers that are not known are null.
/// @param weighed  adds every candidate and what its probability comes from
[[nodiscard]] std::string diagnosis_json(const Diagnosis& diagnosis, bool weighed = false);

}  // namespace thermocomp::diagnosis
