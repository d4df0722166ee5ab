#include "estimator/model/displacement_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "estimator/checks.hpp"
#include "estimator/model/terms/term.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;

Matrix matrix_from(const std::vector<std::vector<double>>& rows, std::size_t count,
                   std::size_t columns, const char* key) {
  require(rows.size() == count, key, static_cast<double>(rows.size()),
          "has the wrong number of rows");
  Matrix matrix(count, columns);
  for (std::size_t i = 0; i < count; ++i) {
    require(rows[i].size() == columns, key, static_cast<double>(rows[i].size()),
            "has a row of the wrong length");
    for (std::size_t j = 0; j < columns; ++j) {
      require(std::isfinite(rows[i][j]), key, rows[i][j], "must be finite");
      matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = rows[i][j];
    }
  }
  return matrix;
}

/// Rows of one guideway, one per position and output.
struct Guideway {
  std::size_t signal{0};
  std::vector<double> positions_mm;
  std::vector<std::size_t> outputs;
  std::vector<Matrix> rows_um_per_K;  ///< one per output, shape (positions, inputs)

  /// Index of the position below `position_mm`, and the share of the one above.
  [[nodiscard]] std::pair<Eigen::Index, double> place(double position_mm) const noexcept {
    const auto above = std::upper_bound(positions_mm.begin(), positions_mm.end(), position_mm);
    if (above == positions_mm.begin()) return {0, 0.0};
    if (above == positions_mm.end())
      return {static_cast<Eigen::Index>(positions_mm.size()) - 2, 1.0};
    const auto lower = above - 1;
    return {lower - positions_mm.begin(), (position_mm - *lower) / (*above - *lower)};
  }
};

Guideway guideway_from(const GuidewaySpec& spec, const ThermalModel& model,
                       const ModelColumns& columns) {
  Guideway guideway;
  guideway.signal = index_of(columns.signals, spec.axis, "guideway.axis", "is not a signal");
  guideway.positions_mm = spec.positions_mm;
  require(spec.positions_mm.size() >= 2, "guideway.positions_mm",
          static_cast<double>(spec.positions_mm.size()), "needs at least two positions");
  for (std::size_t i = 1; i < spec.positions_mm.size(); ++i)
    require(spec.positions_mm[i] > spec.positions_mm[i - 1], "guideway.positions_mm",
            spec.positions_mm[i], "must increase");
  for (const auto& [output, rows] : spec.rows_um_per_K) {
    guideway.outputs.push_back(
        index_of(model.outputs, output, "guideway.rows_um_per_K", "is not an output of the model"));
    guideway.rows_um_per_K.push_back(
        matrix_from(rows, spec.positions_mm.size(), model.inputs.size(), "guideway.rows_um_per_K"));
  }
  return guideway;
}

/// Orders by everything that determines a term's state. Gains do not, so a term with new gains
/// keeps its state.
struct ByState {
  bool operator()(const TermSpec* a, const TermSpec* b) const {
    const auto key = [](const TermSpec& term) {
      return std::tie(term.kind, term.subject, term.shared, term.bank.subjects, term.bank.powers,
                      term.bank.taus_s);
    };
    return key(*a) < key(*b);
  }
};

}  // namespace

struct DisplacementModel::Equation {
  std::size_t columns{0};
  std::size_t signals{0};
  std::size_t outputs{0};
  Eigen::Index inputs{0};
  Matrix matrix_um_per_K;
  std::vector<Guideway> guideways;
  std::vector<TermSpec> term_specs;
  std::vector<std::unique_ptr<Term>> terms;
  Vector rise_K;                  ///< shape (columns); scratch
  std::vector<std::byte> states;  ///< of all terms; scratch

  void add_guideways(std::span<const double> signal_values, std::span<double> out) const noexcept {
    const auto rise = rise_K.head(inputs);
    for (const Guideway& guideway : guideways) {
      const auto [lower, share] = guideway.place(signal_values[guideway.signal]);
      for (std::size_t i = 0; i < guideway.outputs.size(); ++i) {
        const Matrix& rows = guideway.rows_um_per_K[i];
        out[guideway.outputs[i]] +=
            (1.0 - share) * rows.row(lower).dot(rise) + share * rows.row(lower + 1).dot(rise);
      }
    }
  }

