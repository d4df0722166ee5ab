#include "estimator/pipeline/reasons.hpp"

namespace thermocomp {
namespace {

class ReasonSet {
 public:
  void add(bool holds, Reason reason) noexcept {
    if (holds) bits_ |= static_cast<std::uint32_t>(reason);
  }
  [[nodiscard]] std::uint32_t bits() const noexcept { return bits_; }

 private:
  std::uint32_t bits_{0};
};

}  // namespace

std::uint32_t reasons_of(const Signals& signals, bool written, const Temperatures& temps,
                         const ReferenceState& reference, const Displacement& displacement,
                         const ModeDecision::State& mode, const Targets& targets,
                         const AxisBank& axes) noexcept {
  ReasonSet reasons;
  reasons.add(!signals.online, Reason::controller_offline);
  reasons.add(!signals.complete, Reason::signal_lost);
  reasons.add(!reference.known, Reason::no_reference);
  reasons.add(displacement.block_lost, Reason::block_lost);
  reasons.add(displacement.block_estimated, Reason::block_estimated);
  reasons.add(temps.suspected, Reason::sensor_suspected);
  reasons.add(temps.jumped, Reason::sensor_unconfirmed);
  reasons.add(displacement.not_finite, Reason::no_target);
  reasons.add(displacement.outside, Reason::outside_domain);
  reasons.add(!mode.enabled, Reason::operator_disabled);
  reasons.add(signals.disable >= 0.5, Reason::controller_disabled);
  reasons.add(!targets.may_change || targets.waits_for_cut, Reason::cutting);
  for (const AxisChannel& axis : axes.all()) {
    // Of an axis that is not driven nothing is sent.
    reasons.add(signals.online && axis.driven() && !written, Reason::not_written);
    reasons.add(!axis.synced(), Reason::not_synced);
    reasons.add(axis.start_unknown(), Reason::start_unknown);
    reasons.add(axis.mismatch(), Reason::mismatch);
    reasons.add(axis.latched(), Reason::mismatch_latched);
    reasons.add(axis.at_bound(), Reason::at_bound);
    reasons.add(axis.out_of_bound(), Reason::applied_out_of_bound);
  }
  return reasons.bits();
}

}  // namespace thermocomp
