#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/text_lines.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"

namespace thermocomp::forms {
namespace {

struct Samples {
  std::vector<std::vector<double>> rows;
  std::size_t overruns{0};
};

bool is_overrun(const std::vector<std::string_view>& words) {
  return words.size() == 1 && words[0] == "overrun";
}

/// Whether the text has only numbers and blanks, in at least one row.
bool is_halsampler(std::string_view text) {
  constexpr int rows_judged = 20;
  int rows = 0;
  while (!text.empty() && rows < rows_judged) {
    const std::vector<std::string_view> words = words_of(take_line(text));
    if (words.empty() || is_overrun(words)) continue;
    if (!std::ranges::all_of(words, [](auto word) { return finite_number(word).has_value(); }))
      return false;
    ++rows;
  }
  return rows > 0;
}

Samples samples_of(const Log& log) {
  std::string_view text = log.text;
  Samples samples;
  bool overrun = false;
  for (int line = 1; !text.empty(); ++line) {
    const std::vector<std::string_view> words = words_of(take_line(text));
    if (words.empty()) continue;
    if (is_overrun(words)) {
      overrun = !samples.rows.empty();  // rows before the first one are not part of the file
      continue;
    }
    std::vector<double> row;
    for (const std::string_view word : words) {
      const auto number = finite_number(word);
      if (!number) log.refuse(line, "", std::string(word), "must be a number, as before");
      row.push_back(*number);
    }
    if (!samples.rows.empty() && row.size() != samples.rows.front().size()) {
      // The last line may be cut when the program is stopped.
      if (trimmed(text).empty()) break;
      log.refuse(
          line, "", std::to_string(row.size()) + " numbers",
          "must be as many as in the rows before, " + std::to_string(samples.rows.front().size()));
    }
    samples.rows.push_back(std::move(row));
    if (overrun) ++samples.overruns;
    overrun = false;
  }
  return samples;
}

/// Whether the first column may be sample numbers: integers that rise in every row.
bool may_be_numbered(const Samples& samples) {
  for (std::size_t i = 0; i < samples.rows.size(); ++i) {
    const double number = samples.rows[i].front();
    if (number != std::floor(number) || number < 0.0) return false;
    if (i > 0 && !(number > samples.rows[i - 1].front())) return false;
  }
  return true;
}

std::string example(std::size_t count) {
  std::string names;
  for (std::size_t i = 0; i < count; ++i)
    names.append(i > 0 ? ",t" : "t").append(std::to_string(i + 1)).append("_degC");
  return names;
}

/// Whether the rows begin with the sample's number, decided by the number of names.
bool is_numbered(const Samples& samples, const Log& log) {
  const std::size_t columns = samples.rows.front().size();
  const std::vector<std::string>& names = log.map.names;
  const bool numbered = may_be_numbered(samples);
  if (names.empty())
    log.refuse(1, "--names", "(missing)",
               "has no header and no time: write --names time_s," + example(columns - 1) +
                   " where the first number is the time, or --names " +
                   example(numbered && columns > 1 ? columns - 1 : columns) +
                   " --period-s S, with the names of its pins and the seconds between two samples" +
                   (numbered ? " (its first number counts samples, as with -t)" : ""));
  if (names.size() == columns) return false;
  if (names.size() + 1 == columns && numbered) return true;
  log.refuse(1, "--names", std::to_string(names.size()) + " names",
             "must be one for each of the " + std::to_string(columns) + " numbers per row" +
                 (numbered ? ", or one fewer when the first counts samples" : ""));
}

void check_names(const Log& log) {
  const std::vector<std::string>& names = log.map.names;
  for (auto name = names.begin(); name != names.end(); ++name) {
    if (!is_column_name(*name)) log.refuse(0, "--names", *name, std::string(column_name_rule));
    if (std::find(names.begin(), name, *name) != name)
      log.refuse(0, "--names", *name, "is listed twice");
  }
}

}  // namespace

std::optional<PlainTable> halsampler(const Log& log) {
  if (!is_halsampler(log.text)) return std::nullopt;
  const Samples samples = samples_of(log);
  const bool numbered = is_numbered(samples, log);
  check_names(log);
  const std::vector<std::string>& names = log.map.names;
  const bool timed = std::ranges::find(names, "time_s") != names.end();
  if (!timed && !log.map.period_s)
    log.refuse(1, "--period-s", "(missing)",
               "a log of halsampler has no time: write --period-s S with the seconds between two "
               "samples, which is the period of the thread that sampler runs in");
  PlainTable table;
  table.has_own_names = true;
  if (!timed) table.text = "time_s";
  for (const std::string& name : names)
    table.text.append(table.text.empty() ? "" : ",").append(name);
  for (std::size_t row = 0; row < samples.rows.size(); ++row) {
    const std::vector<double>& numbers = samples.rows[row];
    const double count =
        numbered ? numbers.front() - samples.rows.front().front() : static_cast<double>(row);
    char before = '\n';
    const auto append = [&](double number) {
      append_number(table.text += std::exchange(before, ','), number);
    };
    if (!timed) append(count * *log.map.period_s);
    std::for_each(numbers.begin() + (numbered ? 1 : 0), numbers.end(), append);
  }
  table.text += '\n';
  const std::string overruns = std::to_string(samples.overruns);
  if (samples.overruns > 0 && !numbered)
    log.refuse(0, "", overruns + " overruns",
               "lost an unknown number of samples: record with halsampler -t, which numbers them");
  table.notes.push_back(std::string("numbers between blanks, samples ") +
                        (numbered ? "numbered (-t)" : "not numbered"));
  if (!timed)
    table.notes.push_back("time_s: a sample each " + number_text(*log.map.period_s) +
                          " s, from the first row");
  for (std::size_t i = 0; i < names.size(); ++i)
    table.notes.push_back("number " + std::to_string(i + (numbered ? 2 : 1)) + " is " + names[i] +
                          (unit_of(names[i]).suffix.empty() ? ", a signal without unit" : ""));
  if (samples.overruns > 0)
    table.notes.push_back("lost: " + overruns + " times the buffer ran over; a gap each");
  return table;
}

std::optional<PlainTable> halscope(const Log& log) {
  constexpr std::string_view mark = "Sampling period is ";
  std::string_view rest = trimmed(log.text);
  if (!rest.starts_with(mark)) return std::nullopt;
  const std::string_view first = trimmed(take_line(rest).substr(mark.size()));
  const auto period_ns = finite_number(first.substr(0, first.find(' ')));
  if (!period_ns || !(*period_ns > 0))
    log.refuse(1, "", std::string(first), "must be the sampling period in ns");
  NamedColumns columns;
  const std::size_t time = columns.add("time_s");
  std::map<std::size_t, std::size_t> rows;  // of each column
  for (int line = 2; !rest.empty(); ++line) {
    std::vector<std::string_view> words = words_of(take_line(rest));
    if (words.size() % 2 == 1) words.emplace_back("(missing)");
    for (std::size_t i = 0; i < words.size(); i += 2) {
      if (!finite_number(words[i + 1]))
        log.refuse(line, std::string(words[i]), std::string(words[i + 1]),
                   "must be a label and its value, in turn");
      const std::size_t column = columns.find_or_add(std::string(words[i]));
      columns.cell(rows[column]++, column) = words[i + 1];
    }
  }
  if (rows.empty()) log.refuse(0, "", "", "has no row of data");
  columns.keep_rows(rows.begin()->second);
  for (std::size_t row = 0; row < columns.rows(); ++row)
    columns.cell(row, time) = number_text(static_cast<double>(row) * *period_ns * 1e-9);
  return PlainTable{
      columns.text(),
      {"halscope of LinuxCNC, a sample each " + number_text(*period_ns * 1e-9) + " s"}};
}

}  // namespace thermocomp::forms
