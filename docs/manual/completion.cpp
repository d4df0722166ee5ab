#include <algorithm>
#include <vector>

#include <CLI/CLI.hpp>

#include "docs/manual/pages.hpp"

namespace thermocomp::manual {
namespace {

std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  return names;
}

bool takes_file(const CLI::Option& option) {
  return option.get_type_name().find("FILE") != std::string::npos;
}

std::string joined(const std::vector<std::string>& words, const char* between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

/// Options of one App, those with a file and those with another value.
struct Words {
  std::vector<std::string> options;
  std::vector<std::string> with_file;
  std::vector<std::string> with_value;
  bool files{false};  ///< a positional argument is a file
};

Words words_of(const CLI::App& app) {
  Words words;
  // The other program's own options are unknown here.
  words.files = app.get_prefix_command();
  for (const CLI::Option* option : app.get_options()) {
    if (!option->nonpositional()) {
      words.files = words.files || takes_file(*option);
      continue;
    }
    const auto names = names_of(*option);
    words.options.insert(words.options.end(), names.begin(), names.end());
    if (option->get_items_expected_max() == 0) continue;
    auto& list = takes_file(*option) ? words.with_file : words.with_value;
    list.insert(list.end(), names.begin(), names.end());
  }
  return words;
}

/// The lines of a branch: what is offered for `word` after `previous`.
std::string offers(const Words& words, const std::string& commands) {
  std::string text;
  if (!words.with_file.empty() || !words.with_value.empty()) {
    text += "      case $previous in\n";
    if (!words.with_file.empty())
      text += "        " + joined(words.with_file, " | ") + ") files=yes ;;\n";
    if (!words.with_value.empty()) text += "        " + joined(words.with_value, " | ") + ") ;;\n";
    text += "        *)\n";
  } else {
    text += "      case - in\n        *)\n";
  }
  text += "          options='" + joined(words.options, " ") + "'\n";
  if (!commands.empty()) text += "          commands='" + commands + "'\n";
  if (words.files) text += "          files=yes\n";
  return text + "          ;;\n      esac\n";
}

}  // namespace

std::string bash_completion(const CLI::App& app) {
  const auto subcommands = app.get_subcommands([](const CLI::App*) { return true; });
  std::vector<std::string> names;
  names.reserve(subcommands.size());
  for (const CLI::App* command : subcommands) names.push_back(command->get_name());
  const Words global = words_of(app);
  std::vector<std::string> skipped = global.with_file;
  skipped.insert(skipped.end(), global.with_value.begin(), global.with_value.end());

  std::string function = "_" + app.get_name();
  std::replace(function.begin(), function.end(), '-', '_');
  std::string text = "# bash completion for " + app.get_name() + R"(; made from its command line
)" + function + R"(() {
  local word=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}
  local options='' commands='' files='' command='' i
  # bash takes --option=value apart at the sign
  if [[ $word == = ]]; then
    word=''
  elif [[ $previous == = ]] && ((COMP_CWORD >= 2)); then
    previous=${COMP_WORDS[COMP_CWORD - 2]}
  fi
)";
  if (!names.empty()) {
    text += "  for ((i = 1; i < COMP_CWORD; i++)); do\n    case ${COMP_WORDS[i]} in\n";
    if (!skipped.empty()) {
      text +=
          "      " + joined(skipped, " | ") +
          ")\n        [[ ${COMP_WORDS[i + 1]} == = ]] && ((i++))\n        ((i++))\n        ;;\n";
    }
    text +=
        "      -* | =) ;;\n      *)\n        command=${COMP_WORDS[i]}\n        break\n"
        "        ;;\n    esac\n  done\n";
  }
  text += "  case $command in\n    '')\n" + offers(global, joined(names, " ")) + "      ;;\n";
  for (const CLI::App* command : subcommands)
    text += "    " + command->get_name() + ")\n" + offers(words_of(*command), "") + "      ;;\n";
  text += R"(  esac
  COMPREPLY=()
  if [[ $word == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$word")
  else
    [[ -n $commands ]] && mapfile -t COMPREPLY < <(compgen -W "$commands" -- "$word")
    if [[ -n $files ]]; then
      compopt -o filenames 2>/dev/null
      mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -f -- "$word")
    fi
  fi
}
complete -F )";
  return text + function + " " + app.get_name() + '\n';
}

}  // namespace thermocomp::manual
