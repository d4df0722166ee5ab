#include "docs/manual/command_page.hpp"

#include <algorithm>
#include <sstream>

#include <CLI/CLI.hpp>

#include "docs/manual/roff.hpp"

namespace thermocomp::manual {
namespace {

constexpr std::string_view status_mark = "Exit status: ";

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

/// A command that does something, by the words that lead to it: "export", "history check".
struct NamedCommand {
  std::string name;
  const CLI::App* app;
  std::string group;
};

std::vector<NamedCommand> whole_commands_of(const CLI::App& app) {
  std::vector<NamedCommand> commands;
  for (const CLI::App* command : commands_of(app)) {
    const auto within = commands_of(*command);
    if (within.empty()) commands.push_back({command->get_name(), command, command->get_group()});
    for (const CLI::App* part : within) {
      commands.push_back(
          {command->get_name() + " " + part->get_name(), part, command->get_group()});
    }
  }
  return commands;
}

bool takes_value(const CLI::Option& option) {
  return option.get_items_expected_max() > 0;
}

/// CONFIG, [INPUT], [INPUT...]
std::string positional_text(const CLI::Option& option) {
  std::string text = italic(option.get_name(true, false));
  if (option.get_expected_max() > 1) text += "...";
  return option.get_required() ? text : "[" + text + "]";
}

/// -o, --output FILE
std::string option_text(const CLI::Option& option) {
  std::string text;
  for (const std::string& name : option.get_snames())
    text += (text.empty() ? "" : ", ") + bold("-" + name);
  for (const std::string& name : option.get_lnames())
    text += (text.empty() ? "" : ", ") + bold("--" + name);
  if (takes_value(option)) text += " " + italic(option.get_type_name());
  return text;
}

std::string options_list(const CLI::App& app) {
  std::string text;
  for (const CLI::Option* option : app.get_options()) {
    text += ".TP\n";
    text += option->nonpositional() ? option_text(*option) : italic(option->get_name(true, false));
    text += '\n' + escaped(option->get_description());
    if (!option->get_default_str().empty() && option->get_default_str() != "false")
      text += "; default " + escaped(option->get_default_str());
    text += '\n';
  }
  return text;
}

/// What is required by name, and what stands in its place.
std::string usage(const CLI::App& app) {
  std::string text;
  std::string places;
  bool optional = false;
  for (const CLI::Option* option : app.get_options()) {
    if (!option->nonpositional())
      places += " " + positional_text(*option);
    else if (option->get_required())
      text += " " + option_text(*option);
    else
      optional = true;
  }
  if (app.get_prefix_command()) places += " ...";
  return (optional ? " [" + italic("options") + "]" : "") + text + places;
}

std::string synopsis(const CLI::App& app) {
  const auto commands = whole_commands_of(app);
  std::string text = ".SH SYNOPSIS\n";
  if (commands.empty()) return text + bold(app.get_name()) + usage(app) + '\n';
  text += bold(app.get_name()) + usage(app) + " " + italic("command") + " ...\n";
  for (const auto& [name, command, group] : commands)
    text += ".br\n" + bold(app.get_name()) + " " + bold(name) + usage(*command) + '\n';
  return text;
}

std::string commands_section(const CLI::App& app) {
  std::string text;
  std::string group;
  for (const auto& [name, command, its_group] : whole_commands_of(app)) {
    if (its_group != group) {
      group = its_group;
      std::string title = group == "Subcommands" ? "COMMANDS" : group;
      text += ".SH " + escaped(title) + '\n';
    }
    text += ".SS " + bold(name) + usage(*command) + '\n';
    text += escaped(command->get_description()) + ".\n" + options_list(*command);
    if (command->get_footer() != app.get_footer())
      text += ".PP\n" + paragraphs(command->get_footer());
  }
  return text;
}

/// "0 success, 1 no, 2 bad use" as a list.
std::string status_section(std::string_view line) {
  std::string text = ".SH EXIT STATUS\n";
  line.remove_prefix(status_mark.size());
  if (line.ends_with('.')) line.remove_suffix(1);
  std::string item;
  const auto end_item = [&] {
    if (item.empty()) return;
    text += ".TP\n" + bold(item.substr(0, 1)) + '\n' + escaped(item.substr(2)) + '\n';
    item.clear();
  };
  std::istringstream parts{std::string(line)};
  for (std::string part; std::getline(parts, part, ',');) {
    part.erase(0, part.find_first_not_of(' '));
    // A comma within an item stays: only "number blank" begins the next one.
    if (part.size() > 2 && std::isdigit(static_cast<unsigned char>(part[0])) != 0 && part[1] == ' ')
      end_item();
    item += (item.empty() ? "" : ", ") + part;
  }
  end_item();
  return text;
}

std::string pair_list(const char* title,
                      const std::vector<std::pair<std::string, std::string>>& pairs,
                      std::string (*show)(std::string_view)) {
  if (pairs.empty()) return {};
  std::string text = std::string(".SH ") + title + '\n';
  for (const auto& [name, what] : pairs) text += ".TP\n" + show(name) + '\n' + escaped(what) + '\n';
  return text;
}

}  // namespace

std::string command_page(const CLI::App& app, const PageExtras& extras) {
  std::string notes;
  std::string status;
  std::istringstream footer(app.get_footer());
  for (std::string line; std::getline(footer, line);) {
    if (line.starts_with(status_mark))
      status = line;
    else
      notes += line + '\n';
  }
  std::string text = page_head(app.get_name(), extras.section,
                               extras.section == 8 ? "System administration" : "User commands",
                               app.get_description());
  text += synopsis(app);
  text += ".SH DESCRIPTION\n" + escaped(app.get_description()) + ".\n";
  if (notes.find_first_not_of('\n') != std::string::npos) text += ".PP\n" + paragraphs(notes);
  text += ".SH OPTIONS\n" + options_list(app) + commands_section(app);
  if (!status.empty()) text += status_section(status);
  text += pair_list("ENVIRONMENT", extras.environment, bold);
  text += pair_list("FILES", extras.files, italic);
  return text + see_also(extras.see_also);
}

}  // namespace thermocomp::manual
