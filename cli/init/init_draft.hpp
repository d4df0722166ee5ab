/// What `thermocomp init` knows of a machine, and the configuration that comes of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp::cli {

/// A value in registers as a person writes it: "holding:0:int32:0.01", "input:26:uint16",
/// "discrete_input:0"; behind the type "/CDAB" gives another word order.
struct InitPlace {
  std::string table;
  int address{0};
  std::string encoding;  ///< empty: a bit
  std::string word_order{"ABCD"};
  double scale{1.0};
};

struct InitBus {
  std::string name;
  std::variant<ModbusTcp, ModbusRtu> link;
};

struct InitChannel {
  std::string sensor;  ///< empty: not named yet
  int number{0};       ///< channel of the preset, or address
};

struct InitModule {
  std::string name;
  std::size_t bus{0};  ///< index
  int unit{1};
  std::string preset;        ///< empty: `registers` says how its values are read
  std::string thermocouple;  ///< where the preset asks for the type
  std::optional<int> base_address;
  InitPlace registers;  ///< its address is that of no channel
  /// Beside `registers`: raw values that are no temperatures.
  std::vector<std::int64_t> open_circuit_codes;
  std::vector<InitChannel> channels;
};

struct InitSignal {
  std::string name;
  InitPlace place;
};

struct InitController {
  std::string kind{"dry_run"};  ///< or one of modbus_kinds, linuxcnc
  std::variant<ModbusTcp, ModbusRtu> link;
  int unit{1};
  InitPlace offset{"holding", 0, "int32", "ABCD", 0.01};
  std::optional<InitPlace> applied{InitPlace{"input", 0, "int32", "ABCD", 0.01}};
  std::optional<InitPlace> valid_bits{InitPlace{"holding", 10, "uint16", "ABCD", 1.0}};
  std::optional<InitPlace> heartbeat{InitPlace{"holding", 11, "uint16", "ABCD", 1.0}};
  std::vector<InitSignal> signals;
  bool dry_run{false};    ///< of a Modbus controller: all of it is read and nothing is written
  bool reads_gaps{true};  ///< registers between its values can be read along
  [[nodiscard]] bool is_modbus() const { return kind.starts_with("modbus_"); }
};

struct InitDraft {
  std::vector<InitBus> buses;
  std::vector<InitModule> modules;
  InitController controller;
  std::vector<std::string> axes;
  std::string model_file{"model.toml"};  ///< beside the configuration
  /// The model's inputs where it exists already; each must be the name of a sensor and `_degC`.
  std::vector<std::string> model_inputs;
  /// What it reads from the controller.
  std::vector<std::string> model_signals;
  std::vector<std::string> model_outputs;
  double offset_um_max{5.0};
  double rate_um_per_s_max{0.5};
  /// State, history and socket beside the configuration, for one that is not the machine's own.
  std::string own_folder;  ///< absolute; empty: where the package puts them
};

/// "Z" -> "z_um", or what the model calls it: "z_um", "Z_um", "c_urad".
[[nodiscard]] std::string output_name(const InitDraft& draft, const std::string& axis);
/// "bus1 (192.168.10.20:502)"
[[nodiscard]] std::string bus_text(const InitBus& bus);
/// "bed" -> "bed_degC".
[[nodiscard]] std::string input_name(const std::string& sensor);
/// The commented configuration.
[[nodiscard]] std::string configuration_text(const InitDraft& draft);
/// The model of a machine of which nothing is known yet: it has every sensor and every axis and
/// gives no displacement.
[[nodiscard]] std::string first_model_text(const InitDraft& draft);

}  // namespace thermocomp::cli
