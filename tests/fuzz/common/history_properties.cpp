#include "history_properties.hpp"

#include <cstdio>
#include <sstream>
#include <string>

#include "config/runs/run_file.hpp"
#include "fuzz.hpp"

namespace thermocomp::fuzz {
namespace {

/// @return true if `use` did not throw
template <class Use>
bool is_done(const std::filesystem::path& file, Use use) {
  try {
    use();
    return true;
  } catch (const HistoryError& error) {
    const std::string text = error.what();
    if (text.find(file.string()) == std::string::npos) std::fprintf(stderr, "%s\n", text.c_str());
    FUZZ_REQUIRE(text.find(file.string()) != std::string::npos);
  } catch (const ConfigurationError& error) {
    FUZZ_REQUIRE(!error.problems().empty());
  }
  return false;
}

void check_run_file(const std::string& text) {
  FUZZ_REQUIRE(text.find('\x1b') == std::string::npos);
  try {
    static_cast<void>(parse_run(text, "run.csv"));
  } catch (const ConfigurationError& error) {
    std::fprintf(stderr, "%s\n%s\n", error.what(), text.substr(0, 2000).c_str());
    broken("what was exported is a run file", __FILE__, __LINE__);
  }
}

}  // namespace

HistoryUse use_history(const std::filesystem::path& file, const SetupParser& parser) {
  HistoryUse use;
  std::ostringstream replayed;
  use.replayed = is_done(file, [&] { use.summary = replay_to_csv(file, replayed, {}, parser); });
  std::ostringstream exported;
  ExportSummary summary;
  use.exported = is_done(
      file, [&] { summary = export_run(file, std::nullopt, std::nullopt, exported, {}, parser); });
  if (use.exported && summary.rows > 0) check_run_file(exported.str());
  return use;
}

}  // namespace thermocomp::fuzz
