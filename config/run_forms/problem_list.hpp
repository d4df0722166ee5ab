/// Problems of one run file, up to a limit.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/run_forms/field_text.hpp"
#include "config/text/problems.hpp"

namespace thermocomp {

class ProblemList {
 public:
  explicit ProblemList(std::string file) : file_(std::move(file)) {}

  void add(int line, std::string key, std::string_view value, std::string rule) {
    if (full()) return;  // checked here too, for rows of many columns
    problems_.push_back({file_, line, std::move(key), shortened(value), std::move(rule)});
  }
  /// Adds a problem of another, related file.
  void add(Problem problem) {
    if (!full()) problems_.push_back(std::move(problem));
  }
  [[nodiscard]] const std::string& file() const noexcept { return file_; }
  [[nodiscard]] bool empty() const noexcept { return problems_.empty(); }
  [[nodiscard]] bool full() const noexcept { return problems_.size() >= problems_max; }
  /// @throws ConfigurationError if there are problems
  void throw_any() {
    if (!problems_.empty()) throw ConfigurationError(std::move(problems_));
  }

 private:
  static constexpr std::size_t problems_max = 100;
  std::string file_;
  std::vector<Problem> problems_;
};

}  // namespace thermocomp
