/// The file of `thermocomp tiebar`: a gate-shaped machine with one tie or several, where their
/// temperatures stand in a run, and how far they may be moved.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/text/problems.hpp"
#include "modelling/identification/gate/tied_columns.hpp"

namespace thermocomp::identification {

/// What a tie may be; low = high: it stays as drawn.
struct Bounds {
  double low{0.0};
  double high{0.0};
};

struct TieChoice {
  std::vector<std::string> temperatures;  ///< columns of a run; their mean counts
  double rise_factor{1.0};                ///< the tie's rise beside that of these columns
  Bounds height_mm;
  Bounds area_mm2;
};

struct GateFile {
  std::string name;
  TiedColumns columns;
  std::vector<std::string> side_a;  ///< columns of a run; their mean counts
  std::vector<std::string> side_b;
  std::vector<TieChoice> choices;  ///< one a tie
};

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] GateFile load_gate_file(const std::filesystem::path& path);
/// @param name stands for the file in problems
[[nodiscard]] GateFile parse_gate_file(const std::string& text, const std::string& name);

}  // namespace thermocomp::identification
