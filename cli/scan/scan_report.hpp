/// Result of `thermocomp scan` as text and JSON, with hints for implausible registers.
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
  std::string raw;    ///< bytes in wire order, "00 D7"; empty: none received
  double temp_degC{not_a_number};
  Fault fault{Fault::never_read};
  std::string why;                 ///< empty: good
  std::vector<std::string> hints;  ///< likely corrections
  /// Raw value that most modules send for a broken wire and that the configuration lacks.
  std::optional<std::int64_t> likely_open_code;
  std::optional<double> round_trip_ms;
  std::optional<double> age_s;
  [[nodiscard]] bool good() const noexcept { return fault == Fault::none; }
};

struct ScanDevice {
  std::string name;
  std::string address;  ///< "unit 3"; empty on CAN
  bool answers{false};
  std::string note;  ///< fault of the whole device, or an unlikely unit
  std::vector<ScanChannel> channels;
};

struct ScanBus {
  std::string name;
  std::string kind;   ///< as in the configuration
  std::string where;  ///< "192.168.10.20:502", "/dev/ttyUSB0", "can0"
  std::string error;  ///< empty: usable
  std::string note;
  std::string found;  ///< result of a search for units or nodes; empty: no search
  std::vector<int> found_numbers;
  std::vector<ScanDevice> devices;
};

/// A register, bit or signal of the controller.
struct ScanValue {
  std::string what;  ///< "applied offset of axis z", "spindle_rpm"
  std::string place;
  bool is_written{false};      ///< written by the daemon, and read here
  bool is_needed{true};        ///< the daemon must read it
  std::string raw;             ///< as ScanChannel::raw
  double value{not_a_number};  ///< in `unit`
  std::string unit;
  std::string why;  ///< empty: present
  std::optional<double> round_trip_ms;
  [[nodiscard]] bool is_there() const noexcept { return why.empty(); }
  [[nodiscard]] bool is_missing() const noexcept { return is_needed && !is_there(); }
};

struct ScanController {
  std::string name;
  std::string kind;
  std::string where;    ///< as ScanBus::where
  std::string address;  ///< "unit 1"; empty on CAN
  std::string error;    ///< empty: could be polled
  std::string refused;  ///< reason why the daemon could not read or write it; empty: none
  std::string writes;   ///< result of the writes, or why they were not tried
  std::vector<ScanValue> values;
  [[nodiscard]] bool is_complete() const;
};

struct ScanReport {
  std::string file;
  std::vector<ScanBus> buses;
  std::optional<ScanController> controller{};  ///< none: not scanned
};

/// Marks a channel whose values alternate between two levels: two senders.
/// @param temps_degC  in the order of their arrival
void judge_turns(std::span<const double> temps_degC, ScanChannel& result);

[[nodiscard]] std::size_t count_channels(const ScanReport& report);
[[nodiscard]] std::size_t count_good(const ScanReport& report);
/// Notes devices whose temperatures are those of a room in degF.
void note_fahrenheit(ScanReport& report);
/// True if every channel gives a temperature and all values of the controller are present.
[[nodiscard]] bool is_complete(const ScanReport& report);

/// @param colours  for a terminal
[[nodiscard]] std::string scan_text(const ScanReport& report, bool colours);
[[nodiscard]] nlohmann::ordered_json scan_json(const ScanReport& report);

/// Two hexadecimal digits per byte, separated by spaces.
[[nodiscard]] std::string hex_bytes(const std::vector<std::uint8_t>& bytes);
/// Likewise for registers, in wire order.
[[nodiscard]] std::string hex_words(std::span<const std::uint16_t> words);

/// Limits of a sensor from its [screening].
struct PlausibleRange {
  double min_degC{-30.0};
  double max_degC{200.0};
};

/// Within range, and not a float so close to 0 that its byte order must be wrong.
[[nodiscard]] bool is_plausible(const ModbusChannel& channel, double temp_degC,
                                const PlausibleRange& range);

/// The raw value if most modules send it for a broken wire: an end of the encoding's range.
[[nodiscard]] std::optional<std::int64_t> likely_open_code(const ModbusChannel& channel,
                                                           std::span<const std::uint16_t> words);

/// Sentences with the word orders, scales and codes that would make a temperature plausible.
/// @param words  of the channel's value
[[nodiscard]] std::vector<std::string> hints_for_words(const ModbusChannel& channel,
                                                       std::span<const std::uint16_t> words,
                                                       const PlausibleRange& range);

/// Hints for a refused address (exception 2 or 3), from the address alone.
[[nodiscard]] std::vector<std::string> hints_for_address(const ModbusChannel& channel);

}  // namespace thermocomp::cli
