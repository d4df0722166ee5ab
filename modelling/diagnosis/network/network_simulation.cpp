#include "modelling/diagnosis/network/network_simulation.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "config/runs/model_inputs.hpp"
#include "config/text/units.hpp"
#include "estimator/checks.hpp"

namespace thermocomp::diagnosis {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// Number of rows averaged for the first readings: one reading may be off by a step of its
/// converter.
constexpr Eigen::Index start_rows = 5;
constexpr double start_s = 300.0;
/// Compliance that lets two sensors at one place differ.
constexpr double sensor_give = 1e-6;
constexpr double slowest_per_s = 1e-9;

/// The column up to the selection's end, with missing values held.
Column held(const RunFile& file, const std::string& column) {
  const std::vector<double>& values = file.column(column);
  double last = first_value(values).value_or(not_a_number);
  if (!std::isfinite(last))
    throw ConfigurationError({{file.name, 0, column, "(missing)", "must have a value"}});
  Column result(static_cast<Eigen::Index>(file.selected_end));
  for (std::size_t row = 0; row < file.selected_end; ++row) {
    if (std::isfinite(values[row])) last = values[row];
    result[static_cast<Eigen::Index>(row)] = last;
  }
  return result;
}

/// Room, coolant and the sources' shares in each row, shape (2 + sources, rows).
Matrix drives(const HeatNetwork& network, const ThermalRuns& runs, const ThermalRun& run) {
  Matrix all(2 + static_cast<Eigen::Index>(network.sources.size()), run.rows());
  all.row(0) = run.room_degC;
  all.row(1) = run.coolant_degC;
  for (std::size_t i = 0; i < network.sources.size(); ++i) {
    const NetworkSource& source = network.sources[i];
    const auto row = 2 + static_cast<Eigen::Index>(i);
    if (source.signal.empty()) {
      all.row(row).setOnes();
      continue;
    }
    const auto at = std::find(runs.signals.begin(), runs.signals.end(), source.signal);
    THERMOCOMP_ENSURE(at != runs.signals.end());
    const Column& signal = run.signals[static_cast<std::size_t>(at - runs.signals.begin())];
    all.row(row) = (signal.array().abs() / source.at).pow(source.exponent);
  }
  return all;
}

/// Mean of a sensor's first readings; NaN without readings.
double start_degC(const ThermalRun& run, std::size_t sensor) {
  double sum = 0.0;
  double count = 0.0;
  for (Eigen::Index row = 0; row < std::min(start_rows, run.rows()); ++row) {
    const double value = run.measured_degC[sensor][row];
    if (!std::isfinite(value) || run.time_s[row] - run.time_s[0] > start_s) continue;
    sum += value;
    count += 1.0;
  }
  return count > 0 ? sum / count : not_a_number;
}

Vector start_state(const HeatNetwork& network, const ThermalRun& run) {
  const bool flows = run.coolant_flows[0] > 0.0;
  Matrix stiff = network.conductance + slowest_per_s * network.capacity;
  Vector inflow = network.room_inflow * run.room_degC[0];
  if (flows) {
    stiff += network.coolant_conductance;
    inflow += network.coolant_inflow * run.coolant_degC[0];
  }
  for (const NetworkSource& source : network.sources)
    if (source.signal.empty()) inflow += source.heat_W * source.inflow;
  std::vector<std::size_t> read;
  for (std::size_t i = 0; i < network.sensors.size(); ++i)
    if (std::isfinite(start_degC(run, i))) read.push_back(i);
  const auto count = static_cast<Eigen::Index>(read.size());
  Matrix rows(count, inflow.size());
  Vector readings(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const std::size_t sensor = read[static_cast<std::size_t>(i)];
    rows.row(i) = network.sensors[sensor].row;
    readings[i] = start_degC(run, sensor);
  }
  const Eigen::LDLT<Matrix> factor(stiff);
  Vector balance = factor.solve(inflow);
  if (count == 0) return balance;
  const Matrix answer = factor.solve(rows.transpose());
  Matrix give = rows * answer;
  give.diagonal().array() += sensor_give * give.trace() / static_cast<double>(count);
  return balance + answer * give.ldlt().solve(readings - rows * balance);
}

/// First-order lag behind values that are linear between the rows.
void lag(const Column& time_s, double lag_s, Column& values) {
  if (!(lag_s > 0.0)) return;
  double state = values[0];
  double before = values[0];
  for (Eigen::Index row = 1; row < values.size(); ++row) {
    const double x = (time_s[row] - time_s[row - 1]) / lag_s;
    const double slope = (values[row] - before) / x;
    state = values[row] - slope + std::exp(-x) * (state - before + slope);
    before = values[row];
    values[row] = state;
  }
}

/// Flow of room, coolant and sources into each state, by column.
Matrix inflows(const HeatNetwork& network, bool flows) {
  Matrix inflow =
      Matrix::Zero(network.capacity.rows(), 2 + static_cast<Eigen::Index>(network.sources.size()));
  inflow.col(0) = network.room_inflow;
  if (flows) inflow.col(1) = network.coolant_inflow;
  for (std::size_t i = 0; i < network.sources.size(); ++i)
    inflow.col(2 + static_cast<Eigen::Index>(i)) =
        network.sources[i].heat_W * network.sources[i].inflow;
  return inflow;
}

}  // namespace

