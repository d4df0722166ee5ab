/// Hypotheses of what is wrong in a thermal network: a change of it, or the fault of a reading.
#pragma once

#include <functional>
#include <string>

#include "modelling/diagnosis/hypothesis/hypothesis.hpp"
#include "modelling/diagnosis/network/heat_network.hpp"
#include "modelling/diagnosis/network/network_simulation.hpp"

namespace thermocomp::diagnosis {

/// What causes of a network are made of; all three outlive the hypotheses.
struct NetworkMaterial {
  const ThermalPlant& plant;
  const ThermalRuns& runs;
  const StackedRows& rows;
};

enum class NetworkSubjectKind {
  part,             ///< of ThermalPlant::parts
  source,           ///< of the network's
  signal_at_place,  ///< a place, and a signal as `second`
  room,
  air_of_part,    ///< the air around a part that has a film
  sensor,         ///< of the network's
  sensor_in_run,  ///< and the run as `second`
};

/// One thing of a network that a cause may act on.
struct NetworkSubject {
  NetworkSubjectKind kind{NetworkSubjectKind::part};
  std::size_t index{0};
  std::size_t second{0};
};

struct NetworkHypothesis {
  Hypothesis hypothesis{};  ///< without columns: they depend on what else was found
  /// Changes the network; a gain of 0 changes nothing. Empty: a fault of a reading.
  std::function<void(HeatNetwork&, const Shape&, double gain)> apply{};
  std::function<Column(const Shape&)> fault{};  ///< its column, where nothing is simulated
  double value{0.0};                            ///< of the file, that a factor multiplies
  std::string key{};                            ///< of the file, for this value
  double at{0.0};                               ///< signal at which a missing source has its heat
};

}  // namespace thermocomp::diagnosis
