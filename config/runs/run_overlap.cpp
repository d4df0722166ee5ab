#include "config/runs/run_overlap.hpp"

#include <algorithm>
#include <filesystem>

#include <system_error>

namespace thermocomp {
namespace {

bool same_file(const std::string& a, const std::string& b) {
  if (a == b) return true;
  std::error_code failed;
  return std::filesystem::equivalent(a, b, failed) && !failed;
}

[[noreturn]] void refuse(const RunFile& run, const RunFile& other, const char* rule) {
  // The other one is named only where it is the same file by another path.
  throw ConfigurationError(
      {Problem{run.name, 0, "", other.name == run.name ? "" : other.name, rule}});
}

}  // namespace

bool share_rows(const RunFile& a, const RunFile& b) {
  return same_file(a.name, b.name) &&
         std::max(a.selected_begin, b.selected_begin) < std::min(a.selected_end, b.selected_end);
}

void refuse_overlap(std::span<const RunFile> runs) {
  for (std::size_t i = 0; i < runs.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (share_rows(runs[i], runs[j]))
        refuse(runs[i], runs[j], "is given twice: rows that are left out would be fitted");
}

void refuse_overlap(std::span<const RunFile> train, std::span<const RunFile> test) {
  for (const RunFile& judged : test)
    for (const RunFile& fitted : train)
      if (share_rows(judged, fitted))
        refuse(judged, fitted,
               "is judged on rows that are fitted: train and test must not overlap");
}

}  // namespace thermocomp
