#include "drivers/can/canopen/emergency.hpp"

#include <algorithm>
#include <cstdio>
#include <string_view>

#include "drivers/can/signal_codec.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t emergency_bytes = 8;
constexpr std::uint16_t jumo_sensor_error = 0x5030;
constexpr std::uint8_t jumo_break = 0x01;
constexpr std::uint8_t jumo_short = 0x02;
constexpr std::uint8_t jumo_short_as_printed = 0x10;

/// By the high byte of the code.
std::string_view class_name(std::uint16_t code) noexcept {
  switch (code >> 8) {
    case 0x00:
      return "error reset";
    case 0x10:
      return "generic error";
    case 0x50:
      return "device hardware";
    case 0x70:
      return "additional modules";
    case 0x80:
      return "monitoring";
    case 0x81:
      return "communication";
    case 0x82:
      return "protocol error";
    case 0x90:
      return "external error";
    case 0xF0:
      return "additional functions";
    case 0xFF:
      return "device specific";
    default:
      break;
  }
  switch (code >> 12) {
    case 0x2:
      return "current";
    case 0x3:
      return "voltage";
    case 0x4:
      return "temperature";
    case 0x6:
      return "device software";
    default:
      return "error";
  }
}

}  // namespace

std::optional<Emergency> read_emergency(std::span<const std::uint8_t> data) noexcept {
  if (data.size() != emergency_bytes) return std::nullopt;
  Emergency emergency;
  emergency.code = static_cast<std::uint16_t>(little_endian(data, 0, 2));
  emergency.error_register = data[2];
  std::copy(data.begin() + 3, data.end(), emergency.more.begin());
  return emergency;
}

std::string to_string(const Emergency& emergency) {
  std::array<char, 16> code{};
  std::array<char, 24> rest{};
  std::snprintf(code.data(), code.size(), "0x%04X ", static_cast<unsigned>(emergency.code));
  std::snprintf(rest.data(), rest.size(), " (register 0x%02X)",
                static_cast<unsigned>(emergency.error_register));
  return std::string(code.data()).append(class_name(emergency.code)).append(rest.data());
}

std::optional<Fault> emergency_fault(const Emergency& emergency, EmergencyForm form,
                                     const CanopenChannel& channel) noexcept {
  const std::uint8_t named = emergency.more[0];
  const bool by_channel = form == EmergencyForm::jumo && channel.emergency_channel != 0;
  if (emergency.is_reset()) {
    if (by_channel && named != 0) {
      return named == channel.emergency_channel ? std::optional(Fault::none) : std::nullopt;
    }
    return emergency.error_register == 0 ? std::optional(Fault::none) : std::nullopt;
  }
  if (by_channel && emergency.code == jumo_sensor_error) {
    if (named != channel.emergency_channel) return std::nullopt;
    const std::uint8_t what = emergency.more[1];
    if (what == jumo_break) return Fault::open_circuit;
    if (what == jumo_short || what == jumo_short_as_printed) return Fault::short_circuit;
    return Fault::device_error;
  }
  const auto& codes = channel.emergency_codes;
  const bool listed = std::find(codes.begin(), codes.end(), emergency.code) != codes.end();
  return listed ? std::optional(Fault::device_error) : std::nullopt;
}

}  // namespace thermocomp
