/// A number from a device that is a message, not a measured value.
#pragma once

#include <cstdint>

#include "estimator/types.hpp"

namespace thermocomp {

/// A raw value that is a message of the device, not a temperature.
struct Sentinel {
  std::int64_t code{0};  ///< raw value before scale and offset (of the encoding's signedness)
  Fault fault{Fault::open_circuit};
  bool operator==(const Sentinel&) const = default;
};

}  // namespace thermocomp
