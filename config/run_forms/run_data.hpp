/// The content of a run file, independent of its form.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/run_forms/field_text.hpp"
#include "config/text/problems.hpp"

namespace thermocomp {

/// Problems of one run file, up to a limit.
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

/// Wall-clock time of time_s = 0, by the clock of the writer.
struct WallZero {
  double seconds{0.0};  ///< since 1970, in UTC or the writer's zone
  bool is_utc{false};
};

/// A whole run by columns. References and states of lags start at row 0, independent of the
/// selection; results are for the rows [selected_begin, selected_end).
struct RunFile {
  std::string name;                         ///< the file, for messages
  std::string argument;                     ///< with its selection, as given to a command
  std::vector<std::string> columns;         ///< in header order, including time_s
  std::vector<std::vector<double>> values;  ///< shape (columns, rows); NaN: missing
  std::size_t selected_begin{0};
  std::size_t selected_end{0};
  /// Rows from which displacement counts from another state: a daemon's new reference before them.
  std::vector<std::size_t> references;
  bool is_part{false};  ///< of a file, from one reference to the next; `name` has its selection
  /// How a file of another form was read, line by line; empty for our own form.
  std::vector<std::string> understood;
  std::optional<WallZero> wall_zero;  ///< from dates, or from a comment

  [[nodiscard]] std::size_t rows() const noexcept { return values.empty() ? 0 : values[0].size(); }
  [[nodiscard]] std::optional<std::size_t> find(std::string_view column) const;
  /// @throws ConfigurationError naming the file when the column is missing
  [[nodiscard]] const std::vector<double>& column(std::string_view name) const;
  [[nodiscard]] const std::vector<double>& time_s() const { return column("time_s"); }
};

/// The comment with the wall-clock time of time_s = 0, as written by `export` and `import`:
/// "# 0.000 s: wall time 2026-03-02T07:00:00.000Z".
inline constexpr std::string_view reference_mark = " s: command reference";  ///< ends a comment
inline constexpr std::string_view wall_zero_mark = "# 0.000 s: wall time ";
/// @return nullopt when there is no such comment
[[nodiscard]] std::optional<WallZero> stated_wall_zero(std::string_view text);
[[nodiscard]] std::string wall_zero_comment(const WallZero& zero);
/// @param stamp  a date, or a clock time on 1970-01-01; the first order of the day that it allows
[[nodiscard]] std::optional<WallZero> wall_time(std::string_view stamp);

}  // namespace thermocomp
