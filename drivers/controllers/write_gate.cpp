#include "drivers/controllers/write_gate.hpp"

#include <algorithm>

namespace thermocomp {

WriteGate::WriteGate(nanoseconds period) noexcept
    : stall_max_(std::max<nanoseconds>(5 * period, std::chrono::seconds{1})) {}

std::uint32_t WriteGate::synchronised() noexcept {
  if (++epoch_ == 0) epoch_ = 1;  // 0 says "never connected"
  in_sync_ = true;
  last_sent_.reset();
  return epoch_;
}

void WriteGate::offered(const OffsetCommand& command, nanoseconds now) noexcept {
  command_ = command;
  offered_at_ = now;
}

SendVerdict WriteGate::verdict(nanoseconds now) const noexcept {
  if (!in_sync_ || command_.link_epoch != epoch_) return SendVerdict::nothing_to_send;
  if (now - offered_at_ > renewal_max) return SendVerdict::nothing_to_send;
  if (last_sent_ && now - *last_sent_ > stall_max_) return SendVerdict::resynchronise;
  return SendVerdict::send;
}

}  // namespace thermocomp
