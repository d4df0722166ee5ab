/// Frames that the simulator sends and receives on one CAN interface.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "drivers/can/can_socket.hpp"

namespace thermocomp {

/// The frames of one device, built from signals.
class CanFrames {
 public:
  void define(const CanSignal& signal);
  /// Saturated where it does not fit; NaN as a float's NaN or an integer's highest code.
  void set_value(const CanSignal& signal, double value);
  void set_code(const CanSignal& signal, std::int64_t code);
  [[nodiscard]] const std::map<CanId, CanFrame>& frames() const noexcept { return frames_; }

 private:
  std::map<CanId, CanFrame> frames_;
};

/// A socket that is opened again by itself.
class CanNode {
 public:
  CanNode(std::string interface, std::vector<CanId> wanted);

  /// Empty: it works; else why not.
  [[nodiscard]] std::string error() const { return socket_.is_open() ? "" : socket_.error(); }
  void keep_open(nanoseconds now);
  void send(const CanFrames& frames);
  /// Newest frame of each identifier that has arrived since the last call.
  [[nodiscard]] std::map<CanId, CanFrame> receive();

 private:
  CanSocket socket_;
  nanoseconds tried_at_{};
};

}  // namespace thermocomp
