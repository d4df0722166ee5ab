/// The invariants of random estimator lives (property), of the daemon's code with a simulated
/// machine (faults) and of attacks on the running daemon (attack/rig.py reads this file). Each
/// suite checks those that it can observe, by the values that reached the machine.
#pragma once

#include <algorithm>
#include <array>
#include <string_view>

namespace thermocomp::invariants {

struct Invariant {
  std::string_view name;
  std::string_view text;
};

inline constexpr std::array<Invariant, 28> all{{
    {"offset_within_bound", "no offset beyond the axis's bound; beyond a new one it comes in"},
    {"slew_kept_at_controller", "what the controller applies changes at the slew rate"},
    {"slew_kept_by_command", "the offset changes at the slew rate, or starts from the read-back"},
    {"slew_kept_by_what_is_sent", "so do values that are sent one after the other"},
    {"only_finite_numbers", "every number that is sent or reported as known is finite"},
    {"first_offset_is_known", "an axis is driven only from an offset that is known"},
    {"unexplained_is_latched",
     "a read-back that nothing sent explains is told, and the axis stands"},
    {"looked_before_written", "a write follows a look at what is applied"},
    {"compensating_is_written", "compensating implies a write that the controller took of late"},
    {"slow_controller_is_written", "a controller that is only slow is written"},
    {"nodes_driven_together", "all nodes of a travel are driven, or none"},
    {"node_follows_its_rows", "a node's offset is the model's with the slide there"},
    {"reading_is_what_was_given", "a reading has the value and the time of the device"},
    {"no_stale_reading_used", "no reading is used that is too old"},
    {"no_faulty_reading_used", "no faulty reading is used"},
    {"no_false_reading_used", "a reading that is far off the machine is not used for long"},
    {"suspicion_never_holds",
     "a suspected sensor ends no compensation while its block has another"},
    {"no_offset_from_invalid_model",
     "what is compensated with is measured, or estimated well enough"},
    {"hold_policy_kept", "without data the offset stands or goes to zero, as configured"},
    {"domain_kept", "outside the model's domain is told, and with `hold` no offset goes further"},
    {"recovered_in_time", "after the last fault it compensates again"},
    {"probing_step_bounded", "a probing moves the estimate by a bounded step"},
    {"gains_within_bounds", "gains stay within bounds and account for what is added"},
    {"nothing_learned_mid_cut", "nothing learned takes effect while the controller is cutting"},
    {"held_between_cycle_ends", "held temperatures change at cycle ends only"},
    {"state_survives_restart",
     "a restart restores what was saved and what a command was told done"},
    {"replay_is_exact", "the history gives the same offsets to the bit"},
    {"no_committed_history_lost", "no committed row of the history is lost"},
}};

/// An invariant of the list; other names do not compile.
class Rule {
 public:
  consteval Rule(const char* name) : name_(name) {  // NOLINT(google-explicit-constructor)
    const bool known = std::any_of(all.begin(), all.end(),
                                   [&](const Invariant& each) { return each.name == name_; });
    if (!known) throw "no such invariant";
  }
  [[nodiscard]] constexpr std::string_view name() const { return name_; }

 private:
  std::string_view name_;
};

}  // namespace thermocomp::invariants
