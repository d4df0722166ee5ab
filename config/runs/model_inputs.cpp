#include "config/runs/model_inputs.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string_view>
#include <unordered_set>

#include <system_error>

#include "config/run_forms/field_text.hpp"
#include "config/runs/robust.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"
#include "config/text/units.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  if (a == b) return true;
  std::error_code failed;
  return std::filesystem::equivalent(a, b, failed) && !failed;
}

[[noreturn]] void refuse(const RunFile& run, const RunFile& other, const char* rule) {
  // The other one is named only if it has another path.
  throw ConfigurationError(
      {Problem{run.name, 0, "", other.name == run.name ? "" : other.name, rule}});
}

/// Consecutive rows with the same values in both runs are the same rows: two measurements agree in
/// some rows, but not while the values change.
constexpr std::size_t same_rows_min = 10;
constexpr double same_share_min = 0.25;  ///< of the shorter run

/// One number for each stretch of same_rows_min selected rows that differ from the previous row,
/// including the time between them: coarse values of two warm-ups are alike, their times are not.
std::vector<std::size_t> stretches_of(const RunFile& run, const std::vector<std::string>& names) {
  const auto combine = [](std::size_t hash, double next) {
    return hash * 0x9E3779B97F4A7C15U + std::hash<double>{}(next);
  };
  std::vector<const std::vector<double>*> columns;
  for (const std::string& name : names) columns.push_back(&run.column(name));
  constexpr double per_s = 1000.0;  // times may be counted from another start
  std::vector<std::size_t> rows;
  std::size_t last = 0;
  double last_s = not_a_number;
  for (std::size_t row = run.selected_begin; row < run.selected_end; ++row) {
    std::size_t hash = 0;
    for (const std::vector<double>* column : columns) hash = combine(hash, (*column)[row]);
    if (hash == last) continue;
    const double time_s = run.time_s()[row];
    if (std::isfinite(last_s)) rows.push_back(combine(hash, std::round(per_s * (time_s - last_s))));
    last = hash;
    last_s = time_s;
  }
  std::vector<std::size_t> stretches;
  for (std::size_t begin = 0; begin + same_rows_min <= rows.size(); ++begin) {
    std::size_t hash = 0;
    for (std::size_t row = begin; row < begin + same_rows_min; ++row)
      hash = hash * 0x9E3779B97F4A7C15U + rows[row];
    stretches.push_back(hash);
  }
  return stretches;
}

/// True for a copy, or for overlapping exports of one history.
bool are_of_one_measurement(const RunFile& a, const RunFile& b) {
  std::vector<std::string> columns;
  for (const std::string& column : a.columns)
    if (column != "time_s" && b.find(column)) columns.push_back(column);
  const std::vector<std::size_t> first = stretches_of(a, columns);
  const std::vector<std::size_t> second = stretches_of(b, columns);
  const std::unordered_set<std::size_t> known(first.begin(), first.end());
  const auto same = std::count_if(second.begin(), second.end(),
                                  [&](std::size_t stretch) { return known.contains(stretch); });
  const auto shorter = static_cast<double>(std::min(first.size(), second.size()));
  return same > 0 && static_cast<double>(same) >= same_share_min * shorter;
}

}  // namespace

bool share_rows(const RunFile& a, const RunFile& b) {
  // Stretches of one file cannot be told apart by their content if the machine repeats itself.
  if ((a.is_part || b.is_part) && same_file(file_of(a), file_of(b)))
    return std::max(a.time_s()[a.selected_begin], b.time_s()[b.selected_begin]) <=
           std::min(a.time_s()[a.selected_end - 1], b.time_s()[b.selected_end - 1]);
  if (same_file(a.name, b.name))
    return std::max(a.selected_begin, b.selected_begin) < std::min(a.selected_end, b.selected_end);
  return are_of_one_measurement(a, b);
}

