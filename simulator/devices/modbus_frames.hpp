/// Where a Modbus request ends, over TCP and over a serial line. Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace thermocomp {

enum class FrameState {
  incomplete,  ///< more bytes are needed
  complete,
  broken  ///< these bytes can never become a request
};

/// What was found at the front of a stream of bytes.
struct ModbusFrame {
  FrameState state{FrameState::incomplete};
  std::size_t length{0};         ///< complete: bytes of the whole frame
  std::uint16_t transaction{0};  ///< TCP
  std::uint8_t unit{0};
  std::span<const std::uint8_t> pdu;  ///< complete: part of the bytes given
};

[[nodiscard]] ModbusFrame find_tcp_frame(std::span<const std::uint8_t> bytes);
[[nodiscard]] std::vector<std::uint8_t> make_tcp_frame(std::uint16_t transaction, std::uint8_t unit,
                                                       std::span<const std::uint8_t> pdu);

/// @param after_silence  the line has been quiet: what is there is all there will be
[[nodiscard]] ModbusFrame find_rtu_frame(std::span<const std::uint8_t> bytes, bool after_silence);
[[nodiscard]] std::vector<std::uint8_t> make_rtu_frame(std::uint8_t unit,
                                                       std::span<const std::uint8_t> pdu);
[[nodiscard]] std::uint16_t modbus_crc(std::span<const std::uint8_t> bytes);

/// What a unit gives back for a request.
struct WireAnswer {
  std::vector<std::uint8_t> bytes;  ///< PDU, or the whole of what is sent when `raw`
  bool raw{false};
  double delay_ms{0.0};
};

}  // namespace thermocomp
