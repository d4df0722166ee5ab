#include "config/text/problems.hpp"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>

#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

/// Enough to read, and an answer over the socket must stay one line of reasonable length.
constexpr std::size_t shown_max = 100;
constexpr std::size_t part_bytes_max = 1000;

/// Shortens a key or rule; the names in a file may be arbitrarily long.
std::string cut(const std::string& part) {
  if (part.size() <= part_bytes_max) return part;
  std::size_t end = part_bytes_max;
  while (end > 0 && (static_cast<unsigned char>(part[end]) & 0xC0u) == 0x80u) --end;
  return part.substr(0, end) + " ...";
}

std::vector<Problem> in_order(std::vector<Problem> problems) {
  std::vector<std::string> files;
  for (const Problem& problem : problems) {
    if (std::find(files.begin(), files.end(), problem.file) == files.end()) {
      files.push_back(problem.file);
    }
  }
  const auto rank = [&](const Problem& problem) {
    return std::pair(std::find(files.begin(), files.end(), problem.file), problem.line);
  };
  std::stable_sort(problems.begin(), problems.end(),
                   [&](const Problem& a, const Problem& b) { return rank(a) < rank(b); });
  // A set, since a file can have many thousands of problems.
  std::set<std::tuple<std::string, int, std::string, std::string, std::string>> seen;
  std::vector<Problem> once;
  for (Problem& problem : problems) {
    const bool is_new =
        seen.emplace(problem.file, problem.line, problem.key, problem.value, problem.rule).second;
    if (is_new) once.push_back(std::move(problem));
  }
  if (once.size() > shown_max) {
    const std::size_t more = once.size() - shown_max;
    once.resize(shown_max);
    once.push_back({once.back().file, 0, "", "", "and " + std::to_string(more) + " more problems"});
  }
  return once;
}

std::string lines(const std::vector<Problem>& problems) {
  std::string text;
  for (const Problem& problem : problems) {
    if (!text.empty()) text += '\n';
    text += to_string(problem);
  }
  return text;
}

}  // namespace

std::string to_string(const Problem& problem) {
  std::string text = problem.file;
  if (problem.line > 0) text.append(":").append(std::to_string(problem.line));
  if (!text.empty()) text += ": ";
  if (!problem.key.empty()) {
    text += cut(problem.key);
    if (!problem.value.empty()) text.append(" = ").append(cut(problem.value));
    text += ": ";
  } else if (!problem.value.empty()) {
    text += cut(problem.value) + ": ";
  }
  text += cut(problem.rule);
  // A quoted name may contain anything; a problem is one line without control codes.
  return printable_text(text);
}

ConfigurationError::ConfigurationError(std::vector<Problem> problems)
    : ConfigurationError(Sorted{}, in_order(std::move(problems))) {}

ConfigurationError::ConfigurationError(Sorted, std::vector<Problem> problems)
    : std::runtime_error(lines(problems)), problems_(std::move(problems)) {}

}  // namespace thermocomp
