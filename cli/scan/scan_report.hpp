/// What `thermocomp scan` found, as text for a person and as JSON, and what registers that decode
/// to nothing plausible may be instead. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "drivers/modbus/modbus_config.hpp"
#include "estimator/types.hpp"

namespace thermocomp::cli {

struct ScanChannel {
  std::string sensor;
  std::string place;  ///< "input 0 int16 x 0.1"
  std::string raw;    ///< bytes in the order of the wire, "00 D7"; empty: none came
  double temp_degC{not_a_number};
  Fault fault{Fault::never_read};
  std::string why;                 ///< empty when good
  std::vector<std::string> hints;  ///< what it may be instead, and what to do
  /// A raw value that most modules send for a broken wire, and that the configuration does not
  /// know.
  std::optional<std::int64_t> likely_open_code;
  std::optional<double> round_trip_ms;
  std::optional<double> age_s;
  [[nodiscard]] bool good() const noexcept { return fault == Fault::none; }
};

struct ScanDevice {
  std::string name;
  std::string address;  ///< "unit 3"; empty on a CAN bus
  bool answers{false};
  std::string note;  ///< what is wrong with the device as a whole
  std::vector<ScanChannel> channels;
};

struct ScanBus {
  std::string name;
  std::string kind;   ///< as in the configuration
  std::string where;  ///< "192.168.10.20:502", "/dev/ttyUSB0", "can0"
  std::string error;  ///< empty: it could be used
  std::string note;
  std::string found;  ///< what a search for units or nodes found; empty: none was asked for
  std::vector<int> found_numbers;
  std::vector<ScanDevice> devices;
};

/// A register, bit or signal of the controller.
struct ScanValue {
  std::string what;  ///< "applied offset of axis z", "spindle_rpm"
  std::string place;
  bool is_written{false};      ///< by the daemon; what stands there was read all the same
  bool is_needed{true};        ///< the daemon does not go without reading it
  std::string raw;             ///< as of a channel
  double value{not_a_number};  ///< in `unit`
  std::string unit;
  std::string why;  ///< empty: it is there
  std::optional<double> round_trip_ms;
  [[nodiscard]] bool is_there() const noexcept { return why.empty(); }
  [[nodiscard]] bool is_missing() const noexcept { return is_needed && !is_there(); }
};

struct ScanController {
  std::string name;
  std::string kind;
  std::string where;    ///< as of a bus
  std::string address;  ///< "unit 1"; empty on a CAN bus
  std::string error;    ///< empty: it could be asked
  std::string refused;  ///< not empty: the daemon could not read all of it together, or not write
  std::string writes;   ///< whether they were tried, and if not, why
  std::vector<ScanValue> values;
  [[nodiscard]] bool is_complete() const;
};

struct ScanReport {
  std::string file;
  std::vector<ScanBus> buses;
  std::optional<ScanController> controller{};  ///< none: it cannot be scanned, or was not asked
};

[[nodiscard]] std::size_t count_channels(const ScanReport& report);
[[nodiscard]] std::size_t count_good(const ScanReport& report);
/// Every channel gives a temperature, and nothing of the controller is missing.
[[nodiscard]] bool is_complete(const ScanReport& report);

/// @param colours  for a terminal
[[nodiscard]] std::string scan_text(const ScanReport& report, bool colours);
[[nodiscard]] nlohmann::ordered_json scan_json(const ScanReport& report);

/// Bytes as two hexadecimal digits each, a space between.
[[nodiscard]] std::string hex_bytes(const std::vector<std::uint8_t>& bytes);
/// The same of registers, as they come over the wire.
[[nodiscard]] std::string hex_words(std::span<const std::uint16_t> words);

/// Temperatures that a sensor may have, from its [screening].
struct PlausibleRange {
  double min_degC{-30.0};
  double max_degC{200.0};
};

/// Whether a decoded temperature may be true: in the range, and not a float so near 0 that only
/// the bytes of another number in a wrong order make it.
[[nodiscard]] bool is_plausible(const ModbusChannel& channel, double temp_degC,
                                const PlausibleRange& range);

/// The raw value, where it is one that most modules send for a broken wire: an end of the encoding.
[[nodiscard]] std::optional<std::int64_t> likely_open_code(const ModbusChannel& channel,
                                                           std::span<const std::uint16_t> words);

/// For registers of which the temperature is not plausible: the word orders, scales and codes with
/// which they would be, each a sentence. @param words  of the channel's value
[[nodiscard]] std::vector<std::string> hints_for_words(const ModbusChannel& channel,
                                                       std::span<const std::uint16_t> words,
                                                       const PlausibleRange& range);

/// For an address that the device refuses (exception 2 or 3), from the address alone.
[[nodiscard]] std::vector<std::string> hints_for_address(const ModbusChannel& channel);

}  // namespace thermocomp::cli
