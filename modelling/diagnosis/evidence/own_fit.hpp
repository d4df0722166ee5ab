/// The fit that gave a model its coefficients, recognised in the rows that it was fitted to.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

namespace thermocomp::diagnosis {

/// Least squares, plain or ridge, of displacements on the rises of the model's inputs:
///
///   K = argmin |d - offset(run) - T K|^2 + rows * ridge * |spread K|^2
///
/// Such a fit is a linear map. What acts in the rows while it is made, a displacement e, ends as
/// absorbed(e) in the coefficients and leaves e - T absorbed(e) as residual.
class OwnFit {
 public:
  /// Tries the usual ways of fitting on the stacked rows.
  /// @return nullopt when none of them gives the coefficients of any output, or where the model has
  ///         guideways
  [[nodiscard]] static std::optional<OwnFit> recognised(const MeasuredData& data,
                                                        const StackedRows& rows);

  /// The outputs whose coefficients come from these rows.
  [[nodiscard]] const std::vector<std::size_t>& outputs() const noexcept { return outputs_; }
  /// @param columns  of displacement [um], shape (rows, m)
  /// @return shape (inputs, m) [um/K]
  [[nodiscard]] Eigen::MatrixXd absorbed(const Eigen::MatrixXd& columns, std::size_t output) const;
  /// What the coefficients then predict: rises times absorbed, shape (rows, m).
  [[nodiscard]] Eigen::MatrixXd predicted(const Eigen::MatrixXd& columns, std::size_t output) const;
  /// The same fit made once more, with further columns [um] beside the inputs.
  struct Refit {
    Eigen::VectorXd gains;   ///< of the columns
    double left_share{1.0};  ///< of the mean square of the displacement; the ridge's price counts
  };
  [[nodiscard]] Refit refit_with(const Eigen::MatrixXd& columns, std::size_t output) const;

 private:
  /// How it was fitted.
  struct Way {
    bool offsets{false};       ///< an offset a run was free
    bool standardised{false};  ///< the ridge is of coefficients times spread of the input
    double ridge{0.0};
  };
  using Present = Eigen::Array<bool, Eigen::Dynamic, 1>;
  /// The rises as they are fitted; outputs with values in the same rows share them.
  struct Design {
    Present present;
    Eigen::MatrixXd fitted;  ///< scaled, 0 where the output has no value
    Eigen::MatrixXd square;  ///< over the count of rows
    Eigen::VectorXd scale;   ///< of each input [K]
    double rows{0.0};
  };
  /// The fit of one output.
  struct OfOutput {
    std::shared_ptr<const Design> design;
    Eigen::VectorXd right;     ///< rises with the displacement, over the count of rows
    Eigen::VectorXd known;     ///< the model's coefficients, scaled
    Eigen::VectorXd residual;  ///< as it is fitted [um], 0 where missing
    double mean_square{0.0};   ///< of the residual
  };

  OwnFit() = default;
  [[nodiscard]] bool may_come_from(const Way& way, const Present& present,
                                   const Eigen::VectorXd& residual,
                                   const Eigen::Map<const Eigen::VectorXd>& coefficients) const;
  [[nodiscard]] bool may_be_recognised(const MeasuredData& data, const StackedRows& rows) const;
  [[nodiscard]] Design design_of(const StackedRows& rows, const Present& present,
                                 const Way& way) const;
  [[nodiscard]] std::vector<OfOutput> fits_of(const MeasuredData& data, const StackedRows& rows,
                                              const Way& way) const;
  [[nodiscard]] static double difference(const OfOutput& of, double ridge);
  [[nodiscard]] static double difference(const std::vector<OfOutput>& all, double ridge);
  [[nodiscard]] static double likeliest_ridge(const std::vector<OfOutput>& all);

  Eigen::MatrixXd rises_K_;
  std::vector<Block> runs_;
  Way way_;
  std::vector<OfOutput> fits_;  ///< order of the model's outputs
  std::vector<Eigen::LDLT<Eigen::MatrixXd>> factors_;
  std::vector<std::size_t> outputs_;
};

}  // namespace thermocomp::diagnosis
