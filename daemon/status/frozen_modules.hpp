/// Modules whose noisy values have become constant.
#pragma once

#include <bitset>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

/// A module is frozen when all its channels have given bit-identical values for `polls` new
/// readings and the time `lasts`, and it was noisy before: in more than a third of the `polls`
/// readings up to its last change a channel turned to a third value. A channel that flickers
/// between two steps of its resolution is no evidence of noise: it may come to rest. Main's thread
/// only, so that no offset depends on it; time is that of the report.
class FrozenModules {
 public:
  static constexpr std::size_t polls = 100;
  static constexpr nanoseconds lasts = std::chrono::seconds(60);

  /// To be called with every report that is seen.
  void note(const Report& report, const EstimatorConfig& config);
  /// Time for which each frozen module has given the same values [s].
  [[nodiscard]] std::map<std::string, double> frozen_s() const;

 private:
  struct Channel {
    double before_degC{not_a_number};  ///< the value before `value_degC`
    double value_degC{not_a_number};
    int direction{0};  ///< of the last change
    enum class Step { none, change, turn };
    Step take(double value_degC) noexcept;
  };
  struct Module {
    nanoseconds newest_at{};
    nanoseconds changed_at{};
    std::bitset<polls> turns;  ///< of the newest readings
    bool was_noisy{false};     ///< at the last change
    std::size_t same{0};       ///< readings since
    [[nodiscard]] bool is_frozen() const noexcept;
  };
  std::vector<Channel> channels_;  ///< one per sensor
  std::map<std::string, Module> modules_;
};

}  // namespace thermocomp
