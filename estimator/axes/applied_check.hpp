/// Whether the controller applies what it was sent, allowing for delays of the link.
#pragma once

#include <array>

#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// What is applied now must be something that was sent within the last window: between the smallest
/// and the largest offset sent in it, a tolerance apart at most.
class AppliedCheck {
 public:
  AppliedCheck(double tolerance_um, nanoseconds window);

  /// Forgets everything; the axis now stands at `offset_um`.
  void restart(nanoseconds now, double offset_um) noexcept;
  void sent(nanoseconds now, double offset_um) noexcept;
  [[nodiscard]] bool agrees(double applied_um) const noexcept;
  /// Whether a controller that was away can apply this of its own accord: what was sent to it,
  /// nothing (0), or anything in between on its way back.
  [[nodiscard]] bool agrees_after_absence(double applied_um) const noexcept;
  /// After a reload: what `previous` has sent counts as sent by this one.
  void adopt(const AppliedCheck& previous) noexcept { state_ = previous.state_; }

  void visit_state(StateArchive& archive) { archive(state_); }

 private:
  [[nodiscard]] bool is_between(double applied_um, double low_um, double high_um) const noexcept;
  [[nodiscard]] double lowest_um() const noexcept;
  [[nodiscard]] double highest_um() const noexcept;

  // Old offsets leave in slots of a quarter window: cheap, and the window is kept to 25 %.
  static constexpr std::size_t slots = 5;
  struct State {
    std::array<double, slots> min_um{};
    std::array<double, slots> max_um{};
    std::size_t newest{0};
    nanoseconds slot_until{};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d] = *this;
      archive(a, b, c, d);
    }
  };
  const double tolerance_um_;
  const nanoseconds slot_length_;
  State state_;
};

}  // namespace thermocomp
