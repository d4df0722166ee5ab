// A document: parsing, and all that is wrong with it.
#include <algorithm>

#include <toml++/toml.h>

#include "config/toml/toml_limits.hpp"
#include "config/toml/toml_node.hpp"
#include "config/toml/toml_reader.hpp"
#include "config/toml/toml_state.hpp"

namespace thermocomp {

TomlDocument::TomlDocument(std::shared_ptr<detail::TomlState> state) : state_(std::move(state)) {}

TomlDocument TomlDocument::from_file(const std::filesystem::path& path) {
  return from_text(read_text_file(path), path.string());
}

TomlDocument TomlDocument::from_text(std::string text, std::string name) {
  auto state = std::make_shared<detail::TomlState>();
  state->name = std::move(name);
  state->text = std::move(text);
  if (const auto excess = toml_excess(state->text)) {
    throw ConfigurationError({{state->name, excess->line, "", "", excess->rule}});
  }
  try {
    state->root = toml::parse(std::string_view(state->text));
  } catch (const toml::parse_error& error) {
    throw ConfigurationError({{state->name, detail::line_of(error.source()), "", "",
                               "not TOML: " + std::string(error.description())}});
  }
  return TomlDocument(std::move(state));
}

TomlTable TomlDocument::root() const {
  return {state_, &state_->root, "", 1, false};
}

const std::string& TomlDocument::text() const noexcept {
  return state_->text;
}
const std::string& TomlDocument::name() const noexcept {
  return state_->name;
}

namespace {

/// A key that nobody asked for.
struct UnknownKey {
  const detail::TomlState::Opened* table;
  const toml::key* key;
  const toml::node* value;
};

Problem unknown_problem(const std::string& file, const UnknownKey& unknown, bool is_suggested) {
  const std::string name(unknown.key->str());
  std::string rule = "unknown key";
  if (is_suggested) {
    const auto& asked = unknown.table->asked;
    const std::string meant = nearest_name(name, {asked.begin(), asked.end()});
    if (!meant.empty()) rule += "; did you mean \"" + meant + "\"?";
  }
  const std::string& path = unknown.table->path;
  return {file, detail::line_of(unknown.key->source()), path.empty() ? name : path + "." + name,
          detail::shown(*unknown.value), rule};
}

}  // namespace

std::vector<Problem> TomlDocument::all_problems() const {
  constexpr std::size_t suggestions_max = 100;  // as many as are told
  std::vector<UnknownKey> unknown;
  for (const auto& [table, opened] : state_->opened) {
    if (opened.ignore_rest) continue;
    for (const auto& [key, value] : *table) {
      if (!opened.asked.contains(key.str())) unknown.push_back({&opened, &key, &value});
    }
  }
  std::stable_sort(unknown.begin(), unknown.end(), [](const UnknownKey& a, const UnknownKey& b) {
    return a.key->source().begin.line < b.key->source().begin.line;
  });
  std::vector<Problem> problems = state_->problems;
  for (const UnknownKey& key : unknown) {
    if (problems.size() >= detail::kept_problems_max) break;
    const auto place = static_cast<std::size_t>(&key - unknown.data());
    problems.push_back(unknown_problem(state_->name, key, place < suggestions_max));
  }
  return problems;
}

void TomlDocument::finish() const {
  std::vector<Problem> problems = all_problems();
  if (!problems.empty()) throw ConfigurationError(std::move(problems));
}

}  // namespace thermocomp