/// The modes of C^-1/2 K C^-1/2, for one state of the coolant.
struct NetworkSimulation::Modes {
  Vector rate_per_s;
  Matrix to_modes;
  Matrix from_modes;
  Matrix into_modes;  ///< from heat to the modes

  Modes(const Matrix& capacity, const Matrix& conductance) {
    const Eigen::LLT<Matrix> root(capacity);
    THERMOCOMP_ENSURE(root.info() == Eigen::Success);
    Matrix rates = root.matrixL().solve(conductance);
    rates = root.matrixL().solve(Matrix(rates.transpose()));
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(0.5 * (rates + rates.transpose()));
    THERMOCOMP_ENSURE(solver.info() == Eigen::Success);
    rate_per_s = solver.eigenvalues().cwiseMax(slowest_per_s);
    from_modes = root.matrixU().solve(solver.eigenvectors());
    to_modes = solver.eigenvectors().transpose() * Matrix(root.matrixL()).transpose();
    into_modes = from_modes.transpose();
  }
};

NetworkSimulation::NetworkSimulation(const HeatNetwork& network, const NetworkSimulation* like)
    : network_(network) {
  if (like != nullptr && like->network_.capacity == network.capacity &&
      like->network_.conductance == network.conductance &&
      like->network_.coolant_conductance == network.coolant_conductance) {
    dry_ = like->dry_;
    flooded_ = like->flooded_;
    return;
  }
  dry_ = std::make_shared<Modes>(network.capacity, network.conductance);
  flooded_ = network.coolant_conductance.isZero(0.0)
                 ? dry_
                 : std::make_shared<Modes>(network.capacity,
                                           network.conductance + network.coolant_conductance);
}

std::vector<std::string> shared_signals(const std::vector<RunFile>& files) {
  std::vector<std::string> names;
  for (const std::string& name : files.front().columns) {
    if (name == "time_s" || !is_operating(name) || name.ends_with("_mm")) continue;
    const bool everywhere = std::all_of(files.begin(), files.end(), [&](const RunFile& file) {
      return file.find(name) && is_mostly_known(file.column(name));
    });
    if (everywhere) names.push_back(name);
  }
  return names;
}

ThermalRuns thermal_runs(const ThermalPlant& plant, const std::vector<RunFile>& files,
                         const std::vector<std::string>& signals) {
  ThermalRuns all{signals, {}};
  const auto add_signal = [&](const std::string& signal) {
    if (!signal.empty() &&
        std::find(all.signals.begin(), all.signals.end(), signal) == all.signals.end())
      all.signals.push_back(signal);
  };
  for (const NetworkSource& source : plant.network.sources) add_signal(source.signal);
  for (const RunFile& file : files) {
    ThermalRun run;
    run.name = file.argument;
    run.begin = static_cast<Eigen::Index>(file.selected_begin);
    run.time_s = held(file, "time_s");
    run.room_degC = held(file, plant.room_column);
    run.coolant_degC =
        plant.coolant_column
            ? held(file, *plant.coolant_column)
            : Column(plant.coolant_degC +
                     plant.coolant_room_share * (run.room_degC.array() - plant.room_mean_degC));
    run.coolant_flows = Column::Zero(run.rows());
    if (plant.coolant_signal)
      run.coolant_flows =
          (held(file, *plant.coolant_signal).array() != 0.0).cast<double>().matrix();
    for (const std::string& signal : all.signals) run.signals.push_back(held(file, signal));
    bool any = false;
    for (const NetworkSensor& sensor : plant.network.sensors) {
      Column measured = Column::Constant(run.rows(), not_a_number);
      const auto index = file.find(sensor.column);
      for (Eigen::Index row = 0; index && row < run.rows(); ++row)
        measured[row] = file.values[*index][static_cast<std::size_t>(row)];
      any = any || measured.tail(run.rows() - run.begin).array().isFinite().any();
      run.measured_degC.push_back(std::move(measured));
    }
    if (!any)
      throw ConfigurationError({{file.name, 0, plant.network.sensors.front().column, "(missing)",
                                 "must have a reading of a thermocouple on the machine"}});
    all.runs.push_back(std::move(run));
  }
  return all;
}

