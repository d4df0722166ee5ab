/// The files that a configuration names: none that the daemon writes may be another of them, by
/// whatever path or link.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/toml/toml_reader.hpp"

namespace thermocomp {

enum class FileUse {
  read,
  written,  ///< a regular file, or none yet
  socket    ///< a socket, or none yet
};

struct NamedFile {
  TomlTable table;
  std::string key;  ///< of `table`: where the file is named. Empty: it is the configuration itself
  std::filesystem::path path;
  FileUse use{FileUse::read};
  /// Further files that are made beside it, by what is added to its name.
  std::vector<std::string> endings{};
};

/// What is wrong becomes a problem of the key: links that lead only to themselves, what is not a
/// regular file, and every pair of names of one file that is written under at least one of them.
/// Paths are compared with all links followed, files that exist by device and inode too.
void check_named_files(const std::vector<NamedFile>& files);

}  // namespace thermocomp