  void add_guideway_slopes(std::size_t output, std::span<const double> signal_values,
                           std::span<double> slope_um_per_K) const noexcept {
    for (const Guideway& guideway : guideways) {
      const auto [lower, share] = guideway.place(signal_values[guideway.signal]);
      for (std::size_t i = 0; i < guideway.outputs.size(); ++i) {
        if (guideway.outputs[i] != output) continue;
        const Matrix& rows = guideway.rows_um_per_K[i];
        for (Eigen::Index j = 0; j < inputs; ++j)
          slope_um_per_K[static_cast<std::size_t>(j)] +=
              (1.0 - share) * rows(lower, j) + share * rows(lower + 1, j);
      }
    }
  }
};

DisplacementModel::DisplacementModel(const ThermalModel& model)
    : equation_(std::make_unique<Equation>()) {
  const ModelColumns columns(model);
  equation_->columns = columns.temperatures.size();
  equation_->signals = columns.signals.size();
  equation_->outputs = model.outputs.size();
  equation_->inputs = static_cast<Eigen::Index>(model.inputs.size());
  equation_->matrix_um_per_K = matrix_from(model.matrix_um_per_K, model.outputs.size(),
                                           model.inputs.size(), "matrix_um_per_K");
  for (const GuidewaySpec& spec : model.guideways)
    equation_->guideways.push_back(guideway_from(spec, model, columns));
  equation_->term_specs = model.terms;
  for (const TermSpec& spec : model.terms)
    equation_->terms.push_back(make_term(spec, model, columns));
  equation_->rise_K = Vector::Zero(static_cast<Eigen::Index>(equation_->columns));
  StateArchive counting;
  visit_state(counting);
  equation_->states.resize(counting.position_bytes());
}

DisplacementModel::~DisplacementModel() = default;
DisplacementModel::DisplacementModel(DisplacementModel&&) noexcept = default;
DisplacementModel& DisplacementModel::operator=(DisplacementModel&&) noexcept = default;

void DisplacementModel::restart() noexcept {
  for (auto& term : equation_->terms) term->restart();
}

void DisplacementModel::step(nanoseconds now, std::span<const double> temps_degC,
                             std::span<const double> reference_degC,
                             std::span<const double> signals,
                             std::span<double> displacement_um) noexcept {
  Equation& equation = *equation_;
  THERMOCOMP_ENSURE(temps_degC.size() == equation.columns &&
                    reference_degC.size() == equation.columns);
  THERMOCOMP_ENSURE(signals.size() == equation.signals &&
                    displacement_um.size() == equation.outputs);
  for (std::size_t i = 0; i < equation.columns; ++i)
    equation.rise_K[static_cast<Eigen::Index>(i)] = temps_degC[i] - reference_degC[i];
  const std::span<double> rise_K(equation.rise_K.data(), equation.columns);
  for (auto& term : equation.terms) term->correct_rise(now, rise_K);
  Eigen::Map<Vector> out(displacement_um.data(), static_cast<Eigen::Index>(equation.outputs));
  out.noalias() = equation.matrix_um_per_K * equation.rise_K.head(equation.inputs);
  equation.add_guideways(signals, displacement_um);
  const TermInput input{now, rise_K, signals, reference_degC};
  for (auto& term : equation.terms) term->add(input, displacement_um);
  for (auto& term : equation.terms) term->correct_displacement(displacement_um);
}

void DisplacementModel::slope(std::size_t output, std::span<const double> rise_K,
                              std::span<const double> signals,
                              std::span<double> slope_um_per_K) const noexcept {
  const Equation& equation = *equation_;
  THERMOCOMP_ENSURE(output < equation.outputs && signals.size() == equation.signals);
  THERMOCOMP_ENSURE(rise_K.size() == equation.columns && slope_um_per_K.size() == equation.columns);
  std::fill(slope_um_per_K.begin(), slope_um_per_K.end(), 0.0);
  for (Eigen::Index j = 0; j < equation.inputs; ++j)
    slope_um_per_K[static_cast<std::size_t>(j)] =
        equation.matrix_um_per_K(static_cast<Eigen::Index>(output), j);
  equation.add_guideway_slopes(output, signals, slope_um_per_K);
  const TermInput input{{}, rise_K, signals};
  for (const auto& term : equation.terms) term->add_slope(input, output, slope_um_per_K);
  for (const auto& term : equation.terms) term->add_transient_slope(output, slope_um_per_K);
  for (const auto& term : equation.terms) term->correct_slope(slope_um_per_K);
}

