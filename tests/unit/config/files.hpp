/// The examples as texts, and edits that break them.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <sys/stat.h>

#include "config/daemon/daemon_config.hpp"
#include "config/text/problems.hpp"

namespace thermocomp::test {

inline const std::filesystem::path examples{THERMOCOMP_EXAMPLES};

inline std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  REQUIRE(file.good());
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}
inline std::string example(const std::string& name) {
  return text_of(examples / name);
}

/// `text` with the first `from`, which must exist, replaced by `to`.
inline std::string edited(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  INFO("looking for: " << from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

/// Line of the first `snippet`, counted from 1.
inline int line_of(const std::string& text, const std::string& snippet) {
  const auto at = text.find(snippet);
  INFO("looking for: " << snippet);
  REQUIRE(at != std::string::npos);
  return 1 + static_cast<int>(
                 std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

/// Problems thrown by `load`; empty if it does not throw.
template <class Load>
std::vector<Problem> problems_of(Load load) {
  try {
    static_cast<void>(load());
  } catch (const ConfigurationError& error) {
    return error.problems();
  }
  return {};
}

/// A folder with examples, in which files named by the configuration can be edited.
class ExampleFolder {
 public:
  /// @param files  the configuration first
  explicit ExampleFolder(const std::vector<std::string>& files) : config_(files.at(0)) {
    std::string name =
        (std::filesystem::temp_directory_path() / "thermocomp-config-XXXXXX").string();
    REQUIRE(::mkdtemp(name.data()) != nullptr);
    path_ = name;
    for (const std::string& file : files) write(file, example(file));
  }
  ExampleFolder(const ExampleFolder&) = delete;
  ExampleFolder& operator=(const ExampleFolder&) = delete;
  ~ExampleFolder() { std::filesystem::remove_all(path_); }

  void edit(const std::string& file, const std::string& from, const std::string& to) const {
    write(file, edited(text_of(path_ / file), from, to));
  }
  void write(const std::string& file, const std::string& text) const {
    std::ofstream(path_ / file, std::ios::binary) << text;
  }
  /// Sets the configuration's paths of history and state, and creates links of all kinds.
  void name_files(const std::string& history, const std::string& state) const {
    namespace fs = std::filesystem;
    edit(config_, "/var/lib/thermocomp/state.json", state);
    edit(config_, "/var/lib/thermocomp/history.db", history);
    fs::create_directory(path_ / "sub");
    fs::create_symlink("small_machine_model.toml", path_ / "link_to_model");
    fs::create_hard_link(path_ / "small_machine_model.toml", path_ / "hard_link_to_model");
    fs::create_symlink("nothing", path_ / "link_to_nothing");
    fs::create_symlink("loop_b", path_ / "loop_a");
    fs::create_symlink("loop_a", path_ / "loop_b");
    REQUIRE(::mkfifo((path_ / "pipe").c_str(), 0600) == 0);
  }
  [[nodiscard]] DaemonConfig load() const { return load_daemon_config(path_ / config_); }
  /// All problems, one per line, without the folder.
  [[nodiscard]] std::string problems_text() const {
    std::string text;
    for (const Problem& problem : problems_of([&] { return load(); })) {
      text += to_string(problem).substr(path_.string().size() + 1) + "\n";
    }
    return text;
  }

 private:
  std::string config_;
  std::filesystem::path path_;
};

/// An edit that breaks a valid text, and the expected problem.
struct Broken {
  std::string what;
  std::string from;
  std::string to;
  std::string at;    ///< a snippet of the reported line; empty: the line of `to`
  std::string key;   ///< full key of the problem
  std::string rule;  ///< part of the rule
};

/// Checks that the edit has only the expected problem, with file, line, key, value and rule.
template <class Parse>
void check_refused(const Broken& broken, const std::string& good, const std::string& file,
                   Parse parse) {
  const std::string text = edited(good, broken.from, broken.to);
  const auto problems = problems_of([&] { return parse(text); });
  std::string problems_text;
  for (const Problem& problem : problems) problems_text += to_string(problem) + "\n";
  INFO(broken.what << "\n" << problems_text);
  CHECK(problems.size() == 1);
  if (problems.empty()) return;
  const Problem& problem = problems.front();
  CHECK(problem.file == file);
  CHECK(problem.line == line_of(text, broken.at.empty() ? broken.to : broken.at));
  CHECK(problem.key == broken.key);
  CHECK(!problem.value.empty());
  CHECK_THAT(problem.rule, Catch::Contains(broken.rule));
}

}  // namespace thermocomp::test
