// Invariants of the values written to the controller.
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "invariants.hpp"

namespace thermocomp::faults {
namespace {

/// Older sent offsets no longer explain a read-back [s].
constexpr double window_s = 10.0;
/// Comparison window, and the read-back and command in transit at its end.
constexpr nanoseconds settling = std::chrono::seconds(8);

}  // namespace

void Invariants::check_move(const CycleSeen& seen, const Move& move,
                            const SimulatedController& controller) {
  demand(std::isfinite(move.to_um), "only_finite_numbers", seen.now, "register of the controller");
  // The controller may restart during a timeout, so values are written right after a read. The rest
  // of an answer that has begun may take as long again.
  const double looked_s_max = 2.0 * (link_timeout_s_ + std::min(link_timeout_s_, 0.7)) + 0.05;
  demand(to_s(move.at - move.looked_at) <= looked_s_max, "looked_before_written", seen.now, [&] {
    return fmt::format("axis {}: written {:.3f} s after the last read-back, {:.3f} allowed",
                       move.axis, to_s(move.at - move.looked_at), looked_s_max);
  });
  Budget& budget = budgets_[move.axis];
  const double rate_um = rate_um_per_s_[move.axis];
  const double stall_s = patience_s_ + 2.0 * period_s_;
  const double elapsed_s = to_s(move.at - budget.at);
  budget.um = std::min(budget.um + rate_um * elapsed_s, rate_um * stall_s);
  budget.at = move.at;
  const double change_um = std::abs(move.to_um - move.from_um);
  // Offsets change per cycle, writes follow the link's period: one more cycle is allowed.
  const double since_seen_um = rate_um * to_s(move.at - move.seen_at);
  double allowed_um = (move.disturbed ? std::min(budget.um, since_seen_um) : budget.um) +
                      rate_um * period_s_ + 2.0 * resolution_um_ +
                      (has_moved_[move.axis] ? 0.0 : leap_um_[move.axis]);
  // A release may rely on read-backs that were false until 4 s ago.
  const bool has_wrong_read_back = controller.has_wrong_read_back(move.at) ||
                                   controller.has_wrong_read_back(move.at - from_s(4.0));
  if (move.disturbed || has_wrong_read_back) budget.disturbed_at = move.at;
  if (move.at - budget.disturbed_at < settling) {
    // Any applied offset within the range sent recently is taken for an obeyed one.
    const auto end = budget.reported_um.begin() +
                     static_cast<std::ptrdiff_t>(std::min<std::size_t>(budget.count, 16));
    const auto [low, high] = std::minmax_element(budget.reported_um.begin(), end);
    allowed_um += 3.0 + 2.0 * resolution_um_ + (budget.count == 0 ? 0.0 : *high - *low);
  }
  const bool knowable =
      (!move.disturbed || move.seen) && (has_moved_[move.axis] || !is_lost_[move.axis]);
  if (knowable && !has_wrong_read_back)
    demand(change_um <= allowed_um, "slew_kept_at_controller", seen.now, [&] {
      return fmt::format("axis {}: told {:.4f} um where {:.4f} is applied, {:.4f} allowed",
                         move.axis, move.to_um, move.from_um, allowed_um);
    });
  budget.um = std::max(0.0, budget.um - std::max(0.0, change_um - 2.0 * resolution_um_));
  if (move.disturbed) budget.um = rate_um * stall_s;  // a new start
  budget.reported_um[budget.count++ % 16] = move.to_um;
  demand(std::abs(move.to_um) <= largest_bound_um_[move.axis] + register_rounding_um,
         "offset_within_bound", seen.now, [&] {
           return fmt::format("axis {}: the controller is told {:.4f} um", move.axis, move.to_um);
         });
}

/// Without read-back no axis moves before a write is confirmed: the first value is the register's
/// content or, if unreadable, the last wanted offset. A released axis continues from 0.
void Invariants::check_first(const CycleSeen& seen, const Move& move) {
  const double rounding_um = 2.0 * resolution_um_ + tiny_um;
  const double slack_um =
      rounding_um + rate_um_per_s_[move.axis] * (2.0 * period_s_ + link_period_s_);
  const bool is_read = std::isfinite(seen.reported->applied_um[move.axis]);
  const bool held = is_read && std::abs(move.to_um - move.from_um) <= slack_um;
  const double before_um = wanted_before_um_[move.axis];
  const bool wanted = std::abs(move.to_um - before_um) <= leap_um_[move.axis] + slack_um;
  const bool released = std::abs(move.to_um) <= slack_um &&
                        seen.report->axes[move.axis].start == StartEvidence::released;
  demand(held || wanted || released || std::isnan(before_um) || is_lost_[move.axis],
         "first_offset_is_known", seen.now, [&] {
           return fmt::format("axis {}: {:.4f} um first, {:.4f} um last, {:.4f} allowed", move.axis,
                              move.to_um, before_um, leap_um_[move.axis]);
         });
}

/// Consecutive values differ by at most the slew limit, whatever was read back between them. A new
/// link starts from the applied offset: between zero and the values sent recently.
void Invariants::check_sent(const CycleSeen& seen, const Move& move) {
  Sent& sent = sent_[move.axis];
  const double rate_um_per_s = rate_um_per_s_[move.axis];
  const double elapsed_s = to_s(move.at - sent.at);
  const double stall_s = patience_s_ + 2.0 * period_s_;
  const double stall_um = rate_um_per_s * stall_s;
  const bool first = std::isnan(sent.um);
  const double change_um = first ? 0.0 : std::abs(move.to_um - sent.um);
  sent.credit_um = std::min(sent.credit_um + rate_um_per_s * elapsed_s,
                            std::max(stall_um, rate_um_per_s * elapsed_s + stall_um));
  const bool kept = change_um <= sent.credit_um + 2.0 * resolution_um_ + tiny_um;
  if (kept || move.breaks == sent.breaks) {
    demand(kept, "slew_kept_by_what_is_sent", seen.now, [&] {
      return fmt::format("axis {}: {:.4f} um after {:.4f} um, {:.3f} s apart, {:.4f} allowed",
                         move.axis, move.to_um, sent.um, elapsed_s, sent.credit_um);
    });
  } else {
    const auto [low_um, high_um] = sent.range_um(0.0);
    const double slack_um = 4.0 + stall_um + 2.0 * resolution_um_;
    demand(move.to_um >= low_um - slack_um && move.to_um <= high_um + slack_um,
           "slew_kept_by_what_is_sent", seen.now, [&] {
             return fmt::format("axis {}: {:.4f} um after {:.4f} um on a new link", move.axis,
                                move.to_um, sent.um);
           });
  }
  if (first || !kept) {
    sent.breaks = move.breaks;
    sent.credit_um = stall_um;
  }
  if (kept)
    sent.credit_um = std::max(0.0, sent.credit_um - std::max(0.0, change_um - resolution_um_));
  sent.um = move.to_um;
  sent.at = move.at;
  sent.lately.emplace_back(move.at, move.to_um);
  while (sent.lately.front().first < move.at - from_s(window_s)) sent.lately.pop_front();
}

std::pair<double, double> Invariants::Sent::range_um(double with_um) const {
  std::pair range{with_um, with_um};
  for (const auto& [at_time, value_um] : lately) {
    range.first = std::min(range.first, value_um);
    range.second = std::max(range.second, value_um);
  }
  return range;
}

/// Repeated read-backs that nothing sent explains: the axis is not driven.
void Invariants::check_unexplained(const CycleSeen& seen, std::size_t axis) {
  Sent& sent = sent_[axis];
  const double reported_um = seen.reported->applied_um[axis];
  const bool latched = seen.report->axes[axis].latched;
  demand(!latched || !seen.command->valid[axis], "unexplained_is_latched", seen.now,
         [&] { return fmt::format("axis {}: driven although latched", axis); });
  demand(latched || !sent.latched || sent.released, "unexplained_is_latched", seen.now,
         [&] { return fmt::format("axis {}: nobody released it", axis); });
  if (!latched) sent.released = false;
  sent.latched = latched;
  if (!reads_back_ || !seen.reported->online || sent.lately.empty() || !std::isfinite(reported_um))
    return;
  // Wanted offsets explain a read-back as well: after a release or on a new link they start from
  // the read-back, and the write may be refused.
  const double wanted_um = seen.command->offset_um[axis];
  if (seen.command->valid[axis] &&
      (sent.wanted.empty() || seen.now - sent.wanted.back().first > from_s(0.5)))
    sent.wanted.emplace_back(seen.now, wanted_um);
  while (!sent.wanted.empty() && sent.wanted.front().first < seen.now - from_s(window_s))
    sent.wanted.pop_front();
  auto [low_um, high_um] = sent.range_um(wanted_um);
  for (const auto& [at, um] : sent.wanted) {
    low_um = std::min(low_um, um);
    high_um = std::max(high_um, um);
  }
  const double slack_um = seen.shape->estimator.compensation.mismatch_um + 2.0 +
                          rate_um_per_s_[axis] * (link_period_s_ + 2.0 * period_s_);
  const bool unexplained = reported_um < low_um - slack_um || reported_um > high_um + slack_um;
  // The count restarts after a reported mismatch.
  const bool is_reported =
      latched || has_reason(seen.report->reasons, Reason::applied_out_of_bound);
  if (!unexplained || is_reported) sent.unexplained = 0;
  if (unexplained && !is_reported && seen.reported->taken_at != sent.read_back_at)
    ++sent.unexplained;
  sent.read_back_at = seen.reported->taken_at;
  if (sent.unexplained < 5) return;
  demand(is_reported, "unexplained_is_latched", seen.now, [&] {
    return fmt::format("axis {}: {:.4f} um is read back time and again, and no reason says so",
                       axis, reported_um);
  });
  demand(!seen.command->valid[axis], "unexplained_is_latched", seen.now, [&] {
    return fmt::format("axis {}: driven at {:.4f} um although {:.4f} um is read back", axis,
                       seen.command->offset_um[axis], reported_um);
  });
}

}  // namespace thermocomp::faults
