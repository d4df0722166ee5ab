#include "drivers/controllers/controller_link.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp {

WriteGate::WriteGate(nanoseconds period, const std::vector<double>& resolution_um) noexcept
    : period_(period), patience_min_(std::max<nanoseconds>(5 * period, std::chrono::seconds{1})) {
  applied_um_.fill(not_a_number);
  slack_um_.fill(unexplained_um);
  for (std::size_t axis = 0; axis < std::min(resolution_um.size(), axes_max); ++axis)
    slack_um_[axis] += 2 * resolution_um[axis];
}

std::uint32_t WriteGate::synchronised() noexcept {
  if (link_is_new_) {
    const std::uint32_t link = epoch_ % epochs_of_a_link;
    // 0 means "never connected", and 1 is reserved for the first link.
    epoch_ += link + 1 == epochs_of_a_link ? 2 - link : 1;
  } else {
    epoch_ += epochs_of_a_link;
  }
  link_is_new_ = false;
  in_sync_ = true;
  last_sent_.reset();
  looks_ = 0;
  unseen_.fill(false);
  sent_ = {};
  applied_um_.fill(not_a_number);
  unchanged_since_.fill(++read_back_number_);
  return epoch_;
}

std::uint32_t WriteGate::synchronised(const std::array<double, axes_max>& applied_um) noexcept {
  const bool is_same_link = !link_is_new_;
  const std::array<double, axes_max> before_um = applied_um_;
  synchronised();
  applied_um_ = applied_um;
  for (std::size_t axis = 0; axis < axes_max && is_same_link; ++axis) {
    if (std::isfinite(applied_um[axis]) || !std::isfinite(before_um[axis])) continue;
    applied_um_[axis] = before_um[axis];
    unseen_[axis] = true;
  }
  return epoch_;
}

void WriteGate::sent(nanoseconds now) noexcept {
  last_sent_ = now;
  for (std::size_t axis = 0; axis < axes_max; ++axis) {
    SentLately& lately = sent_[axis];
    if (!command_.valid[axis] || !std::isfinite(command_.offset_um[axis])) {
      // Once driven again, the axis may start elsewhere: earlier offsets no longer count.
      lately.count = 0;
      continue;
    }
    lately.offset_um[lately.count % SentLately::length] = command_.offset_um[axis];
    ++lately.count;
  }
}

nanoseconds WriteGate::next_pause() noexcept {
  if (!in_sync_ || last_sent_ || looks_ == first_looks) return period_;
  ++looks_;
  return period_ / first_looks;
}

bool WriteGate::check_read_back(const std::array<double, axes_max>& applied_um) noexcept {
  bool explained = true;
  ++read_back_number_;
  unseen_.fill(false);
  for (std::size_t axis = 0; axis < axes_max; ++axis) {
    const double before_um = applied_um_[axis];
    if (!std::isfinite(applied_um[axis])) {
      unseen_[axis] = std::isfinite(before_um);
      continue;
    }
    const SentLately& lately = sent_[axis];
    const bool to_be_driven = command_.link_epoch == epoch_ && command_.valid[axis];
    // Before the first offset is sent, a command starts from the previous read-back.
    if (lately.count != 0 || !to_be_driven || !std::isfinite(before_um))
      applied_um_[axis] = applied_um[axis];
    if (!std::isfinite(before_um)) continue;
    const bool is_unchanged = std::abs(applied_um[axis] - before_um) <= slack_um_[axis];
    if (!is_unchanged) unchanged_since_[axis] = read_back_number_;
    if (lately.count == 0) {
      // Not driven yet: the first command starts from the previous read-back.
      explained = explained && (!to_be_driven || is_unchanged);
      continue;
    }
    // Between the starting point and the setpoints.
    const auto end = lately.offset_um.begin() +
                     static_cast<std::ptrdiff_t>(std::min(lately.count, SentLately::length));
    const auto [low, high] = std::minmax_element(lately.offset_um.begin(), end);
    explained = explained && applied_um[axis] >= std::min(*low, before_um) - slack_um_[axis] &&
                applied_um[axis] <= std::max(*high, before_um) + slack_um_[axis];
  }
  return explained;
}

/// True if the axis has moved since its first command was computed.
bool WriteGate::moved_since_command(std::size_t axis) const noexcept {
  return command_.valid[axis] && sent_[axis].count == 0 &&
         command_.read_back_number < unchanged_since_[axis];
}

void WriteGate::offered(const OffsetCommand& command, nanoseconds computed_at) noexcept {
  command_ = command;
  computed_at_ = computed_at;
}

SendVerdict WriteGate::verdict(nanoseconds now) const noexcept {
  if (!in_sync_ || command_.link_epoch != epoch_) return SendVerdict::nothing_to_send;
  if (now - computed_at_ > renewal_max) return SendVerdict::nothing_to_send;
  for (std::size_t axis = 0; axis < axes_max; ++axis)
    if (unseen_[axis] && command_.valid[axis]) return SendVerdict::nothing_to_send;
  if (last_sent_ && now - *last_sent_ > patience()) return SendVerdict::resynchronise;
  for (std::size_t axis = 0; axis < axes_max; ++axis)
    if (moved_since_command(axis)) return SendVerdict::resynchronise;
  return SendVerdict::send;
}

}  // namespace thermocomp
