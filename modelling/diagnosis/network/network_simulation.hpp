/// Sensor temperatures that a thermal network predicts for a measured run.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/network/heat_network.hpp"

namespace thermocomp::diagnosis {

/// Inputs of the network and readings over one run. Missing values of signals, room and coolant
/// hold the last one.
struct ThermalRun {
  std::string name;  ///< the argument as given
  Column time_s;
  Eigen::Index begin{0};  ///< first selected row; the simulation starts at row 0
  Column room_degC;
  Column coolant_degC;
  Column coolant_flows;               ///< 0 or 1
  std::vector<Column> signals;        ///< order of ThermalRuns::signals
  std::vector<Column> measured_degC;  ///< order of the network's sensors; NaN: missing
  [[nodiscard]] Eigen::Index rows() const { return time_s.size(); }
};

struct ThermalRuns {
  std::vector<std::string> signals;  ///< operating signals that all runs have
  std::vector<ThermalRun> runs;
};

/// @throws ConfigurationError when a run lacks the room, a signal of the network or every sensor
[[nodiscard]] ThermalRuns thermal_runs(const ThermalPlant& plant, const std::vector<RunFile>& files,
                                       const std::vector<std::string>& signals);

/// Operating signals (no positions) in every file.
[[nodiscard]] std::vector<std::string> shared_signals(const std::vector<RunFile>& files);

/// Simulation of a network, whose modes are computed once.
class NetworkSimulation {
 public:
  /// @param like  a network whose modes are reused if its matrices are the same
  explicit NetworkSimulation(const HeatNetwork& network, const NetworkSimulation* like = nullptr);

  /// Readings of the sensors, shape (sensors)(rows). Between two rows signals, room and coolant are
  /// the mean of both; the solution within a step is exact. The initial field agrees with the first
  /// readings and is otherwise in balance with room and constant sources:
  ///
  ///   x_0 = argmin x'Kx / 2 - q'x  with  row_s . x = reading_s of every sensor
  [[nodiscard]] std::vector<Column> readings_degC(const ThermalRuns& runs, std::size_t run) const;
  /// x of every row, shape (states)(rows).
  [[nodiscard]] Eigen::MatrixXd states(const ThermalRuns& runs, std::size_t run) const;
  [[nodiscard]] const HeatNetwork& network() const noexcept { return network_; }

 private:
  struct Modes;

  /// The states, each row in its modes_of().
  [[nodiscard]] Eigen::MatrixXd modal_states(const ThermalRuns& runs, const ThermalRun& run) const;
  [[nodiscard]] const Modes& modes_of(const ThermalRun& run, Eigen::Index row) const;

  HeatNetwork network_;
  std::shared_ptr<const Modes> dry_;
  std::shared_ptr<const Modes> flooded_;
};

}  // namespace thermocomp::diagnosis
