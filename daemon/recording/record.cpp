#include "daemon/recording/record.hpp"

#include <bit>

namespace thermocomp {

std::string_view to_string(SegmentReason reason) noexcept {
  switch (reason) {
    case SegmentReason::start:
      return "start";
    case SegmentReason::reload:
      return "reload";
    case SegmentReason::periodic:
      return "periodic";
    case SegmentReason::gap:
      return "gap";
  }
  return "unknown";
}

bool same_bits(double a, double b) noexcept {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

}  // namespace thermocomp
