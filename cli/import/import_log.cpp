#include "cli/import/import_log.hpp"

#include "config/run_forms/foreign_run.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/runs/run_file.hpp"
#include "config/text/problems.hpp"
#include "config/toml/file_limits.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::cli {
namespace {

ImportedLog read_plain(const PlainTable& table, const std::string& name, const ColumnMap* map) {
  ImportedLog log{parse_run(table.text, name, {}, map), wall_zero(table.text, name, map)};
  log.run.understood.insert(log.run.understood.begin(), table.said.begin(), table.said.end());
  return log;
}

/// A file in our own form: nothing was to be understood; its wall time is in a comment of `export`.
void say_own_form(std::string_view text, ImportedLog& log) {
  log.run.understood.emplace_back("a run file already");
  constexpr std::string_view mark = "# 0.000 s: wall time ";
  const std::size_t at = text.find(mark);
  if (at == std::string_view::npos) return;
  const std::string_view stamp = text.substr(at + mark.size(), 24);
  const auto parsed = parse_time_stamp(stamp);
  if (!parsed || !parsed->zone_s) return;
  const auto seconds = seconds_of(*parsed, DateOrder::unknown, false);
  if (!seconds) return;
  log.wall_zero = WallZero{*seconds, true};
  log.run.understood.push_back("its time_s 0 was at " + std::string(stamp));
}

}  // namespace

ImportedLog import_text(std::string_view text, const std::string& name, const ColumnMap* map,
                        const LogOptions& options) {
  const LogForm form = log_form(text);
  if (!options.names.empty() && form != LogForm::halsampler)
    throw ConfigurationError({Problem{name, 0, "--names", options.names.front(),
                                      "is for a log without a header; this one has names"}});
  if (options.period_s && form != LogForm::halsampler && form != LogForm::temperature_store)
    throw ConfigurationError({Problem{name, 0, "--period-s", std::to_string(*options.period_s),
                                      "is for a log without time; this one has a column of it"}});
  switch (form) {
    case LogForm::halsampler:
      return {read_halsampler(text, name, options), {}};
    case LogForm::temperature_store:
      return {read_temperature_store(text, name, options), {}};
    case LogForm::toa5:
      return read_plain(plain_toa5(text, name), name, map);
    case LogForm::kw_watcher:
      return read_plain(plain_kw_watcher(text, name), name, map);
    case LogForm::table:
      break;
  }
  ImportedLog log{parse_run(text, name, {}, map), {}};
  if (log.run.understood.empty())
    say_own_form(text, log);
  else
    log.wall_zero = wall_zero(text, name, map);
  return log;
}

ImportedLog import_log(const std::string& file, const ColumnMap* map, const LogOptions& options) {
  return import_text(read_text_file(file, run_bytes_max), file, map, options);
}

}  // namespace thermocomp::cli