void DisplacementModel::visit_state(StateArchive& archive) {
  for (auto& term : equation_->terms) term->visit_state(archive);
}

void DisplacementModel::copy_states(const DisplacementModel& same) noexcept {
  StateArchive save{std::span<std::byte>(equation_->states)};
  for (auto& term : same.equation_->terms) term->visit_state(save);
  StateArchive load{std::span<const std::byte>(equation_->states)};
  visit_state(load);
}

std::vector<int> DisplacementModel::plan_terms(const DisplacementModel& other) const {
  const std::vector<TermSpec>& theirs = other.equation_->term_specs;
  std::map<const TermSpec*, int, ByState> known;  // the first of duplicates
  for (std::size_t i = 0; i < theirs.size(); ++i)
    known.try_emplace(&theirs[i], static_cast<int>(i));
  std::vector<int> plan;
  for (const TermSpec& ours : equation_->term_specs) {
    const auto same = known.find(&ours);
    plan.push_back(same == known.end() ? -1 : same->second);
  }
  return plan;
}

void DisplacementModel::adopt_terms(const DisplacementModel& other,
                                    std::span<const int> plan) noexcept {
  std::vector<std::byte>& state = equation_->states;  // as large as ours for each planned term
  for (std::size_t i = 0; i < plan.size(); ++i) {
    if (plan[i] < 0) continue;
    StateArchive save{std::span<std::byte>(state)};
    other.equation_->terms[static_cast<std::size_t>(plan[i])]->visit_state(save);
    StateArchive load{std::span<const std::byte>(state.data(), save.position_bytes())};
    equation_->terms[i]->visit_state(load);
  }
}

namespace {

constexpr nanoseconds between_looks = std::chrono::seconds(1);
/// Behaviour not shown by a single run, as a share of the displacement without a model. Fitted,
/// together with the fourth root of the runs, to all 86 splits of measured machines
/// (docs/measurements.md).
constexpr double unseen_share = 0.25;

/// A signal, or its low pass, further beyond its recorded values is outside, as a share of their
/// range: squares and hinges of signals extrapolate badly, and among many features one counts
/// little in the distance.
constexpr double beyond_the_range = 0.1;

bool is_input(const MadeFrom& made_from, std::size_t column) {
  return is_temperature_name(made_from.columns[column]);
}

/// L^-1 of S = L L^T, row by row.
/// @throws InvalidValue when S is not positive definite or of the wrong shape
std::vector<double> whitening(const MadeFrom& made_from) {
  const std::size_t count = domain_features(made_from);
  const auto size = static_cast<Eigen::Index>(count);
  const auto& rows = made_from.covariance;
  require(rows.size() == count, "made_from.covariance", static_cast<double>(rows.size()),
          "has the wrong number of rows");
  Eigen::MatrixXd s(size, size);
  for (std::size_t i = 0; i < count; ++i) {
    require(rows[i].size() == count, "made_from.covariance", static_cast<double>(rows[i].size()),
            "has a row of the wrong length");
    for (std::size_t j = 0; j < count; ++j)
      s(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = rows[i][j];
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(s);
  require(factor.info() == Eigen::Success, "made_from.covariance", static_cast<double>(count),
          "must be positive definite");
  const Eigen::MatrixXd inverse = factor.matrixL().solve(Eigen::MatrixXd::Identity(size, size));
  std::vector<double> lower;
  for (Eigen::Index i = 0; i < size; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) lower.push_back(inverse(i, j));
  return lower;
}

}  // namespace

double spread_um(const MadeFrom& made_from, const MadeFrom::Output& output, bool outside) {
  const auto runs =
      static_cast<double>(outside ? 1 : std::max<std::size_t>(made_from.runs.size(), 1));
  return std::hypot(output.left_out_rms_um,
                    unseen_share * output.no_model_rms_um / std::pow(runs, 0.25));
}

std::size_t domain_features(const MadeFrom& made_from) {
  const auto inputs = static_cast<std::size_t>(
      std::count_if(made_from.columns.begin(), made_from.columns.end(),
                    [](const std::string& name) { return is_temperature_name(name); }));
  return inputs + made_from.columns.size() * made_from.taus_s.size();
}

struct ModelDomain::Metric {
  struct Column {
    std::size_t index;
    bool temperature;
    double low;  ///< recorded
    double high;
  };
  std::vector<Column> columns;
  std::vector<double> taus_s;
  std::vector<double> mean;
  std::vector<double> lower;  ///< L^-1, row by row
  double distance_max{0.0};
  std::array<std::vector<double>, 2> spread_um;  ///< inside and outside; one per output
  struct State {
    bool started{false};
    nanoseconds looked_at{};
    std::vector<double> late;  ///< shape (time constants, columns)
    double distance{0.0};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d] = *this;
      archive(a, b, c, d);
    }
  };
  State state;
  std::vector<double> feature;  ///< scratch
  std::vector<double> values;   ///< one per column; scratch

