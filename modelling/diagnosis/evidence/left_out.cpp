#include "modelling/diagnosis/evidence/left_out.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace thermocomp::diagnosis {
namespace {

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
/// @param left  0 in rows without a value
Squares squares_in_block(const OutputEvidence& evidence, const Left& left, const StackedRows& rows,
                         const Block& block) {
  std::array<double, 4> sum{};
  const Eigen::Index length = block.end - block.begin;
  const auto present_in = [&](const Block& of) {
    return evidence.complete() ? of.end - of.begin
                               : evidence.present().segment(of.begin, of.end - of.begin).count();
  };
  for (const Block& run : rows.runs) {
    if (block.begin < run.begin || block.begin >= run.end) continue;
    const bool alone = block.begin == run.begin && block.end == run.end;
    const Eigen::Index inside = present_in(block);
    const Eigen::Index count = present_in(run) - (alone ? 0 : inside);
    if (count == 0) continue;
    for (std::size_t i = 0; i < left.size(); ++i) {
      const auto of_block = left[i].segment(block.begin, length).array();
      const double of_run = left[i].segment(run.begin, run.end - run.begin).sum();
      const double mean_um = (of_run - (alone ? 0.0 : of_block.sum())) / static_cast<double>(count);
      sum[i] += (of_block - mean_um).square().sum() -
                static_cast<double>(length - inside) * mean_um * mean_um;
    }
  }
  return {sum[0], sum[1], sum[2], sum[3]};
}

/// What the common gains of accepted explanations leave of the residual, and what those of wrong
/// coefficients leave of that.
std::array<Column, 2> left_by(const OutputEvidence& evidence, const Eigen::VectorXd& common) {
  const Eigen::MatrixXd& accepted = evidence.free_columns();
  const Eigen::MatrixXd& coefficients = evidence.coefficient_columns();
  const Eigen::Index first = common.size() - coefficients.cols() - accepted.cols();
  const Column left = evidence.residual() - accepted * common.segment(first, accepted.cols());
  return {left, left - coefficients * common.tail(coefficients.cols())};
}

/// What a fit leaves of an output.
/// @param common  gains of the common columns beside the hypothesis
/// @param common_without  without it
Left left_of(const OutputEvidence& evidence, const Column& explained, const Eigen::VectorXd& common,
             const Eigen::VectorXd& common_without) {
  const Column measured = left_by(evidence, common_without)[0];
  const auto [accepted_taken, beside] = left_by(evidence, common);
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
  double least = std::numeric_limits<double>::infinity();
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
    least = std::min(least, squares.after / before);
    left_alone += squares.alone / squares.measured;
    outputs += 1.0;
    gain.log_left += log_ratio(squares.after, squares.measured);
  }
  if (outputs > 0) {
    gain.share = 1.0 - std::sqrt(std::max(left, left_alone) / outputs);
    gain.share_of_best = 1.0 - std::sqrt(least);
  }
  if (all_before > 0) gain.share_of_all = 1.0 - std::sqrt(all_after / all_before);
  return gain;
}

}  // namespace

const LeftOut::Common& LeftOut::common(const Setting& setting) {
  const auto known = common_.find(&setting);
  if (known != common_.end()) return known->second;
  const Panel& against = setting.against();
  const Eigen::Index n = setting.precision().size();
  std::vector<Eigen::MatrixXd> blocks;
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(1 + n, 1 + n);
  total.diagonal().tail(n) = setting.precision();
  for (const Block& block : rows_.blocks) {
    blocks.push_back(cross_products(against, against, block.begin, block.end));
    total += blocks.back();
  }
  blocks.emplace_back(Eigen::MatrixXd::Zero(1 + n, 1 + n));
  Common all;
  for (const Eigen::MatrixXd& block : blocks) {
    const Eigen::MatrixXd rest = total - block;
    CommonWithout without{rest.bottomRightCorner(n, n).ldlt(), {}, 0.0};
    without.carried = without.factor.solve(rest.col(0).tail(n));
    without.squares = rest(0, 0) - rest.col(0).tail(n).dot(without.carried);
    all.push_back(std::move(without));
  }
  return common_.emplace(&setting, std::move(all)).first->second;
}

