/// How much a hypothesis explains: likelihood of the residuals with wandering noise and free
/// offsets a run.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "modelling/diagnosis/evidence/coloured_noise.hpp"
#include "modelling/diagnosis/evidence/equations.hpp"
#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

namespace thermocomp::diagnosis {

class Setting;

/// A hypothesis with its shape and gains settled.
struct Explanation {
  const Hypothesis* hypothesis{nullptr};
  Shape shape;
  std::vector<Eigen::VectorXd> gains;    ///< one an output; empty: the output has no share
  double score{0.0};                     ///< gain of 2 ln L, the price of its parameters taken off
  std::vector<const Setting*> settings;  ///< one an output: under which it is likeliest
  double left_out_gain{0.0};  ///< share of the RMS that it takes from rows it was not fitted to
  double left_out_gain_of_best{0.0};  ///< the same of the output of which it takes most
  double log_left{0.0};  ///< ln of what it leaves of their RMS, summed over all outputs
  double witness{0.0};   ///< of the score: what the other sensors say of a fault of a reading
  /// Of its cause with any place of its subject's group, or with any of `other_subjects`, once it
  /// is chosen.
  double probability{0.0};
  std::vector<std::string> other_subjects{};  ///< between which and its own nothing decides
  double family_probability{0.0};
};

/// Adds what the other sensors say to the score, which must not have it yet.
/// @param says  2 ln of a likelihood ratio, of SensorWitness
void add_witness(Explanation& explanation, double says);

/// Parameters that were fitted: of its shape those that are not discrete, and its gains.
[[nodiscard]] std::size_t free_parameters(const Explanation& explanation);

/// One output's residual over the stacked rows under one noise shape, whitened, with everything
/// that any hypothesis has to compete with.
///
///   residual = offset of the run + accepted columns + hypothesis + noise
class Setting {
 public:
  /// @param common  shape (rows, m): offsets, accepted columns
  /// @param precision  shape (m): sigma^2 over the prior variance of each
  Setting(const NoiseShape& shape, const StackedRows& rows,
          const Eigen::Array<bool, Eigen::Dynamic, 1>& present, const Column& residual,
          const Eigen::MatrixXd& common, const Eigen::VectorXd& precision);
  /// The other one with more common columns.
  /// @param precision  of each of them
  Setting(const Setting& other, const Eigen::MatrixXd& more, double precision);

  /// Normal equations of groups of `width` columns side by side, the common ones taken out, under
  /// each of the settings.
  [[nodiscard]] static std::vector<EquationsTable> equations_of_groups(
      const std::vector<const Setting*>& settings, const Panel& columns, Eigen::Index width);
  /// Places of the settings that share a whitener, those with the most common columns first.
  [[nodiscard]] static std::vector<std::vector<std::size_t>> alike(
      const std::vector<const Setting*>& settings);
  /// The equations from products with the whitened columns.
  /// @param products  against' columns; more of them count for settings of more common columns
  /// @param own  neighbour_products of the columns
  /// @param first  place of the first group in `table`, which has their width
  void without_common(const Eigen::MatrixXd& products, const Eigen::MatrixXd& own,
                      std::size_t first, EquationsTable& table) const;
  /// Of the residual, the common columns taken out.
  [[nodiscard]] double squares() const noexcept { return squares_; }
  [[nodiscard]] double log_determinant() const noexcept { return log_determinant_; }
  [[nodiscard]] double present_rows() const noexcept { return present_rows_; }
  /// 2 ln L for a sum of squares, constants left out.
  [[nodiscard]] double twice_log_likelihood(double squares) const;
  /// What it gains when this is taken from the sum of squares.
  [[nodiscard]] double gain(double taken) const {
    return twice_log_likelihood(squares_ - taken) - likelihood_;
  }
  [[nodiscard]] const Whitener& whitener() const noexcept { return *whitener_; }
  /// The residual and the common columns, whitened, shape (rows, 1 + m).
  [[nodiscard]] const Panel& against() const noexcept { return against_; }
  [[nodiscard]] const Eigen::VectorXd& precision() const noexcept { return precision_; }

 private:
  void reckon();

