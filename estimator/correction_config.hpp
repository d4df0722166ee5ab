/// How measured displacements correct the model while it runs.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "estimator/checks.hpp"

namespace thermocomp {

inline constexpr std::size_t correction_groups_max = 4;

enum class CorrectionForm {
  off,
  two_phase,
  recursive,
  constant  ///< Ci of the publication's earlier form, Ki (A - B) - Ci; the gains stay
};
/// two_phase, phase 1 (Teratani et al. 1995).
enum class FirstGain {
  consistent,  ///< the estimate becomes what was measured
  eq_34,       ///< measured / predicted: right only while the tie is cold
  eq_31        ///< measured / the heat source's share: right only while the tie is cold
};
/// What an operator's or a probe's `measured` is: what remains at the tool with the offset in
/// effect, or the displacement as it would be without any.
enum class MeasuredMeaning { remaining, total };

struct CorrectionConfig {
  CorrectionForm form{CorrectionForm::off};
  /// Inputs that share a gain. two_phase: two groups, the heat source's and the tie's.
  std::vector<std::vector<std::string>> groups;
  MeasuredMeaning measured{MeasuredMeaning::remaining};
  FirstGain first_gain{FirstGain::consistent};
  double noise_um{1.0};  ///< standard deviation of a probing
  double turn_um{3.0};   ///< two_phase: phase 2 begins once it has come back by this much
  double contribution_um_min{3.0};  ///< a smaller one cannot tell its gain
  double gain_min{0.3};
  double gain_max{3.0};
  double step_um_max{10.0};  ///< one probing moves the estimate by no more
  double gain_sd{0.3};       ///< recursive: what a gain may be off by before any probing
  double gain_drift_per_sqrt_h{0.1};
  double bias_drift_um_per_sqrt_h{0.0};  ///< 0: no bias is learned
  double outlier_sigma{4.0};
  double probe_sd_um{3.0};  ///< beyond, a new probing is worth it

  static constexpr auto numbers() {
    using Key = NumberKey<CorrectionConfig>;
    using C = CorrectionConfig;
    return std::array{
        Key{"noise_um", &C::noise_um, 0.01, 100},
        Key{"turn_um", &C::turn_um, 0.01, 500},
        Key{"contribution_um_min", &C::contribution_um_min, 0.01, 500},
        Key{"gain_min", &C::gain_min, 0, 1},
        Key{"gain_max", &C::gain_max, 1, 10},
        Key{"step_um_max", &C::step_um_max, 0.01, 500},
        Key{"gain_sd", &C::gain_sd, 0.001, 10},
        Key{"gain_drift_per_sqrt_h", &C::gain_drift_per_sqrt_h, 0, 10},
        Key{"bias_drift_um_per_sqrt_h", &C::bias_drift_um_per_sqrt_h, 0, 100},
        Key{"outlier_sigma", &C::outlier_sigma, 1, 100},
        Key{"probe_sd_um", &C::probe_sd_um, 0.01, 500},
    };
  }
  void validate() const { require_numbers(*this); }  ///< @throws InvalidValue
  bool operator==(const CorrectionConfig&) const = default;
};

}  // namespace thermocomp
