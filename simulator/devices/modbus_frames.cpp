#include "simulator/devices/modbus_frames.hpp"

#include <algorithm>

namespace thermocomp {
namespace {

constexpr std::size_t tcp_header = 7;
constexpr std::size_t pdu_max = 253;
constexpr std::size_t rtu_frame_min = 4;
constexpr std::size_t rtu_frame_max = 256;

/// Length of a serial request from its function; nullopt: unknown function, or too few bytes.
std::optional<std::size_t> rtu_length(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 2) return std::nullopt;
  const std::uint8_t function = bytes[1];
  if (function >= 1 && function <= 6) return 8;
  if (function == 15 || function == 16) {
    if (bytes.size() < 7) return std::nullopt;
    return 9 + std::size_t{bytes[6]};
  }
  return std::nullopt;
}

}  // namespace

ModbusFrame find_tcp_frame(std::span<const std::uint8_t> bytes) {
  ModbusFrame frame;
  if (bytes.size() >= 4 && (bytes[2] != 0 || bytes[3] != 0)) {  // protocol identifier
    frame.state = FrameState::broken;
    return frame;
  }
  if (bytes.size() < tcp_header) return frame;
  const std::size_t length = (std::size_t{bytes[4]} << 8) | bytes[5];  // unit and PDU
  if (length < 2 || length > pdu_max + 1) {
    frame.state = FrameState::broken;
    return frame;
  }
  if (bytes.size() < 6 + length) return frame;
  frame.state = FrameState::complete;
  frame.length = 6 + length;
  frame.transaction = static_cast<std::uint16_t>((bytes[0] << 8) | bytes[1]);
  frame.unit = bytes[6];
  frame.pdu = bytes.subspan(tcp_header, length - 1);
  return frame;
}

std::vector<std::uint8_t> make_tcp_frame(std::uint16_t transaction, std::uint8_t unit,
                                         std::span<const std::uint8_t> pdu) {
  const std::size_t length = pdu.size() + 1;
  std::vector<std::uint8_t> bytes(tcp_header + pdu.size(), 0);
  bytes[0] = static_cast<std::uint8_t>(transaction >> 8);
  bytes[1] = static_cast<std::uint8_t>(transaction & 0xFF);
  bytes[4] = static_cast<std::uint8_t>(length >> 8);
  bytes[5] = static_cast<std::uint8_t>(length & 0xFF);
  bytes[6] = unit;
  std::copy(pdu.begin(), pdu.end(), bytes.begin() + tcp_header);
  return bytes;
}

ModbusFrame find_rtu_frame(std::span<const std::uint8_t> bytes, bool after_silence) {
  ModbusFrame frame;
  std::optional<std::size_t> length = rtu_length(bytes);
  if (!length && after_silence) length = bytes.size();
  if (!length || bytes.size() < *length) {
    const bool hopeless = after_silence || bytes.size() > rtu_frame_max;
    frame.state = hopeless ? FrameState::broken : FrameState::incomplete;
    return frame;
  }
  frame.state = FrameState::broken;
  if (*length < rtu_frame_min || *length > rtu_frame_max) return frame;
  const std::uint16_t crc = modbus_crc(bytes.first(*length - 2));
  if (bytes[*length - 2] != (crc & 0xFF) || bytes[*length - 1] != (crc >> 8)) return frame;
  frame.state = FrameState::complete;
  frame.length = *length;
  frame.unit = bytes[0];
  frame.pdu = bytes.subspan(1, *length - 3);
  return frame;
}

std::vector<std::uint8_t> make_rtu_frame(std::uint8_t unit, std::span<const std::uint8_t> pdu) {
  std::vector<std::uint8_t> bytes(pdu.size() + 3, unit);
  std::copy(pdu.begin(), pdu.end(), bytes.begin() + 1);
  const std::uint16_t crc = modbus_crc(std::span(bytes).first(pdu.size() + 1));
  bytes[pdu.size() + 1] = static_cast<std::uint8_t>(crc & 0xFF);
  bytes[pdu.size() + 2] = static_cast<std::uint8_t>(crc >> 8);
  return bytes;
}

std::uint16_t modbus_crc(std::span<const std::uint8_t> bytes) {
  std::uint16_t crc = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    crc = static_cast<std::uint16_t>(crc ^ byte);
    for (int bit = 0; bit < 8; ++bit) {
      const bool carry = (crc & 1) != 0;
      crc = static_cast<std::uint16_t>((crc >> 1) ^ (carry ? 0xA001 : 0));
    }
  }
  return crc;
}

}  // namespace thermocomp
