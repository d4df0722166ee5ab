/// Columns that recorded runs do not separate, and the shortest further run that does.
#pragma once

#include <string>
#include <vector>

#include "modelling/identification/measured_tests.hpp"

namespace thermocomp::experiments {

/// A column to move while others rest.
struct Move {
  std::string column;
  std::vector<std::string> rest;  ///< columns that moved alike, most similar first
  double correlation{0.0};        ///< with the first of these so far
  double swing{0.0};              ///< from rest up, and back [K, or the signal's unit]
  double hours{0.0};
  bool is_temperature{false};
};

struct Separation {
  std::vector<Move> moves;
  std::vector<std::string> unmoved;  ///< signals that no run moved up and down
  double recorded_h{0.0};
  [[nodiscard]] double hours() const noexcept;
};

/// Two columns count as inseparable above a correlation of 0.98, each about its mean in each run; a
/// further run separates them if it reduces the correlation over all runs to c = 0.9. With the sums
/// of squares S so far (unit^2 h), the largest recorded range A of the moved column within a run,
/// its largest recorded change v within an hour, and b at rest:
///
///     D = S_aa (r^2 / c^2 - 1)              additional sum of squares of a
///     a signal, half of the time up         t = 4 D / A^2
///     a temperature, up and down at v       t = (48 D / v^2)^(1/3)   while v t / 2 <= A,
///                                           t = 12 D / A^2           else: several times
///
/// Of a pair the column that needs less time moves; of a group all but one move.
[[nodiscard]] Separation separation(const identification::MeasuredTests& tests);

[[nodiscard]] std::string separation_text(const Separation& separation);
[[nodiscard]] std::string separation_json(const Separation& separation);

}  // namespace thermocomp::experiments
