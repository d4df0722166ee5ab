#include "report/command.hpp"

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/text/clean_output.hpp"
#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::cli {
namespace {

/// Options of files that a command writes.
bool is_output(const CLI::Option& option) {
  constexpr std::array names{"output", "report", "json", "page", "picture", "vtu", "curves"};
  return option.check_sname("o") || std::any_of(names.begin(), names.end(), [&](const char* name) {
           return option.check_lname(name);
         });
}

/// True for commands that complete a file: `covariance` and `fit` may write into the model they
/// read.
bool may_be_replaced(const CLI::App& command, const CLI::Option& option) {
  return (command.get_name() == "covariance" && option.check_lname("model")) ||
         (command.get_name() == "fit" && option.check_lname("like"));
}

/// @throws Failure if a file to be written is one of those to be read, also by way of links
void refuse_onto_input(const CLI::App& command) {
  std::vector<std::pair<const CLI::Option*, std::string>> files;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& file : option->results()) files.emplace_back(option, file);
  for (const auto& [output, written] : files) {
    if (!is_output(*output)) continue;
    for (const auto& [input, read] : files) {
      std::error_code error;
      if (is_output(*input) || may_be_replaced(command, *input)) continue;
      const std::string file = read.substr(0, read.rfind('@'));  // a selection of rows
      const bool is_input = std::filesystem::equivalent(read, written, error) ||
                            std::filesystem::equivalent(file, written, error);
      if (is_input) throw Failure(written + ": is the input; the output must be another file");
    }
  }
  for (const CLI::App* each : command.get_subcommands()) refuse_onto_input(*each);
}

}  // namespace

int run_program(int argc, char** argv, const char* name,
                const std::function<void(CLI::App&, Action&)>& declare, int failed) {
  clean_standard_output();
  std::signal(SIGPIPE, SIG_IGN);
  try {
    CLI::App app;
    Action action;
    declare(app, action);
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      return app.exit(error) == 0 ? exit_success : exit_error;
    }
    refuse_onto_input(app);
    return action();
  } catch (const ConfigurationError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return exit_error;
  } catch (const Failure& failure) {
    std::fprintf(stderr, "%s: %s\n", name, failure.what());
    return failure.status();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", name, error.what());
    return failed;
  }
}

std::string command_error_text(const CLI::App* app, const CLI::Error& error) {
  const CLI::App* group = app;
  std::string words = app->get_name();
  while (!group->get_subcommands().empty()) {
    group = group->get_subcommands().front();
    words += " " + group->get_name();
  }
  std::vector<std::string> known;
  for (const CLI::App* command : group->get_subcommands([](const CLI::App*) { return true; }))
    known.push_back(command->get_name());
  const std::vector<std::string> rest = group->remaining();
  const auto word = std::find_if(rest.begin(), rest.end(),
                                 [](const std::string& each) { return !each.starts_with('-'); });
  const bool none = rest.empty() && error.get_name() == "RequiredError";
  if (!known.empty() && none) {
    std::string names;
    for (const std::string& each : known) names += (names.empty() ? "" : ", ") + each;
    return words + ": which command? One of: " + names + ".\n" + words +
           " --help describes them.\n";
  }
  if (known.empty() || word == rest.end()) return CLI::FailureMessage::simple(app, error);
  const std::string meant = nearest_name(*word, known);
  return words + ": no command " + *word + (meant.empty() ? "" : "; did you mean " + meant + "?") +
         "\n" + words + " --help lists them.\n";
}

}  // namespace thermocomp::cli
