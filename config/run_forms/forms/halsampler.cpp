#include <algorithm>
#include <cmath>
#include <vector>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"

namespace thermocomp::forms {
namespace {

struct Samples {
  std::vector<std::vector<double>> rows;
  std::vector<bool> after_overrun;
};

Samples samples_of(const Log& log) {
  std::string_view text = log.text;
  Samples samples;
  bool overrun = false;
  for (int line = 1; !text.empty(); ++line) {
    std::string_view rest;
    static_cast<void>(take(text, '\n', rest));
    rest = trimmed(rest);
    if (rest.empty()) continue;
    if (rest == "overrun") {
      overrun = !samples.rows.empty();  // rows before the first one are not part of the file
      continue;
    }
    std::vector<double> row;
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find_first_of(" \t"), rest.size());
      const auto number = finite_number(rest.substr(0, end));
      if (!number)
        log.refuse(line, "", std::string(rest.substr(0, end)), "must be a number, as before");
      row.push_back(*number);
      rest = trimmed(rest.substr(end));
    }
    if (!samples.rows.empty() && row.size() != samples.rows.front().size()) {
      // The last line may be cut when the program is stopped.
      if (trimmed(text).empty()) break;
      log.refuse(
          line, "", std::to_string(row.size()) + " numbers",
          "must be as many as in the rows before, " + std::to_string(samples.rows.front().size()));
    }
    samples.rows.push_back(std::move(row));
    samples.after_overrun.push_back(overrun);
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
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!is_column_name(names[i]))
      log.refuse(0, "--names", names[i], std::string(column_name_rule));
    for (std::size_t j = 0; j < i; ++j)
      if (names[i] == names[j]) log.refuse(0, "--names", names[i], "is listed twice");
  }
}

/// Whether a name is a time, possibly in another unit: "t [ms]" of a map, "time_s".
bool has_time(const std::vector<std::string>& names) {
  return std::find(names.begin(), names.end(), "time_s") != names.end();
}

}  // namespace

/// Whether the text has only numbers and blanks, in at least one row.
bool is_halsampler(std::string_view text) {
  constexpr int rows_judged = 20;
  int rows = 0;
  while (!text.empty() && rows < rows_judged) {
    std::string_view line = trimmed(take_line(text));
    if (line.empty() || line == "overrun") continue;
    while (!line.empty()) {
      const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
      if (!finite_number(line.substr(0, end))) return false;
      line = trimmed(line.substr(end));
    }
    ++rows;
  }
  return rows > 0;
}

PlainTable plain_halsampler(const Log& log) {
  const Samples samples = samples_of(log);
  const bool numbered = is_numbered(samples, log);
  check_names(log);
  const std::vector<std::string>& names = log.map.names;
  const bool timed = has_time(names);
  if (!timed && !log.map.period_s)
    log.refuse(1, "--period-s", "(missing)",
               "a log of halsampler has no time: write --period-s S with the seconds between two "
               "samples, which is the period of the thread that sampler runs in");
  PlainTable table;
  table.has_own_names = true;
  if (!timed) table.text = "time_s";
  for (const std::string& name : names)
    table.text.append(table.text.empty() ? "" : ",").append(name);
  std::size_t overruns = 0;
  for (std::size_t row = 0; row < samples.rows.size(); ++row) {
    const std::vector<double>& numbers = samples.rows[row];
    table.text += '\n';
    if (samples.after_overrun[row]) ++overruns;
    const double count =
        numbered ? numbers.front() - samples.rows.front().front() : static_cast<double>(row);
    if (!timed) append_number(table.text, count * *log.map.period_s);
    for (std::size_t i = numbered ? 1 : 0; i < numbers.size(); ++i) {
      if (i > (numbered ? 1U : 0U) || !timed) table.text += ',';
      append_number(table.text, numbers[i]);
    }
  }
  table.text += '\n';
  if (overruns > 0 && !numbered)
    log.refuse(0, "", std::to_string(overruns) + " overruns",
               "lost an unknown number of samples: record with halsampler -t, which numbers them");
  table.notes.push_back(std::string("numbers between blanks, ") +
                        (numbered ? "samples numbered (-t)" : "samples not numbered"));
  if (!timed)
    table.notes.push_back("time_s: a sample each " + number_text(*log.map.period_s) +
                          " s, from the first row");
  for (std::size_t i = 0; i < names.size(); ++i)
    table.notes.push_back("number " + std::to_string(i + (numbered ? 2 : 1)) + " is " + names[i] +
                          (unit_of(names[i]).suffix.empty() ? ", a signal without unit" : ""));
  if (overruns > 0)
    table.notes.push_back("lost: " + std::to_string(overruns) +
                          " times the buffer ran over; a gap each");
  return table;
}

namespace {

constexpr std::string_view mark = "Sampling period is ";

}  // namespace

bool is_halscope(std::string_view text) {
  return trimmed(text).starts_with(mark);
}

PlainTable plain_halscope(const Log& log) {
  std::string_view rest = trimmed(log.text);
  const std::string_view first = trimmed(take_line(rest)).substr(mark.size());
  const auto period_ns = finite_number(first.substr(0, first.find(' ')));
  if (!period_ns || !(*period_ns > 0))
    log.refuse(1, "", std::string(first), "must be the sampling period in ns");
  std::vector<std::string> labels;
  std::vector<std::vector<std::string_view>> values;
  for (int line = 2; !rest.empty(); ++line) {
    std::string_view words = trimmed(take_line(rest));
    while (!words.empty()) {
      const auto blank = words.find(' ');
      const std::string label(words.substr(0, blank));
      words = blank == std::string_view::npos ? std::string_view() : trimmed(words.substr(blank));
      const std::string_view value = words.substr(0, words.find(' '));
      if (!finite_number(value))
        log.refuse(line, label, std::string(value), "must be a label and its value, in turn");
      words = trimmed(words.substr(value.size()));
      std::size_t i = 0;
      while (i < labels.size() && labels[i] != label) ++i;
      if (i == labels.size()) {
        labels.push_back(label);
        values.emplace_back();
      }
      values[i].push_back(value);
    }
  }
  if (labels.empty()) log.refuse(0, "", "", "has no row of data");
  PlainTable table;
  table.text = "time_s";
  for (const std::string& label : labels) table.text.append(",").append(in_quotes(label));
  for (std::size_t row = 0; row < values[0].size(); ++row) {
    table.text += '\n';
    append_number(table.text, static_cast<double>(row) * *period_ns * 1e-9);
    for (const auto& column : values)
      table.text.append(",").append(row < column.size() ? column[row] : "");
  }
  table.text += '\n';
  table.notes.push_back("halscope of LinuxCNC, a sample each " + number_text(*period_ns * 1e-9) +
                        " s");
  return table;
}

}  // namespace thermocomp::forms
