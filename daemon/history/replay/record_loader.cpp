#include "daemon/history/replay/record_loader.hpp"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string_view>

#include "daemon/history/replay/replay.hpp"
#include "report/terminal.hpp"

namespace thermocomp::cli {

namespace {

bool is_history(const std::string& file) {
  constexpr std::string_view sqlite = "SQLite format 3";
  if (!std::filesystem::is_regular_file(file)) return false;
  std::string head(sqlite.size(), ' ');
  std::ifstream stream(file, std::ios::binary);
  stream.read(head.data(), static_cast<std::streamsize>(head.size()));
  return stream && head == sqlite;
}

}  // namespace

RunFile load_record(const std::string& argument, RunLoader& loader) {
  const RunSelection selection = parse_selection(argument);
  const std::string file = selection.file.string();
  if (!is_history(file)) return loader.load(argument);
  std::ostringstream text;
  Progress progress("reading " + file);
  const ExportSummary summary =
      export_run(file, std::nullopt, std::nullopt, text,
                 [&progress](double fraction) { progress.update(fraction); });
  for (const HistoryDamage& damage : summary.damage) {
    std::fprintf(stderr, "%s: %s\n", file.c_str(), to_string(damage).c_str());
  }
  RunFile run = parse_run(text.str(), file, selection);
  run.argument = argument;
  return run;
}

}  // namespace thermocomp::cli
