/// One sensor after a step, for people.
#pragma once

#include <cstdint>

#include "estimator/types.hpp"

namespace thermocomp {

struct SensorReport {
  double raw_degC{not_a_number};       ///< as the driver gave it
  double smoothed_degC{not_a_number};  ///< what the block gets; a difference where configured
  nanoseconds taken_at{};
  Fault fault{Fault::never_read};     ///< after screening
  std::uint32_t clipped_in_a_row{0};  ///< values that smoothing clipped in a row
  std::uint64_t clipped{0};
  std::uint64_t rejected{0};  ///< readings refused by screening since the start
  bool waiting{false};        ///< a value is there that does not count yet
  bool jumped{false};         ///< ... because it contradicts what was or what is expected
  double jump_K{0.0};         ///< ... by so much, now
  double jumped_from_degC{not_a_number};
  nanoseconds jumped_at{};
  bool suspected{false};     ///< good values that the neighbours contradict
  bool weighed_down{false};  ///< ... and its blocks do without it
  double suspected_size_K{0.0};
  nanoseconds suspected_since{};
};

}  // namespace thermocomp
