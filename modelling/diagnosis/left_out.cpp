#include "modelling/diagnosis/left_out.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Cholesky>

namespace thermocomp::diagnosis {
namespace {

/// Whitened cross products of one output, block by block: common columns, hypothesis, residual.
struct BlockProducts {
  std::vector<Eigen::MatrixXd> blocks;
  Eigen::MatrixXd total;
  Eigen::Index common{0};
  Eigen::Index free{0};
};

BlockProducts products(const Setting& setting, const Eigen::MatrixXd& columns,
                       const StackedRows& rows) {
  BlockProducts result;
  result.common = setting.common().cols();
  result.free = columns.cols();
  Eigen::MatrixXd all(columns.rows(), result.common + result.free + 1);
  all.leftCols(result.common) = setting.common();
  all.middleCols(result.common, result.free) = setting.whitener().apply_all(columns);
  all.rightCols(1) = setting.residual();
  result.total = Eigen::MatrixXd::Zero(all.cols(), all.cols());
  for (Eigen::Index i = 0; i < result.common; ++i) result.total(i, i) = setting.precision()[i];
  for (const Block& block : rows.blocks) {
    const auto part = all.middleRows(block.begin, block.end - block.begin);
    result.blocks.emplace_back(part.transpose() * part);
    result.total += result.blocks.back();
  }
  return result;
}

/// Normal equations of the hypothesis without one block, the common columns taken out.
struct Reduced {
  Eigen::MatrixXd square;
  Eigen::VectorXd right;
  double squares{0.0};
  Eigen::MatrixXd carried;  ///< what the common columns carry of each other one
};

/// @param block  none of them: all rows stay
Reduced without_block(const BlockProducts& products, std::optional<std::size_t> block) {
  Eigen::MatrixXd rest = products.total;
  if (block) rest -= products.blocks[*block];
  const Eigen::Index n = products.common;
  const Eigen::Index m = products.free + 1;
  const Eigen::MatrixXd carried = rest.topLeftCorner(n, n).ldlt().solve(rest.topRightCorner(n, m));
  const Eigen::MatrixXd reduced =
      rest.bottomRightCorner(m, m) - rest.bottomLeftCorner(m, n) * carried;
  return {reduced.topLeftCorner(products.free, products.free),
          reduced.topRightCorner(products.free, 1), reduced(m - 1, m - 1), carried};
}

/// Finer grids than this are only searched anew around the peak.
constexpr std::size_t whole_grid_max = 40;
constexpr std::ptrdiff_t near_points = 3;

bool near(const ShapeParameter& parameter, double value, double peak) {
  const auto closer = [peak](double a, double b) {
    return std::abs(a - peak) < std::abs(b - peak);
  };
  const auto& grid = parameter.grid;
  const auto nearest = std::min_element(grid.begin(), grid.end(), closer) - grid.begin();
  const auto at = std::find(grid.begin(), grid.end(), value) - grid.begin();
  return std::abs(at - nearest) <= near_points;
}

std::vector<std::vector<double>> shapes_of(const Explanation& explanation) {
  std::vector<std::vector<double>> shapes = {{}};
  for (std::size_t i = 0; i < explanation.hypothesis->shape.size(); ++i) {
    const ShapeParameter& parameter = explanation.hypothesis->shape[i];
    std::vector<std::vector<double>> longer;
    for (const auto& shape : shapes)
      for (const double value : parameter.grid) {
        if (parameter.grid.size() > whole_grid_max && !near(parameter, value, explanation.shape[i]))
          continue;
        longer.push_back(shape);
        longer.back().push_back(value);
      }
    shapes = std::move(longer);
  }
  if (!explanation.shape.empty()) shapes.push_back(explanation.shape);
  return shapes;
}

/// Of an output in some rows.
struct Squares {
  double measured{0.0};  ///< what there is to explain
  double beside{0.0};    ///< what errors of the coefficients leave of it
  double after{0.0};     ///< what the hypothesis leaves of that
  double alone{0.0};     ///< what it leaves with the coefficients as they are
  Squares& operator+=(const Squares& other) {
    measured += other.measured;
    beside += other.beside;
    after += other.after;
    alone += other.alone;
    return *this;
  }
};

/// The same as columns.
using Left = std::array<Column, 4>;

/// Squares in a block when each run's mean outside of it is taken off.
Squares squares_in_block(const OutputEvidence& evidence, const Left& left, const StackedRows& rows,
                         const Block& block) {
  std::array<double, 4> sum{};
  for (const Block& run : rows.runs) {
    if (block.begin < run.begin || block.begin >= run.end) continue;
    const bool alone = block.begin == run.begin && block.end == run.end;
    double count = 0.0;
    std::array<double, 4> mean_um{};
    for (Eigen::Index row = run.begin; row < run.end; ++row) {
      const bool inside = row >= block.begin && row < block.end;
      if (!evidence.present()[row] || (inside && !alone)) continue;
      for (std::size_t i = 0; i < left.size(); ++i) mean_um[i] += left[i][row];
      count += 1.0;
    }
    if (!(count > 0)) continue;
    for (Eigen::Index row = block.begin; row < block.end; ++row) {
      if (!evidence.present()[row]) continue;
      for (std::size_t i = 0; i < left.size(); ++i) {
        const double value_um = left[i][row] - mean_um[i] / count;
        sum[i] += value_um * value_um;
      }
    }
  }
  return {sum[0], sum[1], sum[2], sum[3]};
}

/// Gains of the hypothesis from the rows without a block, and what 2 ln L loses by the misfit.
struct BlockFit {
  double misfit{std::numeric_limits<double>::infinity()};
  std::vector<Eigen::VectorXd> gains;
  std::vector<Eigen::VectorXd> common;  ///< of the common columns, beside the hypothesis
};

BlockFit fit_without(const Explanation& explanation, const std::vector<std::size_t>& acting,
                     const std::vector<BlockProducts>& products, std::optional<std::size_t> block) {
  std::vector<Reduced> reduced;
  reduced.reserve(products.size());
  for (const BlockProducts& each : products) reduced.push_back(without_block(each, block));
  BlockFit fit{0.0, {}, {}};
  double square = 0.0;
  double right = 0.0;
  for (std::size_t i = 0; i < acting.size(); ++i) {
    const double variance = explanation.settings[acting[i]]->squares();
    square += reduced[i].square(0, 0) / variance;
    right += reduced[i].right[0] / variance;
  }
  for (std::size_t i = 0; i < acting.size(); ++i) {
    Eigen::VectorXd gains = Eigen::VectorXd::Ones(1);
    if (explanation.hypothesis->form == Form::own_gains)
      gains = reduced[i].square.ldlt().solve(reduced[i].right);
    else if (explanation.hypothesis->form == Form::shared_gain)
      gains *= square > 0 ? right / square : 0.0;
    const double squares = reduced[i].squares - 2.0 * gains.dot(reduced[i].right) +
                           gains.dot(reduced[i].square * gains);
    fit.misfit +=
        explanation.settings[acting[i]]->present_rows() * std::log(std::max(squares, 1e-12));
    fit.gains.push_back(gains);
    fit.common.emplace_back(reduced[i].carried.rightCols(1) -
                            reduced[i].carried.leftCols(gains.size()) * gains);
  }
  return fit;
}

/// Of an output's common columns without any hypothesis.
BlockProducts common_products(const OutputEvidence& evidence, const StackedRows& rows) {
  return products(evidence.setting(), Eigen::MatrixXd(rows.time_s.size(), 0), rows);
}

/// What the last of the common gains, those of accepted explanations, leave of the residual, and
/// what those of wrong coefficients leave of that.
std::array<Column, 2> left_by(const OutputEvidence& evidence, const Eigen::VectorXd& common) {
  const Eigen::MatrixXd& accepted = evidence.free_columns();
  const Eigen::MatrixXd& coefficients = evidence.coefficient_columns();
  const Column left = evidence.residual() - accepted * common.tail(accepted.cols());
  const Eigen::Index first = common.size() - accepted.cols() - coefficients.cols();
  return {left, left - coefficients * common.segment(first, coefficients.cols())};
}

/// What a fit leaves of the output number `i` of those acted on.
/// @param common_without  gains of the common columns without the hypothesis
Left left_of(const BlockFit& fit, std::size_t i, const OutputEvidence& evidence,
             const Explanation& explanation, const std::vector<double>& shape,
             const Eigen::VectorXd& common_without) {
  const Column measured = left_by(evidence, common_without)[0];
  const auto [accepted_taken, beside] = left_by(evidence, fit.common[i]);
  const Column explained = columns_of(*explanation.hypothesis, shape, evidence) * fit.gains[i];
  return {measured, beside, beside - explained, accepted_taken - explained};
}

std::vector<std::size_t> acting_outputs(const Explanation& explanation) {
  std::vector<std::size_t> acting;
  for (std::size_t i = 0; i < explanation.gains.size(); ++i)
    if (explanation.gains[i].size() > 0) acting.push_back(i);
  return acting;
}

double log_ratio(double after, double before) {
  return before > 0 ? 0.5 * std::log(std::max(after / before, 1e-12)) : 0.0;
}

/// @param by_output  of the outputs that it acts on
LeftOutGain gain_of(const std::vector<Squares>& by_output) {
  LeftOutGain gain;
  double left = 0.0;
  double left_alone = 0.0;
  double outputs = 0.0;
  double all_before = 0.0;
  double all_after = 0.0;
  for (const Squares& squares : by_output) {
    // A hypothesis that only undoes what it makes the coefficients do has explained nothing, and
    // knowing it alone must be a gain: the coefficients of the extended model stay as they are.
    const double before = std::min(squares.measured, squares.beside);
    all_before += before;
    all_after += squares.after;
    if (!(before > 0)) continue;
    left += squares.after / before;
    left_alone += squares.alone / squares.measured;
    outputs += 1.0;
    gain.log_left += log_ratio(squares.after, squares.measured);
  }
  if (outputs > 0) gain.share = 1.0 - std::sqrt(std::max(left, left_alone) / outputs);
  if (all_before > 0) gain.share_of_all = 1.0 - std::sqrt(all_after / all_before);
  return gain;
}

}  // namespace

double log_left_without(const OutputEvidence& evidence, const StackedRows& rows) {
  if (evidence.coefficient_columns().cols() == 0) return 0.0;
  const BlockProducts common = common_products(evidence, rows);
  Squares sum;
  for (std::size_t block = 0; block < rows.blocks.size(); ++block) {
    const auto without = left_by(evidence, without_block(common, block).carried);
    sum += squares_in_block(evidence, {without[0], without[1], without[1], without[1]}, rows,
                            rows.blocks[block]);
  }
  return log_ratio(sum.after, sum.measured);
}

LeftOutGain gain_on_left_out_blocks(const Explanation& explanation, const StackedRows& rows,
                                    const std::vector<OutputEvidence>& outputs) {
  const std::vector<std::size_t> acting = acting_outputs(explanation);
  const std::size_t blocks = rows.blocks.size();
  if (blocks < 2) return {};
  std::vector<BlockFit> best(blocks);
  std::vector<std::vector<double>> best_shape(blocks);
  for (const std::vector<double>& shape : shapes_of(explanation)) {
    std::vector<BlockProducts> all;
    all.reserve(acting.size());
    for (const std::size_t output : acting)
      all.push_back(products(*explanation.settings[output],
                             columns_of(*explanation.hypothesis, shape, outputs[output]), rows));
    for (std::size_t block = 0; block < blocks; ++block) {
      BlockFit fit = fit_without(explanation, acting, all, block);
      if (!(fit.misfit < best[block].misfit)) continue;
      best[block] = std::move(fit);
      best_shape[block] = shape;
    }
  }
  std::vector<Squares> sums(acting.size());
  for (std::size_t i = 0; i < acting.size(); ++i) {
    const OutputEvidence& evidence = outputs[acting[i]];
    const BlockProducts common = common_products(evidence, rows);
    for (std::size_t block = 0; block < blocks; ++block) {
      if (best[block].gains.empty()) continue;
      const Left left = left_of(best[block], i, evidence, explanation, best_shape[block],
                                without_block(common, block).carried);
      sums[i] += squares_in_block(evidence, left, rows, rows.blocks[block]);
    }
  }
  return gain_of(sums);
}

LeftOutGain gain_on_fitted_rows(const Explanation& explanation, const StackedRows& rows,
                                const std::vector<OutputEvidence>& outputs) {
  const std::vector<std::size_t> acting = acting_outputs(explanation);
  std::vector<BlockProducts> all;
  all.reserve(acting.size());
  for (const std::size_t output : acting)
    all.push_back(products(*explanation.settings[output],
                           columns_of(*explanation.hypothesis, explanation.shape, outputs[output]),
                           rows));
  const BlockFit fit = fit_without(explanation, acting, all, std::nullopt);
  std::vector<Squares> sums(acting.size());
  for (std::size_t i = 0; i < acting.size(); ++i) {
    const OutputEvidence& evidence = outputs[acting[i]];
    const BlockProducts common = common_products(evidence, rows);
    Left left;
    left.fill(Column::Zero(rows.time_s.size()));
    for (std::size_t block = 0; block < rows.blocks.size(); ++block) {
      BlockFit without = fit;
      const Eigen::MatrixXd carried = without_block(all[i], block).carried;
      without.common[i] =
          carried.rightCols(1) - carried.leftCols(fit.gains[i].size()) * fit.gains[i];
      const Left part = left_of(without, i, evidence, explanation, explanation.shape,
                                without_block(common, block).carried);
      const Block& of = rows.blocks[block];
      for (std::size_t k = 0; k < left.size(); ++k)
        left[k].segment(of.begin, of.end - of.begin) = part[k].segment(of.begin, of.end - of.begin);
    }
    for (const Block& run : rows.runs) sums[i] += squares_in_block(evidence, left, rows, run);
  }
  return gain_of(sums);
}

}  // namespace thermocomp::diagnosis
