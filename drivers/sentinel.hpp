/// A number of a device that is no measured value but a message.
#pragma once

#include <cstdint>

#include "estimator/types.hpp"

namespace thermocomp {

/// A raw value that is no temperature but a message of the device.
struct Sentinel {
  std::int64_t code{0};  ///< raw value before scale and offset (of the encoding's signedness)
  Fault fault{Fault::open_circuit};
  bool operator==(const Sentinel&) const = default;
};

}  // namespace thermocomp
