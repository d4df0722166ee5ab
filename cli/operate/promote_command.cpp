#include "cli/operate/promote_command.hpp"

#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/common/daemon_client.hpp"
#include "cli/common/json_fields.hpp"
#include "config/toml/toml_reader.hpp"
#include "report/output_file.hpp"

namespace thermocomp::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string text_of_model(const fs::path& path) {
  return read_text_file(path, model_bytes_max);
}

/// @return the candidate's file. @throws Failure: none runs
fs::path candidate_in(const json& status) {
  if (!status.contains("candidate"))
    throw Failure(
        "no candidate runs beside the model: thermocomp candidate FILE, or [model] candidate in "
        "the configuration and thermocomp reload");
  const json& candidate = status["candidate"];
  const std::string problem = text_of(candidate, "problem");
  if (!problem.empty()) throw Failure("the candidate does not run: " + problem);
  return text_of(candidate, "file");
}

int run_promote(const GlobalOptions& global, bool back) {
  const json status = ask_daemon(global.socket, "status", json::object());
  const fs::path model = text_of(status["model"], "file");
  const fs::path before = model.string() + ".before";
  if (back && !fs::exists(before)) throw Failure(before.string() + ": nothing was promoted");
  const std::string next = text_of_model(back ? before : candidate_in(status));
  const std::string now = text_of_model(model);
  // In this order the model that was in use first is in one of the files at any moment.
  if (!back) cli::write_file(before, now);
  cli::write_file(model, next);
  try {
    static_cast<void>(ask_daemon(global.socket, "reload", json::object()));
  } catch (...) {
    cli::write_file(model, now);
    throw;
  }
  if (back) cli::write_file(before, now);
  std::cout << model.string() << (back ? ": the model before runs again" : ": the candidate runs")
            << "; the other is kept as " << before.string()
            << ", and thermocomp promote --back exchanges them\n";
  return exit_success;
}

int run_candidate(const GlobalOptions& global, const std::string& file) {
  const bool is_none = file == "none";
  static_cast<void>(ask_daemon(global.socket, "candidate",
                               {{"file", is_none ? "" : fs::absolute(file).string()}}));
  if (is_none) {
    std::cout << "no candidate runs beside the model\n";
    return exit_success;
  }
  const json status = ask_daemon(global.socket, "status", json::object());
  if (!status.contains("candidate")) throw Failure(file + ": is the model in use itself");
  std::cout << candidate_in(status).string()
            << ": runs beside the model, and thermocomp status says how it does. To keep it over a "
               "restart: [model] candidate in the configuration\n";
  return exit_success;
}

}  // namespace

void add_candidate_command(CLI::App& app, const GlobalOptions& global, Action& action) {
  CLI::App* candidate = app.add_subcommand(
      "candidate", "a second model runs beside the one in use and is never sent");
  const auto file = std::make_shared<std::string>();
  candidate->add_option("FILE", *file, "model file that the daemon can read, or none")->required();
  candidate->callback([&global, &action, file] {
    action = [&global, file] { return run_candidate(global, *file); };
  });
}

void add_promote_command(CLI::App& app, const GlobalOptions& global, Action& action) {
  CLI::App* promote = app.add_subcommand(
      "promote", "makes the candidate the model in use and keeps the one before");
  const auto back = std::make_shared<bool>(false);
  promote->add_flag("--back", *back, "the model before the last promotion runs again");
  promote->callback([&global, &action, back] {
    action = [&global, back] { return run_promote(global, *back); };
  });
}

}  // namespace thermocomp::cli
