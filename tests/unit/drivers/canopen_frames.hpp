/// Frames in the tests of CANopen: identifier and bytes.
#pragma once

#include <cstdint>
#include <ostream>
#include <vector>

#include <catch2/catch.hpp>

#include "drivers/can/can_socket.hpp"

namespace thermocomp {

using Bytes = std::vector<std::uint8_t>;

inline Bytes bytes_of(const CanFrame& frame) {
  return {frame.payload().begin(), frame.payload().end()};
}

/// A frame that the client has to send: identifier and bytes.
struct Sent {
  std::uint32_t id{0};
  Bytes bytes;
  bool operator==(const Sent&) const = default;
};
inline std::ostream& operator<<(std::ostream& out, const Sent& sent) {
  out << std::hex << sent.id << '#';
  for (const int byte : sent.bytes) out << ' ' << byte;
  return out << std::dec;
}

template <class Machine>
std::vector<Sent> sent_by(Machine& machine) {
  std::vector<Sent> sent;
  while (const auto frame = machine.next_frame()) {
    CHECK_FALSE(frame->id.extended);
    sent.push_back({frame->id.id, bytes_of(*frame)});
  }
  return sent;
}

}  // namespace thermocomp
