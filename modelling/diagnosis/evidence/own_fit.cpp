#include "modelling/diagnosis/evidence/own_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace thermocomp::diagnosis {
namespace {

/// An output's coefficients come from a fit when what the same fit predicts differs from what the
/// model predicts by less than this share of the residual's squares. Rows that a model was not
/// fitted to leave a residual of which any new fit takes much more.
constexpr double difference_max = 0.02;
/// Of fewer rows an input every fit leaves nothing.
constexpr double rows_an_input_min = 8.0;
/// In place of none: what is fitted need not be independent.
constexpr double no_ridge = 1e-10;
constexpr double ridge_max = 1.0;
/// What is sought around the best ridge stays below.
constexpr double ridge_tried_max = 4.0;

Eigen::MatrixXd rises_of(const MeasuredData& data, const StackedRows& rows) {
  Eigen::MatrixXd rises_K(rows.time_s.size(), static_cast<Eigen::Index>(data.model.inputs.size()));
  for (std::size_t input = 0; input < data.model.inputs.size(); ++input)
    for (std::size_t run = 0; run < data.runs.size(); ++run) {
      const Block& block = rows.runs[run];
      const Eigen::Index count = block.end - block.begin;
      rises_K.col(static_cast<Eigen::Index>(input)).segment(block.begin, count) =
          data.runs[run].inputs_K[input].tail(count);
    }
  return rises_K;
}

/// Measured less model; NaN where missing.
Eigen::VectorXd residual_of(const MeasuredData& data, const StackedRows& rows, std::size_t output) {
  Eigen::VectorXd residual(rows.time_s.size());
  for (std::size_t run = 0; run < data.runs.size(); ++run) {
    const Block& block = rows.runs[run];
    const MeasuredRun& of = data.runs[run];
    residual.segment(block.begin, block.end - block.begin) =
        (of.measured_um[output] - of.model_um[output]).tail(block.end - block.begin);
  }
  return residual;
}

/// Each run's mean over the rows that are present is taken off.
void centre(Eigen::Ref<Eigen::VectorXd> column, const std::vector<Block>& runs,
            const Eigen::Array<bool, Eigen::Dynamic, 1>& present) {
  for (const Block& run : runs) {
    const Eigen::Index count = run.end - run.begin;
    const auto used = present.segment(run.begin, count);
    auto of_run = column.segment(run.begin, count).array();
    const double mean =
        used.select(of_run, 0.0).sum() / std::max(1.0, static_cast<double>(used.count()));
    of_run = used.select(of_run - mean, 0.0);
  }
}

/// Mean square over the rows, of which there are `count`, less the square of the mean.
double variance_of(const Eigen::Ref<const Eigen::VectorXd>& column, double count) {
  const double mean = column.sum() / count;
  return column.squaredNorm() / count - mean * mean;
}

/// Whether there is a ridge in [0, ridge_tried_max] with |a - ridge b| <= c + ridge d.
bool some_ridge_keeps(double a, double b, double c, double d) {
  double least = 0.0;
  double most = ridge_tried_max;
  for (const double sign : {1.0, -1.0}) {
    const double from = sign * a - c;  // from <= ridge * slope
    const double slope = sign * b + d;
    if (slope > 0) least = std::max(least, from / slope);
    if (slope < 0) most = std::min(most, from / slope);
    if (slope == 0 && from > 0) return false;
  }
  return !(least > most);
}

}  // namespace

