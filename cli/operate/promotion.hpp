/// A second model beside the one in use, its promotion, and the way back.
#pragma once

#include <filesystem>
#include <string>

namespace thermocomp::cli {

/// @param file  absolute; empty: none runs any more
/// @throws Failure: it does not run, or is the model in use itself
void run_beside(const std::filesystem::path& socket, const std::filesystem::path& file);

struct Promotion {
  std::string model;   ///< file of the model in use
  std::string before;  ///< that of the one before, as text for promote --back
};
/// Makes the candidate the model in use and keeps the one before. A refused reload puts the file of
/// the model back.
/// @param checksum  that the candidate must have; empty: any
/// @throws Failure
Promotion promote(const std::filesystem::path& socket, const std::string& checksum = "");
/// Exchanges the two again. @throws Failure: nothing was promoted
/// @param checksum  that the model in use must have; empty: any
Promotion take_back(const std::filesystem::path& socket, const std::string& checksum = "");

}  // namespace thermocomp::cli
