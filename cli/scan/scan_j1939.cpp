// Scan of a J1939 bus: requests NAMEs, and claims an address if configured.
#include <algorithm>

#include "cli/scan/scan_protocol.hpp"
#include "drivers/can/j1939/j1939_line.hpp"
#include "drivers/can/signal_codec.hpp"

namespace thermocomp::cli {
namespace {

bool has_code(const std::vector<Sentinel>& sentinels, std::int64_t code) {
  return std::any_of(sentinels.begin(), sentinels.end(),
                     [&](const Sentinel& each) { return each.code == code; });
}

std::string why_not(const J1939Parameter& parameter, Fault fault, const RawReading& raw) {
  constexpr std::size_t frame_bytes = 8;
  if (fault == Fault::bad_frame) return too_few(raw);
  J1939Parameter place = parameter;
  const auto bytes = static_cast<std::size_t>((place.start_bit + place.length_bits + 7) / 8);
  if (static_cast<std::size_t>(place.start_byte) + bytes > frame_bytes &&
      raw.value.size() <= frame_bytes) {
    place.start_byte = 0;  // a longer group's reading holds only its own bytes
  }
  if (decode(raw.value, place).fault == Fault::none)
    return "the bytes would be a value, but the device is in trouble, see above";
  const std::uint64_t number = extract_raw(raw.value, place);
  if (has_code(place.sentinels, static_cast<std::int64_t>(number))) return its_code;
  constexpr std::uint64_t not_available = 0xFF;
  constexpr std::uint64_t error = 0xFE;
  if (place.length_bits % 8 != 0) return "a message of the standard, no value";
  const std::uint64_t top = number >> (place.length_bits - 8);
  if (top == not_available) return "the standard's \"not available\"";
  return top == error ? "the standard's \"error\"" : "beyond the standard's range for values";
}

}  // namespace

ScanBus scan_bus(const J1939BusConfig& config, const ScanSensors& sensors, const ScanTask& task) {
  ProtocolBus bus{config.name, config.outline(), {}, {}};
  for (const J1939NodeConfig& node : config.nodes) {
    for (const J1939Channel& channel : node.channels) {
      std::string place = "PGN ";
      place.append(std::to_string(channel.parameter.pgn)).append(" byte ");
      place.append(std::to_string(channel.parameter.start_byte + 1));
      bus.places.push_back({bus.devices.size(), channel.sensor, std::move(place),
                            [&channel](Fault fault, const RawReading& raw) {
                              return why_not(channel.parameter, fault, raw);
                            }});
    }
    const std::string address =
        node.address ? "address " + hexadecimal(static_cast<std::uint32_t>(*node.address), 2)
                     : "by its NAME";
    bus.devices.push_back({node.name, address, false, "", {}});
  }
  J1939Line line(config);
  return scan_protocol(std::move(bus), line, sensors, task);
}

}  // namespace thermocomp::cli
