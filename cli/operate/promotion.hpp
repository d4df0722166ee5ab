/// Candidate model: starting, promotion and rollback.
#pragma once

#include <filesystem>
#include <string>

#include "estimator/types.hpp"

namespace thermocomp::cli {

/// @param file  absolute; empty: ends the candidate
/// @throws Failure if it does not run, or is the model in use
void start_candidate(const std::filesystem::path& socket, const std::filesystem::path& file);

struct Promotion {
  std::string model;                        ///< file of the model in use
  std::string before;                       ///< previous model, used by promote --back
  double better_probability{not_a_number};  ///< by the probings so far
};
/// Makes the candidate the model in use and keeps the previous one. If the reload is refused, the
/// model's file is restored.
/// @param checksum  required of the candidate; empty: any
/// @throws Failure
Promotion promote(const std::filesystem::path& socket, const std::string& checksum = "");
/// Exchanges the two again.
/// @param checksum  required of the model in use; empty: any
/// @throws Failure if nothing was promoted
Promotion take_back(const std::filesystem::path& socket, const std::string& checksum = "");

}  // namespace thermocomp::cli
