/// Which temperatures a column of the model can have at all: those that the screening of its
/// sensors lets through. A reference outside was never taken at the machine.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

class TemperatureRange {
 public:
  /// Of all sensors of the column's block; of a sensor that shows a difference, the difference of
  /// two ranges. A column without sensors may have any finite temperature.
  TemperatureRange(const EstimatorConfig& config, const std::string& column);

  [[nodiscard]] bool holds(double temp_degC) const noexcept;  ///< false for NaN
  [[nodiscard]] std::string rule() const;  ///< "must be in [-30, 200], what the screening ..."

 private:
  double degC_min_{not_a_number};
  double degC_max_{not_a_number};
};

/// Of kept references, those that no sensor of their column can show, in words:
/// "reference_degC.t1_degC = 1e+300 must be in ...".
[[nodiscard]] std::vector<std::string> impossible_references(
    const EstimatorConfig& config, const std::vector<std::string>& columns,
    const std::map<std::string, double>& reference_degC);

/// The numbers that the model file gives as reference. @throws InvalidValue with the key
void check_reference(const EstimatorConfig& config, const ThermalModel& model);

}  // namespace thermocomp
