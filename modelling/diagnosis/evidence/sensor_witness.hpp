/// What the other sensors say of a supposed fault of one reading.
#pragma once

#include <map>
#include <vector>

#include "modelling/diagnosis/data/panel.hpp"
#include "modelling/diagnosis/evidence/evidence.hpp"

namespace thermocomp::diagnosis {

/// A sensor that may have the fault, and how many times as large it were than another's.
struct Accused {
  std::size_t sensor{0};
  double times{1.0};
};

/// A reading is predicted from the other temperatures and the signals, each with lags; the fault
/// that the displacement asks for must be seen in what is left of it. What the predictions of all
/// sensors need of a run is reckoned when the run is asked for first.
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
  struct Run {
    Panel columns;         ///< each divided by its largest value; those of the inputs last
    Eigen::VectorXd size;  ///< these values
    std::vector<UnderNoise> noises;
  };
  /// An error of a reading beside a run's columns under one noise.
  struct Beside {
    Eigen::VectorXd products;  ///< with the columns
    double square{0.0};
  };
  /// 2 ln L of a reading.
  struct Likelihood {
    double without{0.0};
    double with{0.0};
  };

  [[nodiscard]] const Run& run(std::size_t index);
  [[nodiscard]] Run made(const MeasuredRun& run) const;
  /// Of an error under each noise of the run.
  [[nodiscard]] static std::vector<Beside> beside(const Run& run, const Column& error_K);
  /// Column of a sensor's reading; the next is the same late.
  [[nodiscard]] Eigen::Index column_of(const Run& run, std::size_t sensor) const;
  [[nodiscard]] static Likelihood likelihood(const Run& run, const UnderNoise& noise,
                                             const Beside& error, Eigen::Index reading,
                                             double times);

  const MeasuredData& data_;
  const StackedRows& rows_;
  std::map<std::size_t, Run> runs_;
};

}  // namespace thermocomp::diagnosis