bool is_made_from(std::span<const std::string> runs, const std::string& run) {
  const RunSelection of = parse_selection(run);
  return std::any_of(runs.begin(), runs.end(), [&](const std::string& each) {
    const RunSelection known = parse_selection(each);
    return known.file.filename() == of.file.filename() && known.from_s < of.to_s &&
           of.from_s < known.to_s;
  });
}

void refuse_overlap(std::span<const RunFile> runs) {
  for (std::size_t i = 0; i < runs.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (share_rows(runs[i], runs[j]))
        refuse(runs[i], runs[j],
               "is given twice, or has rows of the other: rows that are left out would be fitted");
}

void refuse_overlap(std::span<const RunFile> train, std::span<const RunFile> test) {
  for (const RunFile& judged : test)
    for (const RunFile& fitted : train)
      if (share_rows(judged, fitted))
        refuse(judged, fitted,
               "is judged on rows that are fitted: train and test must not overlap");
}

namespace {

constexpr std::size_t side = 4;
constexpr std::size_t rows_min = 2 * side + 1;
constexpr double usual_deviations = 12.0;
constexpr double share_of_way = 0.25;
/// At an end, only its size distinguishes an outlier from the machine's first step.
constexpr double share_of_way_at_end = 0.5;
/// Few values are far apart in time: a genuine one may be as far from its neighbours as the column
/// ranges, and the first of a warm-up farther, since the others have settled.
constexpr std::size_t few_values = 60;
constexpr double share_of_way_of_few = 1.0;
constexpr double share_of_way_at_end_of_few = 10.0;
constexpr double share_max = 0.1;  ///< of the values; more are the column's own course
constexpr std::size_t stuck_rows_min = 10;
constexpr std::size_t stuck_longer_min = 3;  ///< times the second longest stretch of one value
constexpr std::size_t times_named_max = 6;

using Values = std::vector<double>;

/// Deviation of each value from its neighbours.
Values leaps_of(const Values& values) {
  Values leaps(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool at_end = i == 0 || i + 1 == values.size();
    leaps[i] = values[i] -
               (at_end ? line_beside(values, i, side, i == 0) : median_around(values, i, side));
  }
  return leaps;
}

/// Range of the running median, without 2 % at either end.
double way_of(const Values& values, const Values& leaps) {
  Values expected;
  for (std::size_t i = 0; i < values.size(); ++i) expected.push_back(values[i] - leaps[i]);
  std::sort(expected.begin(), expected.end());
  const std::size_t rim = expected.size() / 50;
  return expected[expected.size() - 1 - rim] - expected[rim];
}

Outliers outliers_of(const RunFile& run, const std::string& column) {
  Outliers found;
  found.column = column;
  Values values;
  Values times_s;
  const Values& all = run.column(column);
  for (std::size_t row = 0; row < all.size(); ++row) {
    if (!std::isfinite(all[row])) continue;
    values.push_back(all[row]);
    times_s.push_back(run.time_s()[row]);
  }
  // Repeated without the outliers found, since one next to an end bends the line there.
  while (values.size() >= rows_min) {
    const Values leaps = leaps_of(values);
    const double usual_um = usual_deviations * robust_deviation(leaps);
    const double way_um = way_of(values, leaps);
    const bool few = values.size() < few_values;
    const double limit_um = std::max(usual_um, (few ? share_of_way_of_few : share_of_way) * way_um);
    const double limit_at_end_um =
        std::max(usual_um, (few ? share_of_way_at_end_of_few : share_of_way_at_end) * way_um);
    if (found.times_s.empty()) found.limit_um = limit_um;
    std::vector<std::size_t> off;
    for (std::size_t i = 0; i < leaps.size(); ++i) {
      const bool at_end = i == 0 || i + 1 == leaps.size();
      if (std::abs(leaps[i]) > (at_end ? limit_at_end_um : limit_um)) off.push_back(i);
    }
    if (off.empty()) break;
    for (std::size_t last = off.size(); last-- > 0;) {
      const std::size_t i = off[last];
      if (std::abs(leaps[i]) > std::abs(found.size_um)) found.size_um = leaps[i];
      found.times_s.push_back(times_s[i]);
      values.erase(values.begin() + static_cast<std::ptrdiff_t>(i));
      times_s.erase(times_s.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
  const auto count = static_cast<double>(found.times_s.size());
  if (count > share_max * (count + static_cast<double>(values.size()))) return Outliers{};
  std::sort(found.times_s.begin(), found.times_s.end());
  return found;
}

/// The longest stretch of one value, if it ends with a jump larger than any usual change.
Outliers stuck_of(const RunFile& run, const std::string& column) {
  Outliers found;
  found.column = column;
  found.stuck = true;
  const Values& values = run.column(column);
  const auto [still, second] = longest_still(values);
  if (still.rows() < stuck_rows_min || still.rows() < stuck_longer_min * second ||
      still.end >= values.size())
    return found;
  Values changes;
  for (std::size_t i = 1; i < values.size(); ++i)
    if ((i <= still.begin || i > still.end) && std::isfinite(values[i] - values[i - 1]))
      changes.push_back(values[i] - values[i - 1]);
  if (changes.size() < rows_min) return found;
  Values finite = values;
  std::erase_if(finite, [](double each) { return !std::isfinite(each); });
  const auto [least, most] = std::minmax_element(finite.begin(), finite.end());
  found.limit_um =
      std::max(usual_deviations * robust_deviation(changes), share_of_way * (*most - *least));
  found.size_um = values[still.end] - values[still.end - 1];
  if (!(found.limit_um > 0 && std::abs(found.size_um) > found.limit_um)) return found;
  for (std::size_t i = still.begin + 1; i < still.end; ++i)
    found.times_s.push_back(run.time_s()[i]);
  return found;
}

}  // namespace

std::string Outliers::text() const {
  const std::string unit(unit_of(column).symbol);
  if (stuck)
    return column + ": " + std::to_string(times_s.size()) + " values are left out, the same from " +
           number_text(times_s.front()) + " to " + number_text(times_s.back()) +
           " s, then a leap of " + number_text(std::round(10.0 * size_um) / 10.0) + " " + unit;
  std::string text = column + ": " + std::to_string(times_s.size()) +
                     (times_s.size() == 1 ? " value is" : " values are") +
                     " left out, off the neighbours by up to ";
  char size[32];
  std::snprintf(size, sizeof size, "%+.4g ", size_um);
  text += size + unit + " (limit " + number_text(std::round(10.0 * limit_um) / 10.0) + "), at ";
  for (std::size_t i = 0; i < std::min(times_s.size(), times_named_max); ++i)
    text += (i == 0 ? "" : ", ") + number_text(times_s[i]);
  return text + (times_s.size() > times_named_max ? ", ... s" : " s");
}

std::vector<Outliers> leave_out_outliers(RunFile& run, const std::vector<std::string>& columns) {
  std::vector<Outliers> all;
  for (const std::string& column : columns)
    for (const auto find : {outliers_of, stuck_of})
      if (run.find(column))
        if (Outliers found = find(run, column); !found.times_s.empty())
          all.push_back(std::move(found));
  for (const Outliers& each : all) {
    std::vector<double>& values = run.values[*run.find(each.column)];
    for (std::size_t row = 0; row < values.size(); ++row)
      if (std::binary_search(each.times_s.begin(), each.times_s.end(), run.time_s()[row]))
        values[row] = not_a_number;
  }
  return all;
}

namespace {

using Columns = std::vector<const std::vector<double>*>;

Columns columns_of(const RunFile& run, const std::vector<std::string>& names,
                   std::vector<Problem>& problems) {
  Columns columns;
  for (const std::string& name : names) {
    const auto index = run.find(name);
    if (index)
      columns.push_back(&run.values[*index]);
    else
      problems.push_back({run.name, 0, name, "(missing)",
                          "the model needs this column (--columns gives one another name)"});
  }
  return columns;
}

std::vector<double> references(const ThermalModel& model, const RunFile& run,
                               const Columns& temperatures, const std::vector<std::string>& names) {
  std::vector<Problem> problems;
  std::vector<double> result;
  for (std::size_t i = 0; i < temperatures.size(); ++i) {
    if (i < model.reference_degC.size()) {
      result.push_back(model.reference_degC[i]);
      continue;
    }
    const std::optional<double> first = first_value(*temperatures[i]);
    if (first)
      result.push_back(*first);
    else
      problems.push_back({run.name, 0, names[i], "(missing)", "has no value to refer to"});
  }
  if (!problems.empty()) throw ConfigurationError(problems);
  return result;
}

std::vector<std::size_t> whole_rows(std::size_t count, const ModelInputs& inputs) {
  std::vector<std::size_t> rows;
  rows.reserve(count);
  for (std::size_t row = 0; row < count; ++row) {
    const auto has_value = [row](const auto* column) { return std::isfinite((*column)[row]); };
    if (std::ranges::all_of(inputs.temperatures, has_value) &&
        std::ranges::all_of(inputs.signals, has_value))
      rows.push_back(row);
  }
  return rows;
}

}  // namespace

ModelInputs model_inputs(const ThermalModel& model, const RunFile& run) {
  std::vector<Problem> problems;
  const std::vector<std::string> names = model.temperature_columns();
  ModelInputs inputs;
  inputs.temperatures = columns_of(run, names, problems);
  inputs.signals = columns_of(run, model.signal_columns(), problems);
  if (!problems.empty()) throw ConfigurationError(problems);
  inputs.reference_degC = references(model, run, inputs.temperatures, names);
  inputs.rows = whole_rows(run.rows(), inputs);
  return inputs;
}

void leave_out_empty_parts(const ThermalModel& model, std::vector<RunFile>& runs) {
  const auto has_values_of = [](const RunFile& run, const std::vector<std::string>& names) {
    return std::all_of(names.begin(), names.end(), [&run](const std::string& name) {
      return first_value(run.column(name)).has_value();
    });
  };
  const auto is_empty = [&](const RunFile& run) {
    return run.is_part && !(has_values_of(run, model.temperature_columns()) &&
                            has_values_of(run, model.signal_columns()));
  };
  if (std::all_of(runs.begin(), runs.end(), is_empty)) return;
  for (const RunFile& run : runs)
    if (is_empty(run))
      std::fprintf(stderr, "%s is left out: a column of the model has no value there\n",
                   run.name.c_str());
  std::erase_if(runs, is_empty);
}

bool is_mostly_known(const std::vector<double>& column) {
  constexpr double missing_share_max = 0.2;
  const auto missing =
      std::count_if(column.begin(), column.end(), [](double x) { return !std::isfinite(x); });
  return static_cast<double>(missing) <= missing_share_max * static_cast<double>(column.size());
}

std::optional<double> first_value(const std::vector<double>& column) {
  const auto first =
      std::find_if(column.begin(), column.end(), [](double value) { return std::isfinite(value); });
  return first == column.end() ? std::nullopt : std::optional(*first);
}

nanoseconds time_of_row(double time_s) {
  return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(time_s));
}

bool is_called_like_a_room(std::string name) {
  name = small_letters(name);
  const auto is_letter = [&](std::size_t i) {
    return std::isalpha(static_cast<unsigned char>(name[i])) != 0;
  };
  for (const std::string_view word : {"room", "ambient", "air", "raum", "luft", "umgebung", "hall"})
    for (std::size_t at = name.find(word); at != std::string::npos; at = name.find(word, at + 1))
      if (at == 0 || !is_letter(at - 1)) return true;  // not "pair", "shallow"
  return false;
}

}  // namespace thermocomp
