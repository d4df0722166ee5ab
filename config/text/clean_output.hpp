/// Cleaning of terminal output.
#pragma once

#include <string>
#include <string_view>

namespace thermocomp {

/// Sends all further output to stdout and stderr (by printf, std::cout, std::cerr, a library or
/// CLI11) through printable_text(), so that names from files and texts of other processes cannot
/// send control codes to the terminal. Line ends and tabulators stay. Call once, first in main().
void clean_standard_output();

/// A terminal code of our own: "[32m" for ESC [32m. Until it reaches the terminal it is marked by a
/// random number, so that other text cannot imitate one.
[[nodiscard]] std::string terminal_code(std::string_view code);

}  // namespace thermocomp