std::vector<std::vector<LeftOut::Reduced>> LeftOut::reduced(const Setting& setting,
                                                            const Panel& columns,
                                                            Eigen::Index width) {
  const Common& common = this->common(setting);
  const Eigen::Index n = setting.precision().size();
  const Panel white = setting.whitener().apply(columns);
  struct Products {
    Eigen::MatrixXd against;
    Eigen::MatrixXd own;
  };
  std::vector<Products> blocks;
  Products total{Eigen::MatrixXd::Zero(1 + n, white.cols()),
                 Eigen::MatrixXd::Zero(width, white.cols())};
  for (const Block& block : rows_.blocks) {
    blocks.push_back({cross_products(setting.against(), white, block.begin, block.end),
                      neighbour_products(white, width, block.begin, block.end)});
    total.against += blocks.back().against;
    total.own += blocks.back().own;
  }
  blocks.push_back(
      {Eigen::MatrixXd::Zero(1 + n, white.cols()), Eigen::MatrixXd::Zero(width, white.cols())});
  std::vector<std::vector<Reduced>> groups(static_cast<std::size_t>(white.cols() / width));
  for (std::size_t block = 0; block < blocks.size(); ++block) {
    const Eigen::MatrixXd against = total.against - blocks[block].against;
    const Eigen::MatrixXd own = total.own - blocks[block].own;
    const Eigen::MatrixXd carried = common[block].factor.solve(against.bottomRows(n));
    for (std::size_t group = 0; group < groups.size(); ++group) {
      const Eigen::Index first = width * static_cast<Eigen::Index>(group);
      const auto beside = against.block(1, first, n, width);
      Reduced of{-beside.transpose() * carried.middleCols(first, width),
                 against.row(0).segment(first, width).transpose() -
                     beside.transpose() * common[block].carried,
                 common[block].squares, carried.middleCols(first, width)};
      for (Eigen::Index i = 0; i < width; ++i)
        for (Eigen::Index j = 0; j < width; ++j)
          of.square(i, j) += own(std::abs(i - j), first + std::min(i, j));
      groups[group].push_back(std::move(of));
    }
  }
  return groups;
}

LeftOut::BlockFit LeftOut::fit(const Explanation& explanation,
                               const std::vector<std::size_t>& acting,
                               const std::vector<const Reduced*>& reduced) const {
  BlockFit fit{0.0, {}, {}, 0};
  double square = 0.0;
  double right = 0.0;
  for (std::size_t i = 0; i < acting.size(); ++i) {
    const double variance = explanation.settings[acting[i]]->squares();
    square += reduced[i]->square(0, 0) / variance;
    right += reduced[i]->right[0] / variance;
  }
  for (std::size_t i = 0; i < acting.size(); ++i) {
    const Reduced& of = *reduced[i];
    Eigen::VectorXd gains = Eigen::VectorXd::Ones(1);
    if (explanation.hypothesis->form == Form::own_gains && of.right.size() == 1)
      gains[0] = of.square(0, 0) > 0 ? of.right[0] / of.square(0, 0) : 0.0;
    else if (explanation.hypothesis->form == Form::own_gains)
      gains = of.square.ldlt().solve(of.right);
    else if (explanation.hypothesis->form == Form::shared_gain)
      gains *= square > 0 ? right / square : 0.0;
    const double squares = of.squares - 2.0 * gains.dot(of.right) + gains.dot(of.square * gains);
    fit.misfit +=
        explanation.settings[acting[i]]->present_rows() * std::log(std::max(squares, 1e-12));
    fit.gains.push_back(gains);
  }
  return fit;
}

LeftOut::BlockFits LeftOut::best_without_each(const Explanation& explanation,
                                              const std::vector<std::size_t>& acting) {
  const Shapes shapes = shapes_of(explanation);
  BlockFits best{std::vector<BlockFit>(rows_.blocks.size()), {}};
  std::vector<std::vector<std::vector<Reduced>>> all;
  for (const std::size_t output : acting) {
    best.columns.push_back(columns_of(*explanation.hypothesis, shapes, outputs_[output]));
    all.push_back(reduced(*explanation.settings[output], best.columns.back(),
                          explanation.hypothesis->width()));
  }
  for (std::size_t block = 0; block < best.fits.size(); ++block) {
    BlockFit& least = best.fits[block];
    for (std::size_t shape = 0; shape < shapes.size(); ++shape) {
      std::vector<const Reduced*> of;
      of.reserve(all.size());
      for (const auto& of_output : all) of.push_back(&of_output[shape][block]);
      BlockFit fit = this->fit(explanation, acting, of);
      if (!(fit.misfit < least.misfit)) continue;
      least = std::move(fit);
      least.shape = shape;
    }
    for (std::size_t i = 0; i < least.gains.size(); ++i)
      least.common.emplace_back(common(*explanation.settings[acting[i]])[block].carried -
                                all[i][least.shape][block].carried * least.gains[i]);
  }
  return best;
}

