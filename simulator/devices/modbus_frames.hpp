/// Framing of Modbus requests over TCP and serial lines, without I/O.
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
  broken  ///< cannot become a request
};

/// Frame at the start of a byte stream.
struct ModbusFrame {
  FrameState state{FrameState::incomplete};
  std::size_t length{0};         ///< complete: total bytes
  std::uint16_t transaction{0};  ///< TCP
  std::uint8_t unit{0};
  std::span<const std::uint8_t> pdu;  ///< complete: within the bytes given
};

[[nodiscard]] ModbusFrame find_tcp_frame(std::span<const std::uint8_t> bytes);
[[nodiscard]] std::vector<std::uint8_t> make_tcp_frame(std::uint16_t transaction, std::uint8_t unit,
                                                       std::span<const std::uint8_t> pdu);

/// @param after_silence  the line has been silent, so no more bytes follow
[[nodiscard]] ModbusFrame find_rtu_frame(std::span<const std::uint8_t> bytes, bool after_silence);
[[nodiscard]] std::vector<std::uint8_t> make_rtu_frame(std::uint8_t unit,
                                                       std::span<const std::uint8_t> pdu);
[[nodiscard]] std::uint16_t modbus_crc(std::span<const std::uint8_t> bytes);

struct WireAnswer {
  std::vector<std::uint8_t> bytes;  ///< PDU; if `raw`, all bytes sent
  bool raw{false};
  double delay_ms{0.0};
};

}  // namespace thermocomp