Matrix NetworkSimulation::modal_states(const ThermalRuns& runs, const ThermalRun& run) const {
  const Matrix drive = drives(network_, runs, run);
  const Matrix between = 0.5 * (drive.leftCols(run.rows() - 1) + drive.rightCols(run.rows() - 1));
  const Modes* const modes[2] = {dry_.get(), flooded_.get()};
  Matrix into[2];
  for (const bool flows : {false, true})
    into[flows].noalias() = Matrix(modes[flows]->into_modes * inflows(network_, flows)) * between;
  bool flows = run.coolant_flows[0] > 0.0;
  Matrix states(network_.capacity.rows(), run.rows());
  Vector state = modes[flows]->to_modes * start_state(network_, run);
  Eigen::ArrayXd keep;
  Eigen::ArrayXd gain;
  double step_s = -1.0;
  for (Eigen::Index row = 0; row + 1 < run.rows(); ++row) {
    const bool now = run.coolant_flows[row] > 0.0;
    const double dt_s = run.time_s[row + 1] - run.time_s[row];
    if (now != flows) state = modes[now]->to_modes * (modes[flows]->from_modes * state);
    states.col(row) = state;
    if (now != flows || !(std::abs(dt_s - step_s) < 1e-9 * dt_s)) {
      const Eigen::ArrayXd rate_per_s = modes[now]->rate_per_s.array();
      keep = (-dt_s * rate_per_s).exp();
      gain = -(-dt_s * rate_per_s).expm1() / rate_per_s;
      step_s = dt_s;
    }
    flows = now;
    state = keep * state.array() + gain * into[flows].col(row).array();
  }
  states.rightCols(1) = state;
  return states;
}

/// Modes of the row; the last row's state uses the modes of the step that led to it.
const NetworkSimulation::Modes& NetworkSimulation::modes_of(const ThermalRun& run,
                                                            Eigen::Index row) const {
  const Eigen::Index of = std::min(row, std::max<Eigen::Index>(0, run.rows() - 2));
  return run.coolant_flows[of] > 0.0 ? *flooded_ : *dry_;
}

Matrix NetworkSimulation::states(const ThermalRuns& runs, std::size_t index) const {
  const ThermalRun& run = runs.runs[index];
  Matrix states = modal_states(runs, run);
  for (Eigen::Index row = 0; row < run.rows(); ++row)
    states.col(row) = modes_of(run, row).from_modes * states.col(row).eval();
  return states;
}

std::vector<Column> NetworkSimulation::readings_degC(const ThermalRuns& runs,
                                                     std::size_t index) const {
  const ThermalRun& run = runs.runs[index];
  const Matrix states = modal_states(runs, run);
  std::vector<Column> readings;
  for (const NetworkSensor& sensor : network_.sensors) {
    const Eigen::RowVectorXd dry = sensor.row * dry_->from_modes;
    const Eigen::RowVectorXd flooded = sensor.row * flooded_->from_modes;
    Column values(run.rows());
    for (Eigen::Index row = 0; row < run.rows(); ++row)
      values[row] = (&modes_of(run, row) == flooded_.get() ? flooded : dry).dot(states.col(row));
    lag(run.time_s, sensor.lag_s, values);
    readings.push_back(std::move(values));
  }
  return readings;
}

}  // namespace thermocomp::diagnosis
