#include "modelling/diagnosis/evidence/evidence.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "modelling/diagnosis/data/false_reading.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double offset_sd_um = 1e4;
constexpr double accepted_sd_um = 1e4;
constexpr Eigen::Index measured_rows_min = 8;
/// A noise that is below the least digit anybody measures would make every misfit significant.
constexpr double noise_um_min = 1e-3;

/// White noise, or a wandering part of at most a third of the residual: what is larger than that
/// is what a diagnosis has to explain, not noise.
std::vector<NoiseShape> noise_shapes(double residual_um, double noise_um) {
  std::vector<NoiseShape> shapes = {{0.0, 1.0}};
  for (const double share : {0.1, 0.3, 1.0}) {
    const double wander_um = share * residual_um;
    for (const double tau_s : {1200.0, 3600.0, 10800.0})
      shapes.push_back({wander_um * wander_um / (noise_um * noise_um), tau_s});
  }
  return shapes;
}

/// The noise of single values: second differences leave nothing of what changes slowly. The median
/// keeps jumps out.
double noise_of(const Column& residual, const Eigen::Array<bool, Eigen::Dynamic, 1>& present,
                const std::vector<Block>& runs) {
  std::vector<double> differences;
  for (const Block& run : runs)
    for (Eigen::Index row = run.begin + 1; row + 1 < run.end; ++row)
      if (present[row - 1] && present[row] && present[row + 1])
        differences.push_back(
            std::abs(residual[row + 1] - 2.0 * residual[row] + residual[row - 1]));
  if (differences.empty()) return noise_um_min;
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  return std::max(noise_um_min, *middle / (0.6745 * std::sqrt(6.0)));
}

/// An error of this standard deviation that moves nothing beside the noise of all rows together is
/// left out.
constexpr double seen_min = 0.1;

/// Displacement that errors of the model's coefficients add, each of one standard deviation: the
/// principal columns of what the model makes of each temperature, as independent of each other
/// as the errors are.
Eigen::MatrixXd coefficient_columns_of(const MeasuredData& data, const StackedRows& rows,
                                       std::size_t output,
                                       const Eigen::Array<bool, Eigen::Dynamic, 1>& present,
                                       double noise_um) {
  if (!(data.coefficient_sd > 0)) return Eigen::MatrixXd(rows.time_s.size(), 0);
  Panel all(rows.time_s.size(), static_cast<Eigen::Index>(data.model.inputs.size()));
  for (std::size_t input = 0; input < data.model.inputs.size(); ++input) {
    for (std::size_t i = 0; i < data.runs.size(); ++i) {
      const MeasuredRun& run = data.runs[i];
      const Block& block = rows.runs[i];
      const Eigen::Index count = block.end - block.begin;
      Panel moved = run.calm_inputs_K[input];
      answer_to_errors(data, run, output, input, moved);
      all.col(static_cast<Eigen::Index>(input)).segment(block.begin, count) =
          moved.col(0).tail(count);
    }
  }
  all *= data.coefficient_sd;
  for (Eigen::Index row = 0; row < all.rows(); ++row)
    if (!present[row]) all.row(row).setZero();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parts(
      cross_products(all, all, 0, all.rows()));
  Eigen::Index seen = 0;
  for (const double square : parts.eigenvalues())
    seen += square > seen_min * noise_um * noise_um ? 1 : 0;
  return all * parts.eigenvectors().rightCols(seen);
}

}  // namespace

void add_witness(Explanation& explanation, double says) {
  explanation.score += says;
  explanation.witness = says;
}

std::size_t free_parameters(const Explanation& explanation) {
  const Hypothesis& of = *explanation.hypothesis;
  auto free = static_cast<std::size_t>(
      std::count_if(of.shape.begin(), of.shape.end(),
                    [](const ShapeParameter& parameter) { return !parameter.discrete; }));
  if (of.form == Form::shared_gain) ++free;
  if (of.form == Form::own_gains)
    for (const Eigen::VectorXd& gains : explanation.gains)
      free += static_cast<std::size_t>(gains.size());
  return free;
}

Setting::Setting(const NoiseShape& shape, const StackedRows& rows,
                 const Eigen::Array<bool, Eigen::Dynamic, 1>& present, const Column& residual,
                 const Eigen::MatrixXd& common, const Eigen::VectorXd& precision)
    : whitener_(std::make_shared<const Whitener>(shape, rows.time_s, rows.blocks, present)),
      precision_(precision),
      present_rows_(static_cast<double>(present.count())) {
  Panel columns(common.rows(), 1 + common.cols());
  columns << residual, common;
  against_ = whitener_->apply(columns);
  reckon();
}