  std::shared_ptr<const Whitener> whitener_;  ///< shared by settings that begin alike
  Panel against_;
  Eigen::VectorXd precision_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd common_residual_;  ///< factor^-1 common' residual
  double squares_{0.0};
  double log_determinant_{0.0};
  double likelihood_{0.0};  ///< 2 ln L of the residual as it is
  double present_rows_{0.0};
};

/// Everything known of one output while causes are sought.
class OutputEvidence {
 public:
  OutputEvidence(const MeasuredData& data, const StackedRows& rows, std::size_t output);

  /// Takes the explanations as found: their columns become free, or are subtracted.
  void accept(const std::vector<Explanation>& found);
  /// The noise under which the residual is likeliest.
  [[nodiscard]] const Setting& setting() const { return *stance().likeliest; }
  /// The settings among which settle() chooses: white noise first.
  [[nodiscard]] const std::vector<std::unique_ptr<Setting>>& settings() const {
    return stance().settings;
  }
  [[nodiscard]] const Column& residual() const noexcept { return residual_; }
  [[nodiscard]] const Eigen::Array<bool, Eigen::Dynamic, 1>& present() const { return present_; }
  /// Whether no row's value is missing.
  [[nodiscard]] bool complete() const noexcept { return complete_; }
  /// Makes columns zero where the output has no value.
  void clear_missing(Panel& columns) const;
  /// RMS of values over the stacked rows where the output has one, each run's mean taken off.
  [[nodiscard]] double centred_rms(const Column& values) const;
  /// Columns of the accepted explanations that are fitted anew each time, shape (rows, m): common
  /// columns of every setting after the runs' offsets.
  [[nodiscard]] const Eigen::MatrixXd& free_columns() const noexcept { return free_columns_; }
  /// Whether the model's coefficients may all be a little wrong. The settings of both stances stay
  /// until something is accepted.
  void doubt_coefficients(bool doubted);
  /// What wrong coefficients add, shape (rows, m): the last common columns. None when they are not
  /// doubted.
  [[nodiscard]] const Eigen::MatrixXd& coefficient_columns() const noexcept {
    return coefficients_doubted_ ? coefficient_columns_ : no_columns_;
  }
  [[nodiscard]] const Column& measured_residual() const noexcept { return measured_residual_; }
  /// The measured displacement over the stacked rows; 0 where missing.
  [[nodiscard]] Column measured(const MeasuredData& data) const;
  [[nodiscard]] bool measured() const noexcept { return measured_; }
  [[nodiscard]] double noise_um() const noexcept { return noise_um_; }
  [[nodiscard]] std::size_t output() const noexcept { return output_; }

 private:
  struct Stance {
    std::vector<std::unique_ptr<Setting>> settings;  ///< one for each shape of noise
    const Setting* likeliest{nullptr};
    void find_likeliest();
  };

  [[nodiscard]] const Stance& stance() const { return coefficients_doubted_ ? doubted_ : right_; }
  void add_settings();
  /// Those of the coefficients taken as right, with errors of the coefficients beside.
  void add_doubted_settings();

  const StackedRows& rows_;
  std::size_t output_;
  Eigen::Array<bool, Eigen::Dynamic, 1> present_;
  bool measured_{false};  ///< in more rows than a handful
  bool complete_{false};
  Column measured_residual_;  ///< measured - model; 0 where missing
  Column residual_;           ///< explanations without a gain subtracted
  Eigen::MatrixXd offsets_;
  Eigen::MatrixXd free_columns_;
  Eigen::MatrixXd coefficient_columns_;
  Eigen::MatrixXd no_columns_;
  bool coefficients_doubted_{false};
  double noise_um_{0.0};  ///< of a single value, from the residual's second differences
  Stance right_;
  Stance doubted_;  ///< empty until it is asked for
};

/// The columns over the stacked rows, 0 where the output has no value: those of one shape after
/// those of another.
[[nodiscard]] Panel columns_of(const Hypothesis& hypothesis, const Shapes& shapes,
                               const OutputEvidence& evidence);
/// Of one shape.
[[nodiscard]] Eigen::MatrixXd columns_of(const Hypothesis& hypothesis, const Shape& shape,
                                         const OutputEvidence& evidence);

}  // namespace thermocomp::diagnosis
