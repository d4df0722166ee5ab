/// The few explanations that are worth settling.
#pragma once

#include <vector>

#include "modelling/diagnosis/evidence/sensor_witness.hpp"

namespace thermocomp::diagnosis {

/// Explanations that the displacement cannot tell from each other, as the same jump of one sensor
/// or another: they have one shape and one score. One of them stands for all.
struct Place {
  Explanation first;
  std::vector<const Hypothesis*> twins{};  ///< the others' hypotheses
};

/// The best places of explanations that were weighed under the same settings, best first.
/// @param measured  outputs with values
[[nodiscard]] std::vector<Place> shortlist(std::vector<Explanation> weighed,
                                           const std::vector<std::size_t>& measured,
                                           std::size_t places);

/// The explanations of a place whose first one is settled. Where they are faults of sensors, these
/// are heard, and of twins those remain that the sensors support best.
[[nodiscard]] std::vector<Explanation> witnessed(const Place& place,
                                                 const std::vector<std::size_t>& measured,
                                                 SensorWitness& witness);

/// Whether both were made from one place, so that they leave the same.
[[nodiscard]] bool of_one_place(const Explanation& a, const Explanation& b,
                                const std::vector<std::size_t>& measured);

}  // namespace thermocomp::diagnosis
