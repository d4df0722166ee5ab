/// In which order records stand in a history.
#pragma once

#include <cstdint>

#include "daemon/recording/record.hpp"

namespace thermocomp {

/// Cycles never go back, and within a cycle the offsets, which come out of its step, are the last.
class RecordOrder {
 public:
  /// @param first_cycle  no record is of an earlier one
  explicit RecordOrder(std::uint64_t first_cycle = 0) : cycle_(first_cycle) {}

  /// @return whether `next` may follow what came before; what may not is not counted as there
  [[nodiscard]] bool admits(const Record& next) noexcept {
    const bool is_offset = next.kind == RecordKind::offset;
    if (next.cycle < cycle_ || (next.cycle == cycle_ && has_offsets_ && !is_offset)) return false;
    cycle_ = next.cycle;
    has_offsets_ = is_offset;
    return true;
  }

 private:
  std::uint64_t cycle_;
  bool has_offsets_{false};  ///< the newest record is an offset of that cycle
};

}  // namespace thermocomp
