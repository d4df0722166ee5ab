#include "config/problems.hpp"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>

namespace thermocomp {
namespace {

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
  // A set, as a file can have a hundred thousand problems.
  std::set<std::tuple<std::string, int, std::string, std::string, std::string>> seen;
  std::vector<Problem> once;
  for (Problem& problem : problems) {
    const bool is_new =
        seen.emplace(problem.file, problem.line, problem.key, problem.value, problem.rule).second;
    if (is_new) once.push_back(std::move(problem));
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
    text += problem.key;
    if (!problem.value.empty()) text.append(" = ").append(problem.value);
    text += ": ";
  } else if (!problem.value.empty()) {
    text += problem.value + ": ";
  }
  text += problem.rule;
  // A quoted name may hold anything; a problem stays on its line and commands no terminal.
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; };
  std::replace_if(text.begin(), text.end(), is_control, ' ');
  return text;
}

ConfigurationError::ConfigurationError(std::vector<Problem> problems)
    : ConfigurationError(Sorted{}, in_order(std::move(problems))) {}

ConfigurationError::ConfigurationError(Sorted, std::vector<Problem> problems)
    : std::runtime_error(lines(problems)), problems_(std::move(problems)) {}

}  // namespace thermocomp
