/// Hypotheses of what is wrong in a thermal network, and the readings that each would explain.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "modelling/diagnosis/answer.hpp"
#include "modelling/diagnosis/hypothesis.hpp"
#include "modelling/diagnosis/thermal/network_simulation.hpp"

namespace thermocomp::diagnosis {

/// A cause's column is what the changed network says less what the unchanged one does, the causes
/// that were accepted before it already in both.
class NetworkHypotheses {
 public:
  /// @param rows  of the training runs. All three outlive this.
  NetworkHypotheses(const ThermalPlant& plant, const ThermalRuns& runs, const StackedRows& rows);

  /// The hypotheses keep `self` alive.
  [[nodiscard]] static std::vector<Hypothesis> all(const std::shared_ptr<NetworkHypotheses>& self);
  void accept(const std::vector<Explanation>& found);
  /// Makes the change that a finding stands for.
  void apply(const Finding& finding, HeatNetwork& network) const;
  [[nodiscard]] std::vector<Parameter> parameters_of(const Finding& finding) const;

 private:
  using Shape = std::vector<double>;
  struct Cause {
    Hypothesis hypothesis{};
    /// Changes the network; a gain of 0 changes nothing. Empty: a fault of a reading.
    std::function<void(HeatNetwork&, const Shape&, double gain)> apply{};
    std::function<Column(const Shape&)> fault{};  ///< its column, where nothing is simulated
    double value{0.0};                            ///< of the file, that a factor multiplies
    std::string key{};
    double at{0.0};  ///< signal at which a missing source has its heat
  };
  struct Base {
    NetworkSimulation simulation;
    std::vector<Column> stacked;  ///< readings, one column a sensor
  };
  struct Known {
    std::size_t cause{0};
    std::size_t base{0};
    Shape shape;
    std::vector<Column> columns;
  };

  void add_part(const NetworkPart& part);
  void add_source(std::size_t source);
  void add_missing(const NetworkPlace& place, std::size_t signal);
  void add_ambient(const std::string& subject, const Eigen::VectorXd& inflow);
  void add_slow_sensor(std::size_t sensor);
  void add_faults(std::size_t run, std::size_t sensor);
  [[nodiscard]] Eigen::MatrixXd columns(std::size_t cause, const Shape& shape, std::size_t output);
  [[nodiscard]] std::vector<Column> stacked(const NetworkSimulation& simulation) const;
  [[nodiscard]] std::size_t cause_of(const Hypothesis& hypothesis) const;
  [[nodiscard]] double largest(std::size_t signal) const;

  const ThermalPlant& plant_;
  const ThermalRuns& runs_;
  const StackedRows& rows_;
  std::vector<Cause> causes_;
  std::vector<std::size_t> accepted_;  ///< causes, in their order
  std::vector<Base> bases_;            ///< before each accepted one; the last: with all of them
  std::deque<Known> known_;            ///< the newest columns: several outputs ask for the same
};

}  // namespace thermocomp::diagnosis
