/// What the other sensors say of a supposed fault of one reading.
#pragma once

#include <optional>
#include <vector>

#include "modelling/diagnosis/data/panel.hpp"
#include "modelling/diagnosis/evidence/evidence.hpp"

namespace thermocomp::diagnosis {

/// A sensor that may have the fault, and how many times as large it were than another's.
struct Accused {
  std::size_t sensor{0};
  double times{1.0};
};

/// A reading is predicted from the other temperatures and the signals, each with lags, by
/// coefficients that all runs share; the fault that the displacement asks for must be seen in what
/// is left of it in its run. What the predictions of all sensors need is reckoned when it is asked
/// for first.
class SensorWitness {
 public:
  /// Both must outlive it.
  SensorWitness(const MeasuredData& data, const StackedRows& rows);

  /// @param fault  of a sensor in one run
  /// @return one for each of the accused, in place of the fault's sensor: 2 ln of the likelihood
  ///         ratio of the reading with the fault to the one without; positive: the sensors confirm
  ///         it
  [[nodiscard]] std::vector<double> says(const Explanation& fault,
                                         const std::vector<Accused>& accused);

 private:
  struct UnderNoise {
    Whitener whitener;
    Eigen::MatrixXd products;  ///< of the whitened columns
    Eigen::MatrixXd factor;    ///< lower, of the products and the prior
  };
  struct Readings {
    Panel columns;         ///< each divided by its largest value; those of the inputs last
    Eigen::VectorXd size;  ///< these values
    std::vector<UnderNoise> noises;
  };
  /// An error of a reading beside the columns under one noise.
  struct Beside {
    Eigen::VectorXd products;  ///< with the columns
    double square{0.0};
  };
  /// 2 ln L of a reading.
  struct Likelihood {
    double without{0.0};
    double with{0.0};
    double log_determinant{0.0};  ///< of the reading's covariance, its coefficients unknown
  };

  [[nodiscard]] const Readings& readings();
  [[nodiscard]] Readings made() const;
  /// Of an error under each noise.
  [[nodiscard]] static std::vector<Beside> beside(const Readings& readings, const Column& error_K);
  /// Column of a sensor's reading; the next is the same late.
  [[nodiscard]] Eigen::Index column_of(const Readings& readings, std::size_t sensor) const;
  [[nodiscard]] static Likelihood likelihood(const Readings& readings, const UnderNoise& noise,
                                             const Beside& error, Eigen::Index reading,
                                             double times);
  /// 2 ln L of a reading of which the fault has left a share since its onset.
  [[nodiscard]] static double likelihood_of_shrunk(const Readings& readings,
                                                   const UnderNoise& noise, Eigen::Index reading,
                                                   const Column& corrected_K, const Column& left,
                                                   double log_determinant);

  const MeasuredData& data_;
  const StackedRows& rows_;
  std::optional<Readings> readings_;
};

}  // namespace thermocomp::diagnosis