  void follow(double step_s) noexcept {
    for (std::size_t j = 0; j < taus_s.size(); ++j) {
      const double share = state.started && taus_s[j] > 0 ? -std::expm1(-step_s / taus_s[j]) : 1.0;
      for (std::size_t i = 0; i < columns.size(); ++i) {
        double& each = state.late[j * columns.size() + i];
        each = share < 1.0 ? each + share * (values[i] - each) : values[i];
      }
    }
  }

  /// How far a signal's late values are beyond its recorded ones, as a share of their range.
  [[nodiscard]] double beyond(std::size_t column) const noexcept {
    const Column& of = columns[column];
    if (of.temperature || !(of.high > of.low)) return 0.0;
    double most = 0.0;
    for (std::size_t j = 0; j < taus_s.size(); ++j) {
      const double value = state.late[j * columns.size() + column];
      most = std::max(most, std::max(of.low - value, value - of.high) / (of.high - of.low));
    }
    return most;
  }

  [[nodiscard]] double distance() const noexcept {
    double most = 0.0;
    for (std::size_t i = 0; i < columns.size(); ++i) most = std::max(most, beyond(i));
    const double measured = measure();
    if (!(most > beyond_the_range)) return measured;
    return std::max(measured, distance_max * (1.0 + most - beyond_the_range));
  }

  [[nodiscard]] double measure() const noexcept {
    double sum = 0.0;
    const double* row = lower.data();
    for (std::size_t i = 0; i < feature.size(); ++i) {
      double white = 0.0;
      for (std::size_t j = 0; j <= i; ++j) white += row[j] * (feature[j] - mean[j]);
      row += i + 1;
      sum += white * white;
    }
    return std::sqrt(sum / static_cast<double>(feature.size()));
  }
};

ModelDomain::ModelDomain(const ThermalModel& model) : metric_(std::make_unique<Metric>()) {
  THERMOCOMP_ENSURE(model.made_from.has_value());
  const MadeFrom& made_from = *model.made_from;
  const auto temperatures = model.temperature_columns();
  const auto signals = model.signal_columns();
  require(made_from.low.size() == made_from.columns.size() &&
              made_from.high.size() == made_from.columns.size(),
          "made_from.low", static_cast<double>(made_from.low.size()),
          "must have one value per column, as high");
  for (std::size_t i = 0; i < made_from.columns.size(); ++i) {
    const bool temperature = is_input(made_from, i);
    metric_->columns.push_back(
        {index_of(temperature ? temperatures : signals, made_from.columns[i], "made_from.columns",
                  "must be a column that the model reads"),
         temperature, made_from.low[i], made_from.high[i]});
  }
  const std::size_t count = domain_features(made_from);
  require(made_from.mean.size() == count, "made_from.mean",
          static_cast<double>(made_from.mean.size()), "must have one value per feature");
  metric_->taus_s = made_from.taus_s;
  metric_->mean = made_from.mean;
  metric_->lower = whitening(made_from);
  metric_->distance_max = made_from.distance_max;
  metric_->values.resize(made_from.columns.size());
  metric_->state.late.resize(made_from.columns.size() * made_from.taus_s.size());
  metric_->feature.resize(count);
  for (const std::string& name : model.outputs) {
    const auto output = made_from.outputs.find(name);
    const bool known = output != made_from.outputs.end();
    for (const bool outside : {false, true})
      metric_->spread_um[outside].push_back(known ? spread_um(made_from, output->second, outside)
                                                  : not_a_number);
  }
}

