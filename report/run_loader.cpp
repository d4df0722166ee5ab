#include "report/run_loader.hpp"

#include <algorithm>
#include <cstdio>

namespace thermocomp::cli {

RunLoader::RunLoader(const std::string& columns)
    : has_map_(!columns.empty()), map_(has_map_ ? load_column_map(columns) : ColumnMap{}) {}

RunFile RunLoader::load(const std::string& argument) {
  RunFile run = load_run(parse_selection(argument), has_map_ ? &map_ : nullptr);
  print_interpretation(run);
  return run;
}

std::vector<RunFile> RunLoader::load(const std::vector<std::string>& arguments) {
  std::vector<RunFile> runs;
  runs.reserve(arguments.size());
  for (const std::string& argument : arguments) runs.push_back(load(argument));
  return runs;
}

void RunLoader::print_interpretation(const RunFile& run) {
  if (run.understood.empty()) return;
  const auto is_reported = [this](const std::string& line) {
    return std::find(reported_.begin(), reported_.end(), line) != reported_.end();
  };
  std::fprintf(stderr, "%s: read as follows%s\n", run.name.c_str(),
               reported_.empty() ? "" : " and above");
  for (const std::string& line : run.understood) {
    if (is_reported(line)) continue;
    std::fprintf(stderr, "  %s\n", line.c_str());
    reported_.push_back(line);
  }
}

}  // namespace thermocomp::cli
