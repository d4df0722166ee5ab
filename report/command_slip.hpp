/// What a program with commands says of a command line that it cannot take.
#pragma once

#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
class Error;
}  // namespace CLI

namespace thermocomp::cli {

/// A word that should have been a command, of the program or of a group of commands: by that word
/// and the command that was probably meant. None at all: by those that there are. Anything else as
/// CLI11 says it.
/// For CLI::App::failure_message().
[[nodiscard]] std::string command_slip_text(const CLI::App* app, const CLI::Error& error);

}  // namespace thermocomp::cli