Setting::Setting(const Setting& other, const Eigen::MatrixXd& more, double precision)
    : whitener_(other.whitener_),
      against_(other.against_.rows(), other.against_.cols() + more.cols()),
      precision_(other.precision_.size() + more.cols()),
      present_rows_(other.present_rows_) {
  against_ << other.against_, whitener_->apply(Panel(more));
  precision_ << other.precision_, Eigen::VectorXd::Constant(more.cols(), precision);
  reckon();
}

void Setting::reckon() {
  const Eigen::Index common = precision_.size();
  const Eigen::MatrixXd all = cross_products(against_, against_, 0, against_.rows());
  Eigen::MatrixXd square = all.bottomRightCorner(common, common);
  square.diagonal() += precision_;
  factor_.compute(square);
  common_residual_ = factor_.matrixL().solve(all.col(0).tail(common));
  squares_ = all(0, 0) - common_residual_.squaredNorm();
  log_determinant_ = whitener_->log_determinant() - precision_.array().log().sum() +
                     2.0 * factor_.matrixLLT().diagonal().array().log().sum();
  likelihood_ = twice_log_likelihood(squares_);
}

std::vector<std::vector<std::size_t>> Setting::alike(const std::vector<const Setting*>& settings) {
  std::vector<std::vector<std::size_t>> all;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const auto known = std::find_if(all.begin(), all.end(), [&](const auto& group) {
      return settings[group.front()]->whitener_ == settings[i]->whitener_;
    });
    if (known == all.end())
      all.push_back({i});
    else
      known->push_back(i);
  }
  for (auto& group : all)
    std::sort(group.begin(), group.end(), [&](std::size_t a, std::size_t b) {
      return settings[a]->against_.cols() > settings[b]->against_.cols();
    });
  return all;
}

std::vector<EquationsTable> Setting::equations_of_groups(
    const std::vector<const Setting*>& settings, const Panel& columns, Eigen::Index width) {
  std::vector<EquationsTable> all(
      settings.size(), EquationsTable(static_cast<std::size_t>(columns.cols() / width), width));
  for (const std::vector<std::size_t>& group : alike(settings)) {
    const Setting& most = *settings[group.front()];
    const bool white_before = most.whitener_->changes_nothing();
    Panel whitened;
    Eigen::MatrixXd own;
    if (!white_before) whitened = most.whitener_->apply(columns, own);
    const Panel& white = white_before ? columns : whitened;
    const Eigen::MatrixXd products = cross_products(most.against_, white, 0, white.rows());
    if (white_before || width > 1) own = neighbour_products(white, width, 0, white.rows());
    for (const std::size_t i : group) settings[i]->without_common(products, own, 0, all[i]);
  }
  return all;
}

void Setting::without_common(const Eigen::MatrixXd& products, const Eigen::MatrixXd& own,
                             std::size_t first, EquationsTable& table) const {
  const Eigen::MatrixXd shared = factor_.matrixL().solve(products.middleRows(1, precision_.size()));
  const Eigen::VectorXd right = products.row(0).transpose() - shared.transpose() * common_residual_;
  for (Eigen::Index at = 0; at < own.cols(); at += table.width(), ++first) {
    const auto beside = shared.middleCols(at, table.width());
    auto square = table.square(first);
    for (Eigen::Index i = 0; i < table.width(); ++i)
      for (Eigen::Index j = i; j < table.width(); ++j)
        square(i, j) = square(j, i) = own(j - i, at + i) - beside.col(i).dot(beside.col(j));
    table.right(first) = right.segment(at, table.width());
  }
}

double Setting::twice_log_likelihood(double squares) const {
  const double floor = 1e-9 * present_rows_;
  return -present_rows_ * std::log(std::max(squares, floor) / present_rows_) - log_determinant_;
}

OutputEvidence::OutputEvidence(const MeasuredData& data, const StackedRows& rows,
                               std::size_t output)
    : rows_(rows),
      output_(output),
      present_(rows.time_s.size()),
      measured_residual_(Column::Zero(rows.time_s.size())),
      offsets_(
          Eigen::MatrixXd::Zero(rows.time_s.size(), static_cast<Eigen::Index>(data.runs.size()))),
      no_columns_(rows.time_s.size(), 0) {
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    const MeasuredRun& run = data.runs[i];
    const Block& block = rows.runs[i];
    const Eigen::Index count = block.end - block.begin;
    const Column residual = (run.measured_um[output] - run.model_um[output]).tail(count);
    present_.segment(block.begin, count) = residual.array().isFinite();
    measured_residual_.segment(block.begin, count) =
        residual.array().isFinite().select(residual, 0.0);
    offsets_.block(block.begin, static_cast<Eigen::Index>(i), count, 1).setOnes();
  }
  measured_ = present_.count() > measured_rows_min;
  complete_ = present_.all();
  residual_ = measured_residual_;
  noise_um_ = noise_of(residual_, present_, rows.runs);
  if (output < data.least_noise_um.size())
    noise_um_ = std::max(noise_um_, data.least_noise_um[output]);
  coefficient_columns_ = coefficient_columns_of(data, rows, output, present_, noise_um_);
  accept({});
}

