/// Parameters of a cause as they are told: numbers with intervals.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace thermocomp::diagnosis {

struct Interval {
  double low{0.0};
  double high{0.0};
};

/// A parameter of a cause: one number, or one an output.
struct Parameter {
  std::string name;
  std::map<std::string, double> values;  ///< by output; one of the name "" where it is shared
  std::map<std::string, Interval> ci95;  ///< the same keys; may be empty
};

/// The value that all outputs share; 0 where there is no such parameter.
[[nodiscard]] double shared_value(const std::vector<Parameter>& parameters,
                                  const std::string& name);

/// The gains of a finding as the search leaves them.
struct FoundGains {
  const std::vector<std::string>& names;           ///< one a column of the hypothesis
  const std::vector<std::string>& outputs;         ///< of the model
  const std::vector<Eigen::VectorXd>& gains;       ///< one an output; empty: it does not act on it
  const std::vector<std::vector<Interval>>& ci95;  ///< the same
};

/// Gain number `index` of every output that the finding acts on.
[[nodiscard]] Parameter gain_table(const FoundGains& found, Eigen::Index index);
/// The first output that it acts on.
[[nodiscard]] std::size_t first_output(const FoundGains& found);

/// What a cause tells of its gains. The first gain of each output:
[[nodiscard]] std::vector<Parameter> gain_of_each_output(const FoundGains& found);
/// The one gain of a fault:
[[nodiscard]] std::vector<Parameter> single_gain(const FoundGains& found);

}  // namespace thermocomp::diagnosis