double LeftOut::log_left_without(std::size_t output) {
  const OutputEvidence& evidence = outputs_[output];
  if (evidence.coefficient_columns().cols() == 0) return 0.0;
  const Common& common = this->common(evidence.setting());
  Squares sum;
  for (std::size_t block = 0; block < rows_.blocks.size(); ++block) {
    const auto without = left_by(evidence, common[block].carried);
    sum += squares_in_block(evidence, {without[0], without[1], without[1], without[1]}, rows_,
                            rows_.blocks[block]);
  }
  return log_ratio(sum.after, sum.measured);
}

double LeftOut::log_left_by_accepted(std::size_t output) {
  const OutputEvidence& evidence = outputs_[output];
  const Common& common = this->common(evidence.setting());
  Squares sum;
  for (std::size_t block = 0; block < rows_.blocks.size(); ++block) {
    const auto left = left_by(evidence, common[block].carried);
    sum += squares_in_block(evidence, {evidence.measured_residual(), left[0], left[1], left[1]},
                            rows_, rows_.blocks[block]);
  }
  return log_ratio(sum.after, sum.measured);
}

LeftOutGain LeftOut::gain_on_left_out_blocks(const Explanation& explanation) {
  const std::vector<std::size_t> acting = acting_outputs(explanation);
  const std::size_t blocks = rows_.blocks.size();
  if (blocks < 2) return {};
  const BlockFits best = best_without_each(explanation, acting);
  const Eigen::Index width = explanation.hypothesis->width();
  std::vector<Squares> sums(acting.size());
  for (std::size_t i = 0; i < acting.size(); ++i) {
    const OutputEvidence& evidence = outputs_[acting[i]];
    const Common& without = common(evidence.setting());
    for (std::size_t block = 0; block < blocks; ++block) {
      const BlockFit& fit = best.fits[block];
      if (fit.gains.empty()) continue;
      const Column explained =
          best.columns[i].middleCols(width * static_cast<Eigen::Index>(fit.shape), width) *
          fit.gains[i];
      const Left left = left_of(evidence, explained, fit.common[i], without[block].carried);
      sums[i] += squares_in_block(evidence, left, rows_, rows_.blocks[block]);
    }
  }
  return gain_of(sums);
}

LeftOutGain LeftOut::gain_on_fitted_rows(const Explanation& explanation) {
  const std::vector<std::size_t> acting = acting_outputs(explanation);
  std::vector<std::vector<Reduced>> all;
  std::vector<Panel> columns;
  std::vector<const Reduced*> of_all_rows;
  all.reserve(acting.size());
  for (const std::size_t output : acting) {
    columns.push_back(
        columns_of(*explanation.hypothesis, Shapes{explanation.shape}, outputs_[output]));
    all.push_back(
        reduced(*explanation.settings[output], columns.back(), columns.back().cols()).front());
    of_all_rows.push_back(&all.back().back());
  }
  const BlockFit fit = this->fit(explanation, acting, of_all_rows);
  std::vector<Squares> sums(acting.size());
  for (std::size_t i = 0; i < acting.size(); ++i) {
    const OutputEvidence& evidence = outputs_[acting[i]];
    const Common& without = common(evidence.setting());
    const Common& beside = common(*explanation.settings[acting[i]]);
    const Column explained = columns[i] * fit.gains[i];
    Left left;
    left.fill(Column::Zero(rows_.time_s.size()));
    for (std::size_t block = 0; block < rows_.blocks.size(); ++block) {
      const Left part =
          left_of(evidence, explained, beside[block].carried - all[i][block].carried * fit.gains[i],
                  without[block].carried);
      const Block& of = rows_.blocks[block];
      for (std::size_t k = 0; k < left.size(); ++k)
        left[k].segment(of.begin, of.end - of.begin) = part[k].segment(of.begin, of.end - of.begin);
    }
    for (const Block& run : rows_.runs) sums[i] += squares_in_block(evidence, left, rows_, run);
  }
  return gain_of(sums);
}

}  // namespace thermocomp::diagnosis
