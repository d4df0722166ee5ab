/// Machine description that `thermocomp init` collects, and the configuration made from it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp::cli {

/// Short form of a register value: "holding:0:int32:0.01", "input:26:uint16", "discrete_input:0";
/// "/CDAB" after the type selects another word order.
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
  std::string preset;        ///< empty: `registers` describes the values
  std::string thermocouple;  ///< type, for presets that require it
  std::optional<int> base_address;
  InitPlace registers;  ///< its address is unused
  /// Raw values that mean an open circuit; with `registers`.
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
  bool dry_run{false};    ///< Modbus: everything is read, nothing is written
  bool reads_gaps{true};  ///< registers between its values can be read too
  [[nodiscard]] bool is_modbus() const { return kind.starts_with("modbus_"); }
};

struct InitDraft {
  std::vector<InitBus> buses;
  std::vector<InitModule> modules;
  InitController controller;
  std::vector<std::string> axes;
  std::string model_file{"model.toml"};  ///< relative to the configuration
  /// Inputs of an existing model; each must be the name of a sensor with `_degC`.
  std::vector<std::string> model_inputs;
  std::vector<std::string> model_signals;
  std::vector<std::string> model_outputs;
  double offset_um_max{5.0};
  double rate_um_per_s_max{0.5};
  /// Folder of state, history and socket for a daemon other than the machine's own.
  std::string own_folder;  ///< absolute; empty: the package's folders
};

/// "Z" -> "z_um", or the model's name: "z_um", "Z_um", "c_urad".
[[nodiscard]] std::string output_name(const InitDraft& draft, const std::string& axis);
/// "bus1 (192.168.10.20:502)"
[[nodiscard]] std::string bus_text(const InitBus& bus);
/// "bed" -> "bed_degC".
[[nodiscard]] std::string input_name(const std::string& sensor);
[[nodiscard]] std::string configuration_text(const InitDraft& draft);
/// Initial model without any displacement, with all sensors and axes.
[[nodiscard]] std::string first_model_text(const InitDraft& draft);

}  // namespace thermocomp::cli
