/// Comparison of all methods of sensor placement.
#pragma once

#include <string>
#include <vector>

#include "modelling/placement/sensor_choice.hpp"
#include "modelling/placement/tendency_method.hpp"

namespace thermocomp::placement {

struct MethodResult {
  std::string name;            ///< "greedy"
  std::vector<Index> sensors;  ///< one node per block; empty for a method without blocks
  ErrorFigures used;
  ErrorFigures left_out;
  std::vector<ErrorFigures> by_case;  ///< shape (load cases)
};

struct Comparison {
  MethodResult uncompensated;
  std::vector<MethodResult> methods;
  std::vector<TendencyPlacement> ways;  ///< in the order of all_ways
  std::size_t best_way{0};              ///< smallest RMS over the used load cases
  GreedyPlacement greedy;

  [[nodiscard]] const MethodResult& method(std::string_view name) const;
  /// The method with one sensor per block and the smallest RMS over the left-out, else used, cases.
  [[nodiscard]] const MethodResult& best(const PlacementProblem& problem) const;
};

inline constexpr int random_draws = 100;

/// @param options  of the method of tendency patterns
/// @param progress  called with the name of each method
[[nodiscard]] Comparison compare_placements(const PlacementProblem& problem,
                                            const TendencyOptions& options,
                                            const structure::Progress& progress);

/// "They leave 2.35 um RMS ...", for the best sensors.
[[nodiscard]] std::string remaining_text(const PlacementProblem& problem,
                                         const Comparison& comparison);
/// Text with the best sensors and their remaining error.
[[nodiscard]] std::string recommendation_text(const PlacementProblem& problem,
                                              const Comparison& comparison);
/// Text with every method and the course of the patterns.
[[nodiscard]] std::string comparison_text(const PlacementProblem& problem,
                                          const Comparison& comparison);
/// JSON of the same figures.
[[nodiscard]] std::string comparison_json(const PlacementProblem& problem,
                                          const Comparison& comparison);

}  // namespace thermocomp::placement
