#include "cli/commands.hpp"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <unistd.h>
#include <vector>

#include <CLI/CLI.hpp>
#include <system_error>

namespace thermocomp::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* program_name = "thermocomp-modelling";

struct ModellingCommand {
  const char* name;
  const char* help;
};
constexpr std::array<ModellingCommand, 10> commands{{
    {"structure", "block matrix of a structure, by finite elements"},
    {"place", "sensor positions of a structure"},
    {"tiebar", "the coefficients of a gate-shaped machine with tie bars"},
    {"plan", "test plan from factors and levels; --apart: to separate columns that moved alike"},
    {"inspect", "faults of recordings, and what they can identify"},
    {"series", "common behaviour of machines of one type"},
    {"group", "similarity groups of measured temperatures"},
    {"fit", "sensor choice and model from measured runs"},
    {"diagnose", "errors of a model in measured runs, and their causes"},
    {"thermal-test", "tests of thermal behaviour to ISO 230-3: plan and evaluation"},
}};

std::vector<fs::path> places_to_look() {
  std::vector<fs::path> places;
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (!error) {
    const fs::path folder = self.parent_path();
    places = {folder, folder.parent_path() / "libexec" / "thermocomp",
              folder.parent_path() / "libexec"};
  }
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (!folder.empty()) places.emplace_back(folder);
  }
  return places;
}

int run_modelling(const std::string& command, const std::vector<std::string>& arguments) {
  std::vector<std::string> words{program_name, command};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);

  for (const fs::path& place : places_to_look()) {
    const std::string program = (place / program_name).string();
    if (::access(program.c_str(), X_OK) != 0) continue;
    ::execv(program.c_str(), pointers.data());
    throw Failure("cannot start " + program + ": " + std::generic_category().message(errno));
  }
  throw Failure("'" + command +
                "' needs the program thermocomp-modelling, which is not installed;" +
                " it comes with the package thermocomp-modelling");
}

/// structure, place, tiebar, plan, inspect, group, fit, diagnose, thermal-test: passes all
/// arguments to `thermocomp-modelling` next to this program, in its libexec folder or in PATH.
void add_modelling_commands(CLI::App& app, Action& action) {
  for (const ModellingCommand& command : commands) {
    CLI::App* sub = app.add_subcommand(command.name, command.help);
    sub->group("Modelling (carried out by thermocomp-modelling)");
    sub->prefix_command();
    sub->set_help_flag();  // --help goes to the other program
    const std::string name = command.name;
    sub->callback([sub, name, &action] {
      action = [sub, name] { return run_modelling(name, sub->remaining()); };
    });
  }
}

}  // namespace

void declare_command_line(CLI::App& app, GlobalOptions& global, Action& action) {
  app.name("thermocomp");
  app.description("Keeps a CNC machine straight while it warms: the command for its operator");
  app.set_version_flag("--version", THERMOCOMP_VERSION);
  app.add_option("--socket", global.socket, "the daemon's status socket")
      ->type_name("FILE")
      ->default_str(global.socket);
  app.require_subcommand(1);
  app.failure_message(command_error_text);
  app.footer(
      "Exit status: 0 success, 1 the answer is no, 2 wrong usage, invalid input or unreachable.");
  add_init_command(app, action);
  add_check_command(app, action);
  add_scan_command(app, action);
  app.fallthrough();  // allows `thermocomp status --socket FILE`
  add_observe_commands(app, global, action);
  add_operate_commands(app, global, action);
  app.fallthrough(false);
  add_admit_command(app, action);
  add_history_commands(app, action);
  add_report_command(app, action);
  add_import_command(app, action);
  add_model_commands(app, action);
  add_modelling_commands(app, action);
}

}  // namespace thermocomp::cli
