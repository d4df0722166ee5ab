/// How large a file that somebody wrote may be; it is refused before it is read.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace thermocomp {

inline constexpr std::uintmax_t bytes_per_MB = std::uintmax_t{1024} * 1024;
/// A configuration, a preset, what describes a machine, a structure, factors.
inline constexpr std::uintmax_t file_bytes_max = 4 * bytes_per_MB;
/// Models; tables of messages and objects (DBC, EDS), which others wrote.
inline constexpr std::uintmax_t model_bytes_max = 16 * bytes_per_MB;
inline constexpr std::uintmax_t bus_table_bytes_max = 16 * bytes_per_MB;
/// Run files.
inline constexpr std::uintmax_t run_bytes_max = 64 * bytes_per_MB;

/// The text of a regular file. @throws ConfigurationError
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path,
                                         std::uintmax_t bytes_max);

}  // namespace thermocomp
