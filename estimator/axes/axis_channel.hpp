/// One axis from target to offset: limiter, agreement with the controller, proving move.
#pragma once

#include "estimator/axes/applied_check.hpp"
#include "estimator/axes/limiter.hpp"
#include "estimator/axes/mismatch.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// What one step of an axis needs to know.
struct AxisInput {
  nanoseconds now{};
  double dt_s{0.0};
  double target_um{0.0};  ///< NaN: stay
  bool may_change{true};  ///< false: surface-aware hold
  std::uint32_t link_epoch{0};
  bool online{false};  ///< the controller's values below are fresh
  double applied_um{not_a_number};
  nanoseconds taken_at{};  ///< when applied_um was read back
};

/// A read-back is evidence, not a command. The offset starts from it in three cases only: at the
/// first contact with a controller; on a new link, where it is nothing, or between that and what
/// was sent lately; and when an operator releases a mismatch. In all other cases the value sent
/// stays the axis' own.
///
/// A read-back that nothing sent lately explains pauses the axis; a second one, before sixteen good
/// ones have followed, latches the mismatch: the axis is not driven until release().
class AxisChannel {
 public:
  AxisChannel(const AxisConfig& config, const CompensationConfig& compensation, bool reads_back);

  /// What the controller tells: may it be driven?
  void observe(const AxisInput& input) noexcept;
  /// Nothing is sent in this step: what was sent last stays, and in time is all that was.
  void stand(nanoseconds now) noexcept;
  /// Towards the target. @pre driven(), and the offset is sent
  void move(const AxisInput& input) noexcept;
  /// Moves by `move_um` and back; the compensation of this axis waits meanwhile. Ignored unless
  /// driven, or beyond prove_um_max.
  void prove(double move_um) noexcept;
  void end_prove() noexcept { state_.prove.phase = ProvePhase::none; }
  /// An operator says that what caused a latched mismatch is mended. The next read-backs decide:
  /// explained by the same factor, sign or constant that was latched, or no two of them alike, it
  /// stays latched; else the axis starts from what is read back, once it could have got there at
  /// its slew rate from what was sent last.
  void release() noexcept;

  [[nodiscard]] double offset_um() const noexcept { return limiter_.offset_um(); }
  [[nodiscard]] double target_um() const noexcept { return state_.target_um; }
  /// As read back last; NaN where the controller does not tell.
  [[nodiscard]] double applied_um() const noexcept { return state_.applied_um; }
  [[nodiscard]] bool synced() const noexcept { return state_.synced; }
  /// Whether the offset may be sent: synced, started, and nothing read back is unexplained.
  [[nodiscard]] bool driven() const noexcept {
    return state_.synced && !state_.starting && !state_.in_doubt && !state_.latched;
  }
  [[nodiscard]] bool mismatch() const noexcept { return state_.mismatch; }
  [[nodiscard]] bool latched() const noexcept { return state_.latched; }
  [[nodiscard]] bool releasing() const noexcept { return state_.releasing; }
  /// What was sent and read when the newest latch came.
  [[nodiscard]] const Mismatch& latched_mismatch() const noexcept {
    return state_.latched_mismatch;
  }
  [[nodiscard]] bool out_of_bound() const noexcept { return state_.out_of_bound; }
  [[nodiscard]] bool at_bound() const noexcept { return limiter_.at_bound(); }
  [[nodiscard]] bool proving() const noexcept { return state_.prove.phase != ProvePhase::none; }

  /// Before the first step: what was sent last before the restart.
  void restore(double offset_um) noexcept;
  /// After a reload: goes on from the other's offset and agreement.
  void adopt(const AxisChannel& previous) noexcept;

  void visit_state(StateArchive& archive) { archive(limiter_, check_, state_); }

 private:
  enum class ProvePhase : std::uint8_t { none, out, wait, back };
  struct Prove {
    ProvePhase phase{ProvePhase::none};
    double from_um{0.0};
    double move_um{0.0};
    nanoseconds until{};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d] = *this;
      archive(a, b, c, d);
    }
  };
  struct State {
    double target_um{0.0};
    double applied_um{not_a_number};
    std::uint32_t epoch{0};
    /// Largest |offset| that can come from us: the bound, or what an earlier bound allowed.
    double trusted_um{0.0};
    bool synced{false};
    bool starting{false};     ///< a new link's first believable read-back is waited for
    bool driven_once{false};  ///< by this program, so what is applied is ours
    bool out_of_bound{false};
    bool mismatch{false};
    nanoseconds agreed_since{};
    bool in_doubt{false};  ///< the newest read-back is unexplained
    std::uint8_t suspicion{0};
    bool latched{false};
    bool releasing{false};
    double released_um{not_a_number};  ///< read back since release(), to be confirmed
    Mismatch latched_mismatch;
    SentAndRead pairs;
    /// After a pause of the link: read-backs until a command of the new epoch has surely been
    /// written.
    std::uint8_t stands_for{0};
    std::uint8_t unwritten_for{0};  ///< read-backs until what is read back is surely ours
    nanoseconds seen_at{};          ///< of the newest read-back, also of one without offsets
    nanoseconds read_back_at{};
    nanoseconds driven_at{};
    Prove prove;
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w] = *this;
      archive(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w);
    }
  };

  void take_epoch(std::uint32_t epoch) noexcept;
  void note_read_back(const AxisInput& input) noexcept;
  void synchronise(const AxisInput& input) noexcept;
  void compare(const AxisInput& input) noexcept;
  void start_on_link(const AxisInput& input, bool fresh) noexcept;
  void note_explained(const AxisInput& input, bool fresh) noexcept;
  void note_unexplained(const AxisInput& input, bool fresh) noexcept;
  void check_release(const AxisInput& input) noexcept;
  void end_latch() noexcept;
  [[nodiscard]] bool is_applied(const AxisInput& input) const noexcept;
  [[nodiscard]] bool is_out_of_bound(double applied_um) const noexcept;
  void start_from(nanoseconds now, double offset_um) noexcept;
  [[nodiscard]] double prove_target_um(nanoseconds now) noexcept;

  Limiter limiter_;
  AppliedCheck check_;
  const bool reads_back_;
  const nanoseconds mismatch_after_;
  const double prove_um_max_;
  const nanoseconds prove_hold_;

  State state_;
};

}  // namespace thermocomp
