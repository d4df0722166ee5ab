#include "estimator/model_domain.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

constexpr nanoseconds between_looks = std::chrono::seconds(1);

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

std::size_t domain_features(const MadeFrom& made_from) {
  const auto inputs = static_cast<std::size_t>(
      std::count_if(made_from.columns.begin(), made_from.columns.end(),
                    [](const std::string& name) { return is_temperature_name(name); }));
  return inputs + made_from.columns.size() * made_from.taus_s.size();
}

struct ModelDomain::Parts {
  struct Column {
    std::size_t index;
    bool temperature;
  };
  std::vector<Column> columns;
  std::vector<double> taus_s;
  std::vector<double> mean;
  std::vector<double> lower;  ///< L^-1, row by row
  double distance_max{0.0};
  std::vector<double> left_out_um;  ///< one an output
  std::vector<double> freedom;
  bool started{false};
  nanoseconds looked_at{};
  std::vector<double> late;  ///< shape (time constants, columns)
  double distance{0.0};
  std::vector<double> feature;  ///< scratch
  std::vector<double> values;   ///< one a column; scratch

  void follow(double step_s) noexcept {
    for (std::size_t j = 0; j < taus_s.size(); ++j) {
      const double share = started && taus_s[j] > 0 ? -std::expm1(-step_s / taus_s[j]) : 1.0;
      for (std::size_t i = 0; i < columns.size(); ++i) {
        double& each = late[j * columns.size() + i];
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

ModelDomain::ModelDomain(const ThermalModel& model) : parts_(std::make_unique<Parts>()) {
  THERMOCOMP_ENSURE(model.made_from.has_value());
  const MadeFrom& made_from = *model.made_from;
  const auto temperatures = model.temperature_columns();
  const auto signals = model.signal_columns();
  for (std::size_t i = 0; i < made_from.columns.size(); ++i) {
    const bool temperature = is_input(made_from, i);
    parts_->columns.push_back(
        {index_of(temperature ? temperatures : signals, made_from.columns[i], "made_from.columns",
                  "must be a column that the model reads"),
         temperature});
  }
  const std::size_t count = domain_features(made_from);
  require(made_from.mean.size() == count, "made_from.mean",
          static_cast<double>(made_from.mean.size()), "must have one value a feature");
  parts_->taus_s = made_from.taus_s;
  parts_->mean = made_from.mean;
  parts_->lower = whitening(made_from);
  parts_->distance_max = made_from.distance_max;
  parts_->values.resize(made_from.columns.size());
  parts_->late.resize(made_from.columns.size() * made_from.taus_s.size());
  parts_->feature.resize(count);
  for (const std::string& name : model.outputs) {
    const auto output = made_from.outputs.find(name);
    const bool known = output != made_from.outputs.end();
    parts_->left_out_um.push_back(known ? output->second.left_out_rms_um : not_a_number);
    parts_->freedom.push_back(known ? output->second.freedom : 1.0);
  }
}

ModelDomain::~ModelDomain() = default;
ModelDomain::ModelDomain(ModelDomain&&) noexcept = default;
ModelDomain& ModelDomain::operator=(ModelDomain&&) noexcept = default;

void ModelDomain::restart() noexcept {
  parts_->started = false;
}

void ModelDomain::step(nanoseconds now, std::span<const double> temps_degC,
                       std::span<const double> reference_degC,
                       std::span<const double> signals) noexcept {
  Parts& parts = *parts_;
  if (parts.started && now - parts.looked_at < between_looks) return;
  for (std::size_t i = 0; i < parts.columns.size(); ++i) {
    const auto [index, temperature] = parts.columns[i];
    parts.values[i] = temperature ? temps_degC[index] - reference_degC[index] : signals[index];
  }
  parts.follow(std::chrono::duration<double>(now - parts.looked_at).count());
  std::size_t at = 0;
  for (const auto& [index, temperature] : parts.columns)
    if (temperature) parts.feature[at++] = temps_degC[index];
  std::copy(parts.late.begin(), parts.late.end(),
            parts.feature.begin() + static_cast<std::ptrdiff_t>(at));
  parts.distance = parts.measure();
  parts.started = true;
  parts.looked_at = now;
}

double ModelDomain::distance() const noexcept {
  return parts_->distance;
}

bool ModelDomain::outside() const noexcept {
  return !(parts_->distance <= parts_->distance_max);
}

double ModelDomain::believed_share() const noexcept {
  if (!outside()) return 1.0;
  const double share = parts_->distance_max / parts_->distance;
  return share < 1.0 ? share * share : 0.0;
}

double ModelDomain::sd_um(std::size_t output) const noexcept {
  const double count = static_cast<double>(parts_->feature.size());
  const double excess = std::max(1.0, parts_->distance) * std::max(1.0, parts_->distance);
  const double freedom = parts_->freedom[output];
  return parts_->left_out_um[output] * std::sqrt((freedom + count * excess) / (freedom + count));
}

void ModelDomain::visit_state(StateArchive& archive) {
  archive(parts_->started, parts_->looked_at, parts_->late, parts_->distance);
}

bool ModelDomain::alike(const ModelDomain& other) const {
  const auto same = [](const Parts::Column& a, const Parts::Column& b) {
    return a.index == b.index && a.temperature == b.temperature;
  };
  return parts_->taus_s == other.parts_->taus_s &&
         std::equal(parts_->columns.begin(), parts_->columns.end(), other.parts_->columns.begin(),
                    other.parts_->columns.end(), same);
}

void ModelDomain::adopt(const ModelDomain& other) noexcept {
  parts_->started = other.parts_->started;
  parts_->looked_at = other.parts_->looked_at;
  std::copy(other.parts_->late.begin(), other.parts_->late.end(), parts_->late.begin());
  parts_->distance = other.parts_->distance;
}

}  // namespace thermocomp
