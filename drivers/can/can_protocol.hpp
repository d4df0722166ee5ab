/// A protocol above CAN frames: frames and times in, frames and readings out. Without socket, clock
/// and thread, so that tests, tools and drivers run the same code.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/bus.hpp"
#include "drivers/can/can_socket.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Bytes that a reading was decoded from; empty: none since the bus or its node was lost.
struct RawReading {
  std::vector<std::uint8_t> value;   ///< frame, object, or part of a long message
  std::vector<std::uint8_t> status;  ///< only if it is requested separately
};

class CanProtocol {
 public:
  CanProtocol() = default;
  CanProtocol(const CanProtocol&) = delete;
  CanProtocol& operator=(const CanProtocol&) = delete;
  virtual ~CanProtocol() = default;

  /// Frames to receive; take() needs no others.
  [[nodiscard]] virtual std::vector<CanFilter> wanted() const = 0;
  /// Index in the whole configuration of the sensor of each reading.
  [[nodiscard]] virtual std::vector<std::size_t> sensors() const = 0;

  virtual void opened(nanoseconds now) = 0;  ///< the bus is now usable
  virtual void closed(nanoseconds now) = 0;  ///< it is not: every reading becomes no_answer
  virtual void take(const CanFrame& frame) = 0;
  /// Performs what is due. Called after take(), and at least every 50 ms.
  virtual void advance(nanoseconds now) = 0;
  /// Frames to send, oldest first; each is returned once.
  [[nodiscard]] virtual std::optional<CanFrame> next_frame() = 0;

  [[nodiscard]] virtual std::span<const Reading> readings() const = 0;
  /// Bytes that each reading was decoded from, for display.
  [[nodiscard]] virtual std::vector<RawReading> raw() const = 0;
  [[nodiscard]] virtual std::vector<UnitHealth> health(nanoseconds now) const = 0;
};

}  // namespace thermocomp