/// Whether a fit of this way, with whatever ridge, may have given an output its coefficients k.
/// With the rises D as they are fitted, S = D'D / rows, the residual r and g = D'r / rows, a fit
/// with a ridge lies a from k where S a + ridge a = g - ridge k. In u'S times it
///
///   |u'S g - ridge u'S k| <= |a| (|S u| + ridge |u|),  |x| = sqrt(x'S x)
///
/// for every u. A small |a| is what difference() asks for; u = g shows what no ridge can do without
/// S itself, which takes most of the time of recognising a fit.
bool OwnFit::may_come_from(const Way& way, const Present& present, const Eigen::VectorXd& residual,
                           const Eigen::Map<const Eigen::VectorXd>& coefficients) const {
  const auto rows = static_cast<double>(present.count());
  if (!(rows > rows_an_input_min * static_cast<double>(coefficients.size()))) return false;
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(rises_K_.cols());
  for (Eigen::Index input = 0; way.standardised && input < rises_K_.cols(); ++input) {
    const Eigen::VectorXd rise_K = present.select(rises_K_.col(input), 0.0);
    const double variance = variance_of(rise_K, rows);
    if (variance > 0) scale[input] = std::sqrt(variance);
  }
  const auto fitted = [&](const Eigen::VectorXd& column) {
    Eigen::VectorXd used = present.select(column, 0.0);
    if (way.offsets) centre(used, runs_, present);
    return used;
  };
  const auto of_inputs = [&](const Eigen::VectorXd& x) {
    return fitted(rises_K_ * x.cwiseQuotient(scale));
  };
  const auto with_inputs = [&](const Eigen::VectorXd& column) -> Eigen::VectorXd {
    return (rises_K_.transpose() * column).cwiseQuotient(scale) / rows;
  };
  const Eigen::VectorXd left = fitted(residual);
  const Eigen::VectorXd g = with_inputs(left);
  const Eigen::VectorXd predicted = of_inputs(g);
  const Eigen::VectorXd Sg = with_inputs(predicted);
  const double apart_max = 1.01 * std::sqrt(difference_max * left.squaredNorm() / rows);
  return some_ridge_keeps(Sg.dot(g), Sg.dot(coefficients.cwiseProduct(scale)),
                          apart_max * of_inputs(Sg).norm() / std::sqrt(rows),
                          apart_max * predicted.norm() / std::sqrt(rows));
}

bool OwnFit::may_be_recognised(const MeasuredData& data, const StackedRows& rows) const {
  for (std::size_t output = 0; output < data.model.outputs.size(); ++output) {
    const Eigen::VectorXd residual = residual_of(data, rows, output);
    const Present present = residual.array().isFinite();
    const Eigen::Map<const Eigen::VectorXd> coefficients(data.model.matrix_um_per_K[output].data(),
                                                         rises_K_.cols());
    for (const bool offsets : {false, true})
      for (const bool standardised : {true, false})
        if (may_come_from({offsets, standardised, 0.0}, present, residual, coefficients))
          return true;
  }
  return false;
}

OwnFit::Design OwnFit::design_of(const StackedRows& rows, const Present& present,
                                 const Way& way) const {
  Design design{present, rises_K_, {}, {}, std::max(1.0, static_cast<double>(present.count()))};
  design.scale.setOnes(rises_K_.cols());
  for (Eigen::Index input = 0; input < rises_K_.cols(); ++input) {
    auto column = design.fitted.col(input);
    column = present.select(column, 0.0);
    const double variance = variance_of(column, design.rows);
    if (way.offsets) centre(column, rows.runs, present);
    if (!way.standardised || !(variance > 0)) continue;
    design.scale[input] = std::sqrt(variance);
    column /= design.scale[input];
  }
  design.square = design.fitted.transpose() * design.fitted / design.rows;
  return design;
}

std::vector<OwnFit::OfOutput> OwnFit::fits_of(const MeasuredData& data, const StackedRows& rows,
                                              const Way& way) const {
  std::vector<OfOutput> fits;
  for (std::size_t output = 0; output < data.model.outputs.size(); ++output) {
    Eigen::VectorXd residual = residual_of(data, rows, output);
    const Present present = residual.array().isFinite();
    residual = present.select(residual, 0.0);
    if (way.offsets) centre(residual, rows.runs, present);
    OfOutput of;
    if (!fits.empty() && (fits.back().design->present == present).all())
      of.design = fits.back().design;
    else
      of.design = std::make_shared<const Design>(design_of(rows, present, way));
    of.known = Eigen::Map<const Eigen::VectorXd>(data.model.matrix_um_per_K[output].data(),
                                                 rises_K_.cols())
                   .cwiseProduct(of.design->scale);
    of.right =
        of.design->fitted.transpose() * residual / of.design->rows + of.design->square * of.known;
    of.mean_square = residual.squaredNorm() / of.design->rows;
    of.residual = std::move(residual);
    fits.push_back(std::move(of));
  }
  return fits;
}

/// Mean square of what a fit with this ridge predicts less what the model predicts, over that of
/// the residual.
double OwnFit::difference(const OfOutput& of, double ridge) {
  const bool enough = of.design->rows > rows_an_input_min * static_cast<double>(of.known.size());
  if (!enough || !(of.mean_square > 0)) return std::numeric_limits<double>::infinity();
  Eigen::MatrixXd square = of.design->square;
  square.diagonal().array() += ridge;
  const Eigen::VectorXd apart = square.ldlt().solve(of.right) - of.known;
  const double share = apart.dot(of.design->square * apart) / of.mean_square;
  return std::isfinite(share) ? share : std::numeric_limits<double>::infinity();
}