double OutputEvidence::centred_rms(const Column& values) const {
  double sum = 0.0;
  for (const Block& run : rows_.runs) {
    const Eigen::Index count = run.end - run.begin;
    const auto present = present_.segment(run.begin, count);
    const auto of_run = values.segment(run.begin, count).array();
    const double n = std::max(1.0, static_cast<double>(present.count()));
    const double mean = present.select(of_run, 0.0).sum() / n;
    sum += present.select((of_run - mean).square(), 0.0).sum();
  }
  return std::sqrt(sum / std::max(1.0, static_cast<double>(present_.count())));
}

Column OutputEvidence::measured(const MeasuredData& data) const {
  Column all(rows_.time_s.size());
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    const Block& block = rows_.runs[i];
    all.segment(block.begin, block.end - block.begin) =
        data.runs[i].measured_um[output_].tail(block.end - block.begin);
  }
  return present_.select(all, 0.0);
}

void OutputEvidence::accept(const std::vector<Explanation>& found) {
  residual_ = measured_residual_;
  std::vector<Eigen::MatrixXd> free;
  Eigen::Index free_columns = 0;
  for (const Explanation& each : found) {
    if (each.gains[output_].size() == 0) continue;
    const Eigen::MatrixXd columns = columns_of(*each.hypothesis, each.shape, *this);
    if (each.hypothesis->form == Form::own_gains) {
      // In um, so that one prior fits all units.
      const double scale = std::max(1e-12, columns.cwiseAbs().maxCoeff());
      free.emplace_back(columns / scale);
      free_columns += columns.cols();
    } else {
      residual_ -= columns * each.gains[output_];
    }
  }
  free_columns_.resize(rows_.time_s.size(), free_columns);
  Eigen::Index at = 0;
  for (const Eigen::MatrixXd& columns : free) {
    free_columns_.middleCols(at, columns.cols()) = columns;
    at += columns.cols();
  }
  add_settings();
  doubted_ = {};
  if (coefficients_doubted_) add_doubted_settings();
}

void OutputEvidence::doubt_coefficients(bool doubted) {
  coefficients_doubted_ = doubted;
  if (doubted && doubted_.settings.empty()) add_doubted_settings();
}

void OutputEvidence::Stance::find_likeliest() {
  const auto likelihood = [](const auto& setting) {
    return setting->twice_log_likelihood(setting->squares());
  };
  likeliest = std::max_element(settings.begin(), settings.end(), [&](const auto& a, const auto& b) {
                return likelihood(a) < likelihood(b);
              })->get();
}

void OutputEvidence::add_settings() {
  Eigen::MatrixXd common(rows_.time_s.size(), offsets_.cols() + free_columns_.cols());
  common << offsets_, free_columns_;
  for (Eigen::Index row = 0; row < common.rows(); ++row)
    if (!present_[row]) common.row(row).setZero();
  const double variance = noise_um_ * noise_um_;
  Eigen::VectorXd precision =
      Eigen::VectorXd::Constant(common.cols(), variance / (accepted_sd_um * accepted_sd_um));
  precision.head(offsets_.cols()).setConstant(variance / (offset_sd_um * offset_sd_um));
  right_ = {};
  for (const NoiseShape& shape : noise_shapes(centred_rms(residual_), noise_um_))
    right_.settings.push_back(
        std::make_unique<Setting>(shape, rows_, present_, residual_, common, precision));
  right_.find_likeliest();
}

void OutputEvidence::add_doubted_settings() {
  for (const auto& right : right_.settings) {
    // The likelihood knows noise and prior by a common factor only, which the prior must not have:
    // large noise would make large errors likely. The factor is that of the same noise when the
    // coefficients are right.
    doubted_.settings.push_back(std::make_unique<Setting>(
        *right, coefficient_columns_, right->squares() / right->present_rows()));
  }
  doubted_.find_likeliest();
}

void OutputEvidence::clear_missing(Panel& columns) const {
  if (complete_) return;
  for (Eigen::Index row = 0; row < columns.rows(); ++row)
    if (!present_[row]) columns.row(row).setZero();
}

Panel columns_of(const Hypothesis& hypothesis, const Shapes& shapes,
                 const OutputEvidence& evidence) {
  Panel columns = hypothesis.columns(shapes, evidence.output());
  evidence.clear_missing(columns);
  return columns;
}

Eigen::MatrixXd columns_of(const Hypothesis& hypothesis, const Shape& shape,
                           const OutputEvidence& evidence) {
  return columns_of(hypothesis, Shapes{shape}, evidence);
}

}  // namespace thermocomp::diagnosis
