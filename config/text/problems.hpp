/// Problems of a configuration file: all at once, each with its place and rule.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

namespace thermocomp {

/// More flaws of one file are not collected.
inline constexpr std::size_t flaws_max = 1000;

/// One broken rule. Parts that do not apply are empty (line: 0).
struct Problem {
  std::string file;   ///< as named by the caller
  int line{0};        ///< counted from 1; 0: the file as a whole
  std::string key;    ///< e.g. "sensor[bed_front].address"; in a run file the column
  std::string value;  ///< as written, shortened; "(missing)" if absent
  std::string rule;   ///< the rule that it breaks
};

/// `file:line: key = value: rule`; inapplicable parts are omitted.
[[nodiscard]] std::string to_string(const Problem& problem);

/// All problems of one load. what() has one line per problem.
class ConfigurationError : public std::runtime_error {
 public:
  /// Sorts by file (in order of first appearance) and line; drops exact repetitions.
  explicit ConfigurationError(std::vector<Problem> problems);
  [[nodiscard]] const std::vector<Problem>& problems() const noexcept { return problems_; }

 private:
  struct Sorted {};
  ConfigurationError(Sorted, std::vector<Problem> problems);
  std::vector<Problem> problems_;
};

}  // namespace thermocomp