/// Summed over the outputs; one that comes from elsewhere counts 1.
double OwnFit::difference(const std::vector<OfOutput>& all, double ridge) {
  double sum = 0.0;
  for (const OfOutput& of : all) sum += std::min(1.0, difference(of, ridge));
  return sum;
}

double OwnFit::likeliest_ridge(const std::vector<OfOutput>& all) {
  double best = no_ridge;
  double least = difference(all, best);
  const auto try_ridge = [&](double ridge) {
    const double sum = difference(all, ridge);
    if (!(sum < least)) return;
    least = sum;
    best = ridge;
  };
  for (double ridge = 1e-8; ridge <= ridge_max; ridge *= std::sqrt(10.0)) try_ridge(ridge);
  if (best == no_ridge) return best;
  for (double factor = std::pow(10.0, 0.25); factor > 1.001; factor = std::sqrt(factor)) {
    const double centre = best;
    try_ridge(centre * factor);
    try_ridge(centre / factor);
  }
  return best;
}

std::optional<OwnFit> OwnFit::recognised(const MeasuredData& data, const StackedRows& rows) {
  if (!data.model.guideways.empty()) return std::nullopt;
  OwnFit best;
  best.rises_K_ = rises_of(data, rows);
  best.runs_ = rows.runs;
  if (!best.may_be_recognised(data, rows)) return std::nullopt;
  double least = std::numeric_limits<double>::infinity();
  for (const bool offsets : {false, true})
    for (const bool standardised : {true, false}) {
      Way way{offsets, standardised, 0.0};
      std::vector<OfOutput> fits = best.fits_of(data, rows, way);
      way.ridge = likeliest_ridge(fits);
      const double sum = difference(fits, way.ridge);
      if (!(sum < least)) continue;
      least = sum;
      best.way_ = way;
      best.fits_ = std::move(fits);
    }
  for (std::size_t output = 0; output < best.fits_.size(); ++output) {
    const OfOutput& of = best.fits_[output];
    Eigen::MatrixXd square = of.design->square;
    square.diagonal().array() += best.way_.ridge;
    best.factors_.emplace_back(square);
    if (difference(of, best.way_.ridge) < difference_max) best.outputs_.push_back(output);
  }
  if (best.outputs_.empty()) return std::nullopt;
  return best;
}

Eigen::MatrixXd OwnFit::absorbed(const Eigen::MatrixXd& columns, std::size_t output) const {
  const Design& design = *fits_[output].design;
  const Eigen::MatrixXd scaled =
      factors_[output].solve(design.fitted.transpose() * columns / design.rows);
  return design.scale.cwiseInverse().asDiagonal() * scaled;
}

Eigen::MatrixXd OwnFit::predicted(const Eigen::MatrixXd& columns, std::size_t output) const {
  return rises_K_ * absorbed(columns, output);
}

/// With M = 1 - Z (Z'Z + rows ridge)^-1 Z' the fit makes d' M d least, and leaves M d. With columns
/// C of gains g it is (d - C g)' M (d - C g), least where C' M C g = C' M d.
OwnFit::Refit OwnFit::refit_with(const Eigen::MatrixXd& columns, std::size_t output) const {
  const OfOutput& of = fits_[output];
  const Design& design = *of.design;
  Eigen::MatrixXd present = columns;
  for (Eigen::Index row = 0; row < present.rows(); ++row)
    if (!design.present[row]) present.row(row).setZero();
  if (way_.offsets)
    for (Eigen::Index column = 0; column < present.cols(); ++column)
      centre(present.col(column), runs_, design.present);
  const Eigen::MatrixXd right = design.fitted.transpose() * present;
  const Eigen::MatrixXd square = present.transpose() * present -
                                 right.transpose() * factors_[output].solve(right) / design.rows;
  const Eigen::VectorXd with_residual = present.transpose() * of.residual;
  const Eigen::VectorXd displacement = of.residual + design.fitted * of.known;
  const double before = displacement.dot(of.residual);
  Refit refit{square.ldlt().solve(with_residual), 1.0};
  if (before > 0) refit.left_share = 1.0 - refit.gains.dot(with_residual) / before;
  return refit;
}

}  // namespace thermocomp::diagnosis
