/// How far the model was off where the displacement was probed.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Mean square over the last probings: of all up to 20, then each new one counts for 1/20.
class ProbedError {
 public:
  void take(double error_um) noexcept {
    if (!std::isfinite(error_um)) return;
    ++count_;
    const double weight = 1.0 / static_cast<double>(std::min<std::uint64_t>(count_, 20));
    mean_square_um2_ += weight * (error_um * error_um - mean_square_um2_);
  }
  [[nodiscard]] double rms_um() const noexcept {
    return count_ > 0 ? std::sqrt(mean_square_um2_) : not_a_number;
  }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  void visit_state(StateArchive& archive) { archive(count_, mean_square_um2_); }

 private:
  std::uint64_t count_{0};
  double mean_square_um2_{0.0};
};

}  // namespace thermocomp
