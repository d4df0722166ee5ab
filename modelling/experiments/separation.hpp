/// What recorded runs cannot tell apart, and the shortest further run that does.
#pragma once

#include <string>
#include <vector>

#include "modelling/identification/measured_tests.hpp"

namespace thermocomp::experiments {

/// One column that is to move while others rest.
struct Move {
  std::string column;
  std::vector<std::string> rest;  ///< that moved as it did, most alike first
  double correlation{0.0};        ///< with the first of them so far
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

/// Two columns are not told apart above a correlation of 0.98, each about its mean in each run; a
/// run tells them apart that takes the correlation of all runs down to c = 0.9. With the sums of
/// squares S so far (unit^2 h), A the largest range of the moved column within a run and v the
/// largest change within an hour, both as recorded, and b at rest:
///
///     D = S_aa (r^2 / c^2 - 1)              what a must add by itself
///     a signal, half of the time up         t = 4 D / A^2
///     a temperature, up and down at v       t = (48 D / v^2)^(1/3)   while v t / 2 <= A,
///                                           t = 12 D / A^2           else: several times
///
/// Of a pair the one moves that needs less time; of a group all move but one.
[[nodiscard]] Separation separation(const identification::MeasuredTests& tests);

[[nodiscard]] std::string separation_text(const Separation& separation);
[[nodiscard]] std::string separation_json(const Separation& separation);

}  // namespace thermocomp::experiments
