#include "modelling/diagnosis/left_out.hpp"

#include <algorithm>
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

struct Squares {
  double before{0.0};
  double after{0.0};
};

/// What is left of an output without (`before`) and with the hypothesis.
struct Left {
  Column before;
  Column after;
};

/// Squares of both in a block when each run's mean outside of it is taken off.
Squares squares_in_block(const OutputEvidence& evidence, const Left& left, const StackedRows& rows,
                         const Block& block) {
  Squares sum;
  for (const Block& run : rows.runs) {
    if (block.begin < run.begin || block.begin >= run.end) continue;
    const bool alone = block.begin == run.begin && block.end == run.end;
    double before_um = 0.0;
    double after_um = 0.0;
    double count = 0.0;
    for (Eigen::Index row = run.begin; row < run.end; ++row) {
      const bool inside = row >= block.begin && row < block.end;
      if (!evidence.present()[row] || (inside && !alone)) continue;
      before_um += left.before[row];
      after_um += left.after[row];
      count += 1.0;
    }
    if (!(count > 0)) continue;
    for (Eigen::Index row = block.begin; row < block.end; ++row) {
      if (!evidence.present()[row]) continue;
      const double before = left.before[row] - before_um / count;
      const double after = left.after[row] - after_um / count;
      sum.before += before * before;
      sum.after += after * after;
    }
  }
  return sum;
}

/// Gains of the hypothesis from the rows without a block, and what 2 ln L loses by the misfit.
struct BlockFit {
  double misfit{std::numeric_limits<double>::infinity()};
  std::vector<Eigen::VectorXd> gains;
  /// Gains of the accepted columns, without and with the hypothesis.
  std::vector<Eigen::VectorXd> accepted_before;
  std::vector<Eigen::VectorXd> accepted_after;
};

BlockFit fit_without(const Explanation& explanation, const std::vector<std::size_t>& acting,
                     const std::vector<BlockProducts>& products, std::optional<std::size_t> block) {
  std::vector<Reduced> reduced;
  reduced.reserve(products.size());
  for (const BlockProducts& each : products) reduced.push_back(without_block(each, block));
  BlockFit fit{0.0, {}, {}, {}};
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
    const Eigen::VectorXd before = reduced[i].carried.rightCols(1);
    fit.accepted_before.push_back(before);
    fit.accepted_after.emplace_back(before - reduced[i].carried.leftCols(gains.size()) * gains);
  }
  return fit;
}

/// What a fit leaves of the output number `i` of those acted on.
Left left_of(const BlockFit& fit, std::size_t i, const OutputEvidence& evidence,
             const Explanation& explanation, const std::vector<double>& shape) {
  const Eigen::MatrixXd& accepted = evidence.free_columns();
  Left left{evidence.residual(), evidence.residual()};
  left.before -= accepted * fit.accepted_before[i].tail(accepted.cols());
  left.after -= accepted * fit.accepted_after[i].tail(accepted.cols());
  left.after -= columns_of(*explanation.hypothesis, shape, evidence) * fit.gains[i];
  return left;
}

std::vector<std::size_t> acting_outputs(const Explanation& explanation) {
  std::vector<std::size_t> acting;
  for (std::size_t i = 0; i < explanation.gains.size(); ++i)
    if (explanation.gains[i].size() > 0) acting.push_back(i);
  return acting;
}

/// @param by_output  of the outputs that it acts on
LeftOutGain gain_of(const std::vector<Squares>& by_output) {
  LeftOutGain gain;
  double left = 0.0;
  double outputs = 0.0;
  Squares all;
  for (const Squares& squares : by_output) {
    all.before += squares.before;
    all.after += squares.after;
    if (!(squares.before > 0)) continue;
    const double ratio = squares.after / squares.before;
    left += ratio;
    outputs += 1.0;
    gain.log_left += 0.5 * std::log(std::max(ratio, 1e-12));
  }
  if (outputs > 0) gain.share = 1.0 - std::sqrt(left / outputs);
  if (all.before > 0) gain.share_of_all = 1.0 - std::sqrt(all.after / all.before);
  return gain;
}

}  // namespace

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
  for (std::size_t block = 0; block < blocks; ++block) {
    for (std::size_t i = 0; i < best[block].gains.size(); ++i) {
      const OutputEvidence& evidence = outputs[acting[i]];
      const Left left = left_of(best[block], i, evidence, explanation, best_shape[block]);
      const Squares part = squares_in_block(evidence, left, rows, rows.blocks[block]);
      sums[i].before += part.before;
      sums[i].after += part.after;
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
    const Left left = left_of(fit, i, evidence, explanation, explanation.shape);
    for (const Block& run : rows.runs) {
      const Squares part = squares_in_block(evidence, left, rows, run);
      sums[i].before += part.before;
      sums[i].after += part.after;
    }
  }
  return gain_of(sums);
}

}  // namespace thermocomp::diagnosis
