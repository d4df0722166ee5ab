/// The one place where this project's text meets a terminal.
#pragma once

#include <string>
#include <string_view>

namespace thermocomp {

/// From here on everything that this process writes to standard output and standard error (by
/// printf, std::cout, std::cerr, a library or CLI11) goes through printable_text(): names from a
/// file, texts of another process and file names command no terminal. Lines and tabulators stay.
/// First in main(), once; for the rest of the process' life.
void clean_standard_output();

/// A command for the terminal that this project gives itself: "[32m" for ESC [32m. Between
/// clean_standard_output() and the terminal it is marked by a random number, so that no text can
/// pass for one.
[[nodiscard]] std::string terminal_code(std::string_view code);

}  // namespace thermocomp
