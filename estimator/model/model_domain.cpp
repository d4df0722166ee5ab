#include "estimator/model/model_domain.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

constexpr nanoseconds between_looks = std::chrono::seconds(1);
/// Behaviour that a single run has not shown, as a share of the displacement without a model. Set,
/// with the fourth root of the runs, on all 86 splits of measured machines (docs/measurements.md).
constexpr double unseen_share = 0.25;

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
  for (std::size_t i = 0; i < made_from.columns.size(); ++i) {
    const bool temperature = is_input(made_from, i);
    metric_->columns.push_back(
        {index_of(temperature ? temperatures : signals, made_from.columns[i], "made_from.columns",
                  "must be a column that the model reads"),
         temperature});
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
    const auto [index, temperature] = metric.columns[i];
    metric.values[i] = temperature ? temps_degC[index] - reference_degC[index] : signals[index];
  }
  metric.follow(std::chrono::duration<double>(now - metric.state.looked_at).count());
  std::size_t at = 0;
  for (const auto& [index, temperature] : metric.columns)
    if (temperature) metric.feature[at++] = temps_degC[index];
  std::copy(metric.state.late.begin(), metric.state.late.end(),
            metric.feature.begin() + static_cast<std::ptrdiff_t>(at));
  metric.state.distance = metric.measure();
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
