/// Hypotheses for a thermal network, and the readings that each would explain.
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/rank/search.hpp"

namespace thermocomp::diagnosis {

/// The column of a cause is the difference of the readings of the changed and of the unchanged
/// network, both with the causes accepted before it.
class NetworkHypotheses {
 public:
  /// @param rows  of the training runs. All three outlive this.
  NetworkHypotheses(const ThermalPlant& plant, const ThermalRuns& runs, const StackedRows& rows);

  /// The hypotheses keep `self` alive.
  [[nodiscard]] static std::vector<Hypothesis> all(const std::shared_ptr<NetworkHypotheses>& self);
  void accept(const std::vector<Explanation>& found);
  /// Applies a finding to the network.
  void apply(const Finding& finding, HeatNetwork& network) const;
  [[nodiscard]] std::vector<Parameter> parameters_of(const Finding& finding) const;

 private:
  struct Base {
    NetworkSimulation simulation;
    std::vector<Column> stacked;  ///< readings, one column per sensor
  };
  struct Known {
    std::size_t cause{0};
    std::size_t base{0};
    Shape shape;
    std::vector<Column> columns;
  };

  void add(const NetworkSubject& subject);
  [[nodiscard]] Column columns(std::size_t cause, const Shape& shape, std::size_t output);
  [[nodiscard]] std::vector<Column> stacked(const NetworkSimulation& simulation) const;
  [[nodiscard]] std::size_t cause_of(const Hypothesis& hypothesis) const;

  const NetworkMaterial material_;
  std::vector<NetworkHypothesis> causes_;
  std::vector<std::size_t> accepted_;  ///< causes, in their order
  std::vector<Base> bases_;            ///< before each accepted cause; the last: with all
  std::deque<Known> known_;            ///< cache of the newest columns, for several outputs
};

}  // namespace thermocomp::diagnosis