ModelDomain::~ModelDomain() = default;
ModelDomain::ModelDomain(ModelDomain&&) noexcept = default;
ModelDomain& ModelDomain::operator=(ModelDomain&&) noexcept = default;

void ModelDomain::restart() noexcept {
  metric_->state.started = false;
}

void ModelDomain::step(nanoseconds now, std::span<const double> temps_degC,
                       std::span<const double> reference_degC,
                       std::span<const double> signals) noexcept {
  Metric& metric = *metric_;
  if (metric.state.started && now - metric.state.looked_at < between_looks) return;
  for (std::size_t i = 0; i < metric.columns.size(); ++i) {
    const auto& [index, temperature, low, high] = metric.columns[i];
    metric.values[i] = temperature ? temps_degC[index] - reference_degC[index] : signals[index];
  }
  metric.follow(std::chrono::duration<double>(now - metric.state.looked_at).count());
  std::size_t at = 0;
  for (const Metric::Column& column : metric.columns)
    if (column.temperature) metric.feature[at++] = temps_degC[column.index];
  std::copy(metric.state.late.begin(), metric.state.late.end(),
            metric.feature.begin() + static_cast<std::ptrdiff_t>(at));
  metric.state.distance = metric.distance();
  metric.state.started = true;
  metric.state.looked_at = now;
}

double ModelDomain::distance() const noexcept {
  return metric_->state.distance;
}

bool ModelDomain::outside() const noexcept {
  return !(metric_->state.distance <= metric_->distance_max);
}

std::size_t ModelDomain::furthest_column() const {
  const Metric& metric = *metric_;
  std::vector<double> beyond(metric.columns.size());
  for (std::size_t i = 0; i < beyond.size(); ++i) beyond[i] = metric.beyond(i);
  const auto furthest = std::max_element(beyond.begin(), beyond.end());
  if (furthest != beyond.end() && *furthest > beyond_the_range)
    return static_cast<std::size_t>(furthest - beyond.begin());
  const auto count = static_cast<Eigen::Index>(metric.feature.size());
  Eigen::VectorXd off(count);
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(count, count);  // L^-1
  const double* value = metric.lower.data();
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    off[i] = metric.feature[at] - metric.mean[at];
    for (Eigen::Index j = 0; j <= i; ++j) inverse(i, j) = *value++;
  }
  // The parts add up to d^2.
  const Eigen::VectorXd parts = off.cwiseProduct(inverse.transpose() * (inverse * off));
  std::vector<double> of_column(metric.columns.size(), 0.0);
  Eigen::Index at = 0;
  for (std::size_t i = 0; i < of_column.size(); ++i)
    if (metric.columns[i].temperature) of_column[i] += parts[at++];
  while (at < count)
    for (double& each : of_column) each += parts[at++];
  return static_cast<std::size_t>(std::max_element(of_column.begin(), of_column.end()) -
                                  of_column.begin());
}

double ModelDomain::used_share() const noexcept {
  if (!outside()) return 1.0;
  const double share = metric_->distance_max / metric_->state.distance;
  return share < 1.0 ? share * share : 0.0;
}

double ModelDomain::sd_um(std::size_t output) const noexcept {
  return metric_->spread_um[outside()][output];
}

void ModelDomain::visit_state(StateArchive& archive) {
  archive(metric_->state);
}

bool ModelDomain::alike(const ModelDomain& other) const {
  const auto same = [](const Metric::Column& a, const Metric::Column& b) {
    return a.index == b.index && a.temperature == b.temperature;
  };
  return metric_->taus_s == other.metric_->taus_s &&
         std::equal(metric_->columns.begin(), metric_->columns.end(),
                    other.metric_->columns.begin(), other.metric_->columns.end(), same);
}

void ModelDomain::adopt(const ModelDomain& other) noexcept {
  metric_->state = other.metric_->state;  // same sizes: no allocation
}

}  // namespace thermocomp
