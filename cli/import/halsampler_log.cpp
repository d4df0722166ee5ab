#include <algorithm>
#include <cmath>

#include "cli/import/log_form.hpp"
#include "config/run_forms/field_text.hpp"
#include "config/text/number_text.hpp"
#include "config/text/problems.hpp"
#include "config/text/units.hpp"

namespace thermocomp::cli {
namespace {

struct Samples {
  std::vector<std::vector<double>> rows;
  std::vector<bool> after_overrun;
};

[[noreturn]] void refuse(const std::string& name, int line, const std::string& key,
                         const std::string& value, std::string rule) {
  throw ConfigurationError({Problem{name, line, key, value, std::move(rule)}});
}

Samples samples_of(std::string_view text, const std::string& name) {
  Samples samples;
  bool overrun = false;
  for (int line = 1; !text.empty(); ++line) {
    std::string_view rest;
    static_cast<void>(take(text, '\n', rest));
    rest = trimmed(rest);
    if (rest.empty()) continue;
    if (rest == "overrun") {
      overrun = !samples.rows.empty();  // what was lost before the first row is in no file
      continue;
    }
    std::vector<double> row;
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find_first_of(" \t"), rest.size());
      const auto number = finite_number(rest.substr(0, end));
      if (!number)
        refuse(name, line, "", std::string(rest.substr(0, end)), "must be a number, as before");
      row.push_back(*number);
      rest = trimmed(rest.substr(end));
    }
    if (!samples.rows.empty() && row.size() != samples.rows.front().size()) {
      // Whoever ends the program may cut its last line.
      if (trimmed(text).empty()) break;
      refuse(
          name, line, "", std::to_string(row.size()) + " numbers",
          "must be as many as in the rows before, " + std::to_string(samples.rows.front().size()));
    }
    samples.rows.push_back(std::move(row));
    samples.after_overrun.push_back(overrun);
    overrun = false;
  }
  return samples;
}

/// Whether the first number counts samples: whole and rising in every row.
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
  for (std::size_t i = 0; i < count; ++i) {
    names.append(i > 0 ? ",t" : "t").append(std::to_string(i + 1)).append("_degC");
  }
  return names;
}

/// Whether the rows begin with the sample's number, which the count of names decides.
bool is_numbered(const Samples& samples, const std::string& name, const LogOptions& options) {
  const std::size_t columns = samples.rows.front().size();
  const bool numbered = may_be_numbered(samples);
  if (options.names.empty())
    refuse(name, 1, "--names", "(missing)",
           "a log of halsampler has no header: write --names " +
               example(numbered && columns > 1 ? columns - 1 : columns) +
               " --period-s S, with what its pins are and the seconds between two samples" +
               (numbered ? " (its first number counts samples, as with -t)" : ""));
  if (options.names.size() == columns) return false;
  if (options.names.size() + 1 == columns && numbered) return true;
  refuse(name, 1, "--names", std::to_string(options.names.size()) + " names",
         "must be one for each of the " + std::to_string(columns) + " numbers of a row" +
             (numbered ? ", or one fewer when the first counts samples" : ""));
}

void check_names(const std::string& name, const std::vector<std::string>& names) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!is_column_name(names[i]) || names[i] == "time_s")
      refuse(name, 0, "--names", names[i], std::string(column_name_rule));
    for (std::size_t j = 0; j < i; ++j)
      if (names[i] == names[j]) refuse(name, 0, "--names", names[i], "is there twice");
  }
}

}  // namespace

RunFile read_halsampler(std::string_view text, const std::string& name, const LogOptions& options) {
  const Samples samples = samples_of(text, name);
  const bool numbered = is_numbered(samples, name, options);
  check_names(name, options.names);
  if (!options.period_s)
    refuse(name, 1, "--period-s", "(missing)",
           "a log of halsampler has no time: write --period-s S with the seconds between two "
           "samples, which is the period of the thread that sampler runs in");
  std::size_t overruns = 0;
  RunFile run;
  run.name = name;
  run.columns = {"time_s"};
  run.columns.insert(run.columns.end(), options.names.begin(), options.names.end());
  run.values.resize(run.columns.size());
  for (std::size_t row = 0; row < samples.rows.size(); ++row) {
    const std::vector<double>& numbers = samples.rows[row];
    if (samples.after_overrun[row]) ++overruns;
    const double count =
        numbered ? numbers.front() - samples.rows.front().front() : static_cast<double>(row);
    run.values[0].push_back(count * *options.period_s);
    for (std::size_t i = 0; i < options.names.size(); ++i)
      run.values[i + 1].push_back(numbers[i + (numbered ? 1 : 0)]);
  }
  if (overruns > 0 && !numbered)
    refuse(name, 0, "", std::to_string(overruns) + " overruns",
           "lost samples, and without their numbers nothing tells how many: record with "
           "halsampler -t");
  run.selected_end = run.rows();
  run.understood.push_back(std::string("halsampler, ") +
                           (numbered ? "samples numbered (-t)" : "samples not numbered"));
  run.understood.push_back("time_s: a sample each " + number_text(*options.period_s) +
                           " s, from the first row");
  for (std::size_t i = 0; i < options.names.size(); ++i)
    run.understood.push_back(
        "number " + std::to_string(i + (numbered ? 2 : 1)) + " is " + options.names[i] +
        (unit_of(options.names[i]).suffix.empty() ? ", a signal without unit" : ""));
  if (overruns > 0)
    run.understood.push_back("lost: " + std::to_string(overruns) +
                             " times the buffer ran over; a gap each");
  return run;
}

}  // namespace thermocomp::cli
