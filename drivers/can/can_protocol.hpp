/// What speaks a protocol above CAN frames: fed with frames and times, asked for frames and
/// readings. No socket, no clock, no thread, so that it runs in tests, in tools and in a driver.
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

/// The bytes behind a reading, as they came; empty: none since the bus or its node was lost.
struct RawReading {
  std::vector<std::uint8_t> value;   ///< frame, object, or part of a long message
  std::vector<std::uint8_t> status;  ///< where it is asked for separately
};

class CanProtocol {
 public:
  CanProtocol() = default;
  CanProtocol(const CanProtocol&) = delete;
  CanProtocol& operator=(const CanProtocol&) = delete;
  virtual ~CanProtocol() = default;

  /// Frames to receive; all others need not be given to take().
  [[nodiscard]] virtual std::vector<CanFilter> wanted() const = 0;
  /// For each reading its sensor's index in the whole configuration.
  [[nodiscard]] virtual std::vector<std::size_t> sensors() const = 0;

  virtual void opened(nanoseconds now) = 0;  ///< the bus can be used from now on
  virtual void closed(nanoseconds now) = 0;  ///< ... no longer; every reading becomes no_answer
  virtual void take(const CanFrame& frame) = 0;
  /// Does what is due by now. To be called after take(), and at least every 50 ms.
  virtual void advance(nanoseconds now) = 0;
  /// Frames to send, oldest first; each is given once.
  [[nodiscard]] virtual std::optional<CanFrame> next_frame() = 0;

  [[nodiscard]] virtual std::span<const Reading> readings() const = 0;
  /// What each reading was decoded from, for a person.
  [[nodiscard]] virtual std::vector<RawReading> raw() const = 0;
  [[nodiscard]] virtual std::vector<UnitHealth> health(nanoseconds now) const = 0;
};

}  // namespace thermocomp
