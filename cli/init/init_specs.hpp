/// Parsers of the short forms that `thermocomp init` accepts as options or answers.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "cli/init/init_draft.hpp"

namespace thermocomp::cli {

inline constexpr const char* link_forms =
    "tcp:HOST[:PORT], udp:HOST[:PORT], rtu_over_tcp:HOST[:PORT] or rtu:DEVICE[:BAUD[:PARITY]]";

/// "tcp:192.168.10.20", "udp:HOST:PORT", "rtu:/dev/ttyUSB0", "rtu:DEVICE:BAUD:PARITY"; also a host
/// or path alone. @throws Failure naming the problem
[[nodiscard]] std::variant<ModbusTcp, ModbusRtu> parse_link(const std::string& text);

/// "holding:0:int32:0.01"; see InitPlace. @throws Failure
[[nodiscard]] InitPlace parse_place(const std::string& text);

/// "1-4,7" -> 1 2 3 4 7. @throws Failure
[[nodiscard]] std::vector<int> parse_numbers(const std::string& text);
/// "x,y, z" -> x y z; blanks separate too.
[[nodiscard]] std::vector<std::string> parse_words(const std::string& text);
/// "x,z2" -> x z2. @throws Failure if a word is not an axis letter with an optional number
[[nodiscard]] std::vector<std::string> parse_axes(const std::string& text);

/// "3=wago_750_458", "3=wago_750_458:1-4", "2/7=icpdas_m7018" (second bus), or without a preset
/// "3=input:int16:0.1:0-7:32767" (table, encoding, degC per count, addresses and, optionally,
/// open-circuit codes). A preset's suffix "/K" gives the thermocouple, "@100" the base address.
/// Without channels, all of the preset are tried. @throws Failure
[[nodiscard]] InitModule parse_module(const std::string& text);
/// The part after the unit: "wago_750_458:1-4". @throws Failure
void parse_form(const std::string& text, InitModule& module);

/// "none", "linuxcnc", or a link with "@UNIT" (default 1). @throws Failure
[[nodiscard]] InitController parse_controller(const std::string& text);
/// "spindle_rpm=input:26:uint16". @throws Failure
[[nodiscard]] InitSignal parse_signal(const std::string& text);

}  // namespace thermocomp::cli
