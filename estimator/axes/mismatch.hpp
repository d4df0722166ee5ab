/// Likely cause of a mismatch between the offset sent and the offset applied.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

enum class MismatchCause : std::uint8_t {
  none,
  factor,         ///< read-back is a multiple of the offset sent
  opposite_sign,  ///< read-back is the negative of the offset sent
  constant,       ///< read-back minus offset sent is constant
  stands_still,   ///< read-back is constant while the offset sent changes
  changes_alone   ///< the read-back changes while the offset sent does not
};

/// Offset sent and read-back of a latched axis, with the likely cause.
struct Mismatch {
  double sent_um{not_a_number};
  double read_um{not_a_number};
  MismatchCause likely{MismatchCause::none};
  double size{not_a_number};  ///< factor: read / sent; constant: read - sent [um]
  /// True if more than one offset sent confirms the factor, sign or constant.
  bool sure{false};
  /// A constant fits as well as the factor: too little was sent to distinguish them.
  bool or_constant{false};

  /// True if the same factor, sign or constant still explains a pair.
  [[nodiscard]] bool explains(double of_sent_um, double of_read_um) const noexcept;
  void visit_state(StateArchive& archive) {
    archive(sent_um, read_um, likely, size, sure, or_constant);
  }
};

/// "reads back twice what is sent: check scale", with the alternative if that is not sure; empty if
/// there is no likely cause. Allocates.
[[nodiscard]] std::string likely_text(const Mismatch& mismatch);

/// Read-back that stays the same while the offset sent changes.
struct ConstantReadBack {
  std::size_t pairs{0};
  double low_um{not_a_number};  ///< offsets sent meanwhile
  double high_um{not_a_number};
};

/// The last pairs of offset sent and read-back. A pair between others with the same read-back is
/// replaced by the next one, so that a slow offset does not fill the memory; the newest pair is
/// always that of the last read-back.
class SentAndRead {
 public:
  /// @param read_um  NaN: the read-back begins anew, and earlier pairs no longer count as standing
  /// still
  void note(double sent_um, double read_um) noexcept;
  /// The likeliest cause of a pair that disagrees. A factor or constant follows from that pair and
  /// must hold for the older ones too, each of which may show the offset sent one pair before. A
  /// constant or an opposite sign may be recent: then it must hold for the pairs since the last
  /// agreement, at least two; one pair is enough for an exact negative. A read-back may stand still
  /// since its last agreement.
  [[nodiscard]] Mismatch judge(double sent_um, double read_um) const noexcept;
  /// The newest pairs with this read-back, and the range of their offsets sent, `sent_um` included.
  [[nodiscard]] ConstantReadBack standing(double sent_um, double read_um) const noexcept;
  /// Offset sent at the last read-back; without one `otherwise_um`.
  [[nodiscard]] double last_sent_um(double otherwise_um) const noexcept {
    return count_ == 0 ? otherwise_um : sent_um_[index_of(0)];
  }

  void visit_state(StateArchive& archive) { archive(sent_um_, read_um_, count_); }

 private:
  static constexpr std::size_t length = 16;
  [[nodiscard]] std::size_t kept() const noexcept { return count_ < length ? count_ : length; }
  /// @param age  0: the newest
  [[nodiscard]] std::size_t index_of(std::size_t age) const noexcept {
    return (count_ - 1 - age) % length;
  }
  /// Number of newest pairs that disagree.
  [[nodiscard]] std::size_t disagreeing() const noexcept;
  [[nodiscard]] Mismatch judge_newest(std::size_t pairs, double sent_um,
                                      double read_um) const noexcept;
  [[nodiscard]] bool adds_nothing(double next_sent_um, double next_read_um) const noexcept;
  // Over the newest `pairs`:
  /// largest |read - (factor sent + constant)|, where `sent` is that of the pair or the one before
  [[nodiscard]] double worst_um(std::size_t pairs, double factor,
                                double constant_um) const noexcept;
  [[nodiscard]] bool stands_still(double sent_um, double read_um) const noexcept;
  [[nodiscard]] double spread_um(std::size_t pairs, double sent_um) const noexcept;

  std::array<double, length> sent_um_{};
  std::array<double, length> read_um_{};
  std::uint64_t count_{0};
};

}  // namespace thermocomp
