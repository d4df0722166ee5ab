/// How well an explanation predicts rows that it was not fitted to.
#pragma once

#include <limits>
#include <map>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "modelling/diagnosis/evidence/evidence.hpp"

namespace thermocomp::diagnosis {

struct LeftOutGain {
  /// 1 - RMS with the explanation / RMS without, over all outputs that it acts on, each in units of
  /// its own RMS.
  double share{0.0};
  /// 1 - RMS with / RMS without of the output of which it takes most, errors of the coefficients
  /// beside it in both.
  double share_of_best{0.0};
  /// The same with all outputs in one unit: what is large counts.
  double share_of_all{0.0};
  /// Sum over its outputs of ln(RMS that is left / RMS of the residual): how explanations of
  /// different outputs compare. Negative: better than nothing.
  double log_left{0.0};
};

/// Judges explanations of one evidence, which must not change meanwhile.
class LeftOut {
 public:
  LeftOut(const StackedRows& rows, const std::vector<OutputEvidence>& outputs)
      : rows_(rows), outputs_(outputs) {}

  /// Each block of rows is left out in turn; shape and gains come from the other blocks, each run's
  /// offset from the rows that stayed.
  [[nodiscard]] LeftOutGain gain_on_left_out_blocks(const Explanation& explanation);

  /// For a fault that is located within one run: its shape and gains from all rows, everything else
  /// from the other blocks.
  [[nodiscard]] LeftOutGain gain_on_fitted_rows(const Explanation& explanation);

  /// The log_left of an output that no hypothesis acts on: what errors of the coefficients alone
  /// leave of rows that they were not fitted to; 0 where they are taken as right.
  [[nodiscard]] double log_left_without(std::size_t output);

  /// Of an output: ln(RMS that all accepted explanations and the errors of the coefficients leave
  /// of rows that their gains were not fitted to / RMS of what the model leaves).
  [[nodiscard]] double log_left_by_accepted(std::size_t output);

 private:
  /// The common columns and the residual of a setting when a block is left out.
  struct CommonWithout {
    Eigen::LDLT<Eigen::MatrixXd> factor;  ///< of the common columns' products
    Eigen::VectorXd carried;              ///< gains of the common columns for the residual
    double squares{0.0};                  ///< of the residual, what they carry taken out
  };
  /// One for each block; the last one for all rows.
  using Common = std::vector<CommonWithout>;
  /// Normal equations of a hypothesis without one block, the common columns taken out.
  struct Reduced {
    Eigen::MatrixXd square;
    Eigen::VectorXd right;
    double squares{0.0};
    Eigen::MatrixXd carried;  ///< gains of the common columns for each column of the hypothesis
  };
  /// Gains of the hypothesis from the rows without a block, and what 2 ln L loses by the misfit.
  struct BlockFit {
    double misfit{std::numeric_limits<double>::infinity()};
    std::vector<Eigen::VectorXd> gains;   ///< one an acting output
    std::vector<Eigen::VectorXd> common;  ///< of the common columns, beside the hypothesis
    std::size_t shape{0};                 ///< its place among those that were tried
  };
  struct BlockFits {
    std::vector<BlockFit> fits;  ///< one a block
    std::vector<Panel> columns;  ///< of all shapes that were tried, one an acting output
  };
  /// The best of the shapes when a block is left out.
  [[nodiscard]] BlockFits best_without_each(const Explanation& explanation,
                                            const std::vector<std::size_t>& acting);

  [[nodiscard]] const Common& common(const Setting& setting);
  /// Of groups of `width` columns; of each as many as there are in Common.
  [[nodiscard]] std::vector<std::vector<Reduced>> reduced(const Setting& setting,
                                                          const Panel& columns, Eigen::Index width);
  /// @param reduced  one an acting output
  [[nodiscard]] BlockFit fit(const Explanation& explanation, const std::vector<std::size_t>& acting,
                             const std::vector<const Reduced*>& reduced) const;

  const StackedRows& rows_;
  const std::vector<OutputEvidence>& outputs_;
  std::map<const Setting*, Common> common_;
};

}  // namespace thermocomp::diagnosis
