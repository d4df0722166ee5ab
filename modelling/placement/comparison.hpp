/// All methods of placing sensors beside each other.
#pragma once

#include <string>
#include <vector>

#include "modelling/placement/sensor_choice.hpp"
#include "modelling/placement/tendency_method.hpp"

namespace thermocomp::placement {

struct MethodResult {
  std::string name;            ///< "greedy"
  std::vector<Index> sensors;  ///< one node per block; empty for a method of another kind
  ErrorFigures used;
  ErrorFigures left_out;
  std::vector<ErrorFigures> by_case;  ///< shape (load cases)
};

struct Comparison {
  MethodResult uncompensated;
  std::vector<MethodResult> methods;
  std::vector<TendencyPlacement> ways;  ///< one per way, in the order of all_ways
  std::size_t best_way{0};              ///< least RMS over the used load cases
  GreedyPlacement greedy;

  [[nodiscard]] const MethodResult& method(std::string_view name) const;
  /// Of the methods with one sensor in each block the one with the least RMS over the load cases
  /// that are left out, or over those used where none is.
  [[nodiscard]] const MethodResult& best(const PlacementProblem& problem) const;
};

inline constexpr int random_draws = 100;

/// @param options  for the method of tendency patterns
/// @param progress  told which method begins
[[nodiscard]] Comparison compare_placements(const PlacementProblem& problem,
                                            const TendencyOptions& options,
                                            const structure::Progress& progress);

/// "They leave 2.35 um RMS ...": of the best sensors.
[[nodiscard]] std::string remaining_text(const PlacementProblem& problem,
                                         const Comparison& comparison);
/// For a person: the best sensors, and what they leave.
[[nodiscard]] std::string recommendation_text(const PlacementProblem& problem,
                                              const Comparison& comparison);
/// For a person: every method, and how the patterns went.
[[nodiscard]] std::string comparison_text(const PlacementProblem& problem,
                                          const Comparison& comparison);
/// For a program; docs/placement.md describes it.
[[nodiscard]] std::string comparison_json(const PlacementProblem& problem,
                                          const Comparison& comparison);

}  // namespace thermocomp::placement
