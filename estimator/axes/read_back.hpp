/// Whether the controller applies what it was sent, allowing for delays of the link; and why it may
/// apply something else, judged by what was sent and read back.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

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

enum class MismatchCause : std::uint8_t {
  none,
  factor,         ///< reads back a multiple of what is sent
  opposite_sign,  ///< reads back its negative
  constant,       ///< reads back more by the same amount each time
  stands_still,   ///< reads back the same whatever is sent
  changes_alone   ///< the read-back changes where what is sent does not
};

/// What a latched axis was sent and read back, and what that looks like.
struct Mismatch {
  double sent_um{not_a_number};
  double read_um{not_a_number};
  MismatchCause likely{MismatchCause::none};
  double size{not_a_number};  ///< factor: times what is sent; constant: [um]
  /// More than one value sent says the same, so the factor, sign or constant is no coincidence.
  bool sure{false};
  /// A factor that might as well be a constant: too little has been sent to tell them apart.
  bool or_constant{false};

  /// Whether the same factor, sign or constant still explains a pair.
  [[nodiscard]] bool explains(double of_sent_um, double of_read_um) const noexcept;
  void visit_state(StateArchive& archive) {
    archive(sent_um, read_um, likely, size, sure, or_constant);
  }
};

/// "reads back twice what is sent: check scale", with the other possibility where that is not sure;
/// empty where there is nothing to say. Allocates.
[[nodiscard]] std::string likely_text(const Mismatch& mismatch);

/// The last values sent, each with what was read back: only those that differ, so that a slow
/// offset does not fill the memory with one pair.
class SentAndRead {
 public:
  void note(double sent_um, double read_um) noexcept;
  /// The likeliest cause of a pair that does not agree. A factor or constant is taken from that
  /// pair and must hold for the older ones too, allowing for the lag of a moving offset. A constant
  /// may have begun lately: then for those since a pair last agreed, at least two. So may an
  /// opposite sign, which this pair alone shows where it is the exact negative.
  [[nodiscard]] Mismatch judge(double sent_um, double read_um) const noexcept;

  void visit_state(StateArchive& archive) { archive(sent_um_, read_um_, count_); }

 private:
  static constexpr std::size_t length = 16;
  [[nodiscard]] std::size_t kept() const noexcept { return count_ < length ? count_ : length; }
  /// @param age  0: the newest
  [[nodiscard]] std::size_t index_of(std::size_t age) const noexcept {
    return (count_ - 1 - age) % length;
  }
  /// How many of the newest differ from what was sent.
  [[nodiscard]] std::size_t disagreeing() const noexcept;
  [[nodiscard]] Mismatch judge_newest(std::size_t pairs, double sent_um,
                                      double read_um) const noexcept;
  // Of the newest `pairs`:
  /// largest |read - (factor sent + constant)|
  [[nodiscard]] double worst_um(std::size_t pairs, double factor,
                                double constant_um) const noexcept;
  [[nodiscard]] bool stands_still(double sent_um, double read_um) const noexcept;
  [[nodiscard]] double spread_um(std::size_t pairs, double sent_um) const noexcept;

  std::array<double, length> sent_um_{};
  std::array<double, length> read_um_{};
  std::uint64_t count_{0};
};

}  // namespace thermocomp
