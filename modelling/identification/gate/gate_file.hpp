/// Geometry file of `thermocomp tiebar`: a gate-shaped machine with one or more ties, the run
/// columns of its temperatures, and the ranges of the ties.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/text/problems.hpp"
#include "modelling/identification/gate/tied_columns.hpp"

namespace thermocomp::identification {

/// Range of a tie's height or area; low = high: fixed.
struct Bounds {
  double low{0.0};
  double high{0.0};
};

struct TieChoice {
  std::vector<std::string> temperatures;  ///< columns of a run, averaged
  double rise_factor{1.0};                ///< the tie's rise relative to the mean of these columns
  Bounds height_mm;
  Bounds area_mm2;
};

struct GateFile {
  std::string name;
  TiedColumns columns;
  std::vector<std::string> side_a;  ///< columns of a run, averaged
  std::vector<std::string> side_b;
  std::vector<TieChoice> choices;  ///< one per tie
};

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] GateFile load_gate_file(const std::filesystem::path& path);
/// @param name  file name in problems
[[nodiscard]] GateFile parse_gate_file(const std::string& text, const std::string& name);

}  // namespace thermocomp::identification
