#include "cli/init/init_specs.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

#include <system_error>

#include "report/command.hpp"

namespace thermocomp::cli {
namespace {

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char each : text) {
    if (each == separator)
      parts.emplace_back();
    else
      parts.back() += each;
  }
  return parts;
}

/// Integers may be hexadecimal, 0x8000.
template <class Number>
std::optional<Number> number_of_text(const std::string& text) {
  Number value{};
  const char* end = text.data() + text.size();
  std::from_chars_result result{};
  if constexpr (std::is_integral_v<Number>) {
    constexpr int hexadecimal = 16;
    const bool is_hex = text.starts_with("0x") || text.starts_with("0X");
    result = std::from_chars(text.data() + (is_hex ? 2 : 0), end, value, is_hex ? hexadecimal : 10);
  } else {
    result = std::from_chars(text.data(), end, value);
  }
  const auto [rest, code] = result;
  if (code != std::errc() || rest != end || text.empty()) return std::nullopt;
  return value;
}

int whole_number(const std::string& text, int low, int high, const std::string& what) {
  const auto value = number_of_text<int>(text);
  if (!value || *value < low || *value > high)
    throw Failure(what + ": " + text + " must be a whole number in [" + std::to_string(low) + ", " +
                  std::to_string(high) + "]");
  return *value;
}

char parity_of(const std::string& word) {
  if (word == "none" || word == "N" || word == "n") return 'N';
  if (word == "even" || word == "E" || word == "e") return 'E';
  if (word == "odd" || word == "O" || word == "o") return 'O';
  throw Failure("parity " + word + ": must be none, even or odd");
}

bool is_bit_table_name(const std::string& table) {
  return table == "coil" || table == "discrete_input";
}

/// "int32/CDAB"
void parse_type(const std::string& text, InitPlace& place) {
  constexpr std::array<std::string_view, 6> encodings{"int16",  "uint16",  "int32",
                                                      "uint32", "float32", "float64"};
  constexpr std::array<std::string_view, 4> orders{"ABCD", "DCBA", "BADC", "CDAB"};
  const auto parts = split(text, '/');
  place.encoding = parts[0];
  if (std::find(encodings.begin(), encodings.end(), place.encoding) == encodings.end())
    throw Failure(text + ": the type must be int16, uint16, int32, uint32, float32 or float64");
  if (parts.size() == 1) return;
  place.word_order = parts[1];
  if (parts.size() > 2 || std::find(orders.begin(), orders.end(), place.word_order) == orders.end())
    throw Failure(text + ": the word order must be ABCD, DCBA, BADC or CDAB");
}

double parse_scale(const std::string& text) {
  const auto scale = number_of_text<double>(text);
  if (!scale || !std::isfinite(*scale) || *scale == 0.0)
    throw Failure(text + ": the value of one count must be a number other than 0");
  return *scale;
}

/// "32767,-9999"
std::vector<std::int64_t> parse_codes(const std::string& text) {
  std::vector<std::int64_t> codes;
  for (const std::string& word : parse_words(text)) {
    const auto code = number_of_text<std::int64_t>(word);
    if (!code) throw Failure(text + ": codes must be whole numbers such as 32767,-9999,0x8000");
    codes.push_back(*code);
  }
  return codes;
}

/// A module without a preset: "input:int16:0.1:0-7", "input:int16:0.1:0-7:32767".
void parse_registers(const std::vector<std::string>& parts, const std::string& text,
                     InitModule& module) {
  if (parts.size() != 4 && parts.size() != 5)
    throw Failure(text +
                  ": must be TABLE:TYPE:DEGC_A_COUNT:ADDRESSES[:CODES], such as "
                  "input:int16:0.1:0-7 or, with the code of an open circuit, "
                  "input:int16:0.1:0-7:32767");
  module.registers.table = parts[0];
  parse_type(parts[1], module.registers);
  module.registers.scale = parse_scale(parts[2]);
  for (const int address : parse_numbers(parts[3])) module.channels.push_back({"", address});
  if (parts.size() == 5) module.open_circuit_codes = parse_codes(parts[4]);
}

}  // namespace

namespace {

bool is_host(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '.' || c == '-' || c == '_';
  });
}

}  // namespace

std::vector<std::string> parse_axes(const std::string& text) {
  const std::vector<std::string> axes = parse_words(text);
  for (const std::string& axis : axes) {
    const bool is_axis =
        std::string_view("xyzabcuvwXYZABCUVW").find(axis.front()) != std::string_view::npos &&
        axis.find_first_not_of("0123456789", 1) == std::string::npos;
    if (!is_axis)
      throw Failure(axis +
                    ": must be an axis of the machine: x, y, z, a, b, c, u, v or w, with a "
                    "number where there are several (z2)");
  }
  return axes;
}

std::variant<ModbusTcp, ModbusRtu> parse_link(const std::string& text) {
  constexpr std::array<std::string_view, 4> forms{"tcp", "udp", "rtu_over_tcp", "rtu"};
  std::vector<std::string> parts = split(text, ':');
  if (std::find(forms.begin(), forms.end(), parts[0]) == forms.end())
    parts.insert(parts.begin(), text.starts_with('/') ? "rtu" : "tcp");
  if (parts.size() < 2 || parts[1].empty())
    throw Failure("\"" + text + "\": must be " + link_forms);
  if (parts[0] != "rtu") {
    if (!is_host(parts[1]))
      throw Failure("\"" + parts[1] + "\" is not a host: must be letters, digits, ., - and _");
    ModbusTcp tcp{parts[1], 502, parts[0] == "rtu_over_tcp", parts[0] == "udp"};
    if (parts.size() > 2) tcp.port = whole_number(parts[2], 1, 65535, "port of " + text);
    if (parts.size() > 3) throw Failure(text + ": must be " + parts[0] + ":HOST[:PORT]");
    return tcp;
  }
  ModbusRtu rtu;
  rtu.device = parts[1];
  rtu.baud = 19200;
  rtu.parity = 'E';
  if (parts.size() > 2) rtu.baud = whole_number(parts[2], 300, 4000000, "baud of " + text);
  if (parts.size() > 3) rtu.parity = parity_of(parts[3]);
  if (parts.size() > 4) throw Failure(text + ": must be rtu:DEVICE[:BAUD[:PARITY]]");
  return rtu;
}

InitPlace parse_place(const std::string& text) {
  const std::vector<std::string> parts = split(text, ':');
  InitPlace place;
  place.table = parts[0];
  const bool is_bit = is_bit_table_name(place.table);
  const bool is_register = place.table == "holding" || place.table == "input";
  if (!is_bit && !is_register)
    throw Failure(text + ": must begin with holding, input, coil or discrete_input");
  if (parts.size() < 2 || parts.size() > 4 || (is_bit && parts.size() > 2))
    throw Failure(text + ": must be TABLE:ADDRESS[:TYPE[:VALUE_OF_A_COUNT]], a bit TABLE:ADDRESS");
  place.address = whole_number(parts[1], 0, 65535, "address of " + text);
  if (is_bit) return place;
  place.encoding = "uint16";
  if (parts.size() > 2) parse_type(parts[2], place);
  if (parts.size() > 3) place.scale = parse_scale(parts[3]);
  return place;
}

std::vector<int> parse_numbers(const std::string& text) {
  std::vector<int> numbers;
  for (const std::string& part : parse_words(text)) {
    const std::vector<std::string> ends = split(part, '-');
    const int first = whole_number(ends[0], 0, 65535, text);
    const int last = ends.size() == 1 ? first : whole_number(ends[1], 0, 65535, text);
    constexpr int most = 256;
    if (ends.size() > 2 || last < first || last - first >= most)
      throw Failure(text + ": must be numbers and ranges such as 1-4,7");
    for (int i = first; i <= last; ++i) numbers.push_back(i);
  }
  if (numbers.empty()) throw Failure("\"" + text + "\": must be numbers such as 1-4,7");
  return numbers;
}

std::vector<std::string> parse_words(const std::string& text) {
  std::vector<std::string> words;
  std::string word;
  for (const char each : text + ",") {
    if (each != ',' && each != ' ' && each != '\t') {
      word += each;
    } else if (!word.empty()) {
      words.push_back(word);
      word.clear();
    }
  }
  return words;
}

InitModule parse_module(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos)
    throw Failure(text +
                  ": must be UNIT=PRESET[:CHANNELS], for another bus than the first "
                  "BUS/UNIT=..., without a preset UNIT=TABLE:TYPE:DEGC_A_COUNT:ADDRESSES");
  InitModule module;
  std::vector<std::string> where = split(text.substr(0, equals), '/');
  if (where.size() == 2 && where[0].starts_with("bus"))  // name in the configuration
    where[0].erase(0, 3);
  if (where.size() > 2) throw Failure(text + ": must begin with UNIT= or BUS/UNIT=");
  if (where.size() == 2)
    module.bus = static_cast<std::size_t>(whole_number(where[0], 1, 99, "bus of " + text)) - 1;
  module.unit = whole_number(where.back(), 0, 255, "unit of " + text);
  parse_form(text.substr(equals + 1), module);
  return module;
}

void parse_form(const std::string& text, InitModule& module) {
  const std::vector<std::string> parts = split(text, ':');
  if (parts[0] == "input" || parts[0] == "holding") return parse_registers(parts, text, module);
  std::string preset = parts[0];
  if (const std::size_t at = preset.find('@'); at != std::string::npos) {
    module.base_address = whole_number(preset.substr(at + 1), 0, 65535, "base address of " + text);
    preset.resize(at);
  }
  if (const std::size_t slash = preset.find('/'); slash != std::string::npos) {
    module.thermocouple = preset.substr(slash + 1);
    preset.resize(slash);
  }
  if (preset.empty() || parts.size() > 2)
    throw Failure("\"" + text + "\": must be a preset, such as wago_750_458 or wago_750_458:1-4");
  module.preset = preset;
  if (parts.size() == 2)
    for (const int channel : parse_numbers(parts[1])) module.channels.push_back({"", channel});
}

InitController parse_controller(const std::string& text) {
  InitController controller;
  if (text == "none" || text == "dry_run") return controller;
  if (text == "linuxcnc") {
    controller.kind = "linuxcnc";
    return controller;
  }
  std::string link = text;
  if (const std::size_t at = link.rfind('@'); at != std::string::npos) {
    controller.unit = whole_number(link.substr(at + 1), 0, 255, "unit of " + text);
    link.resize(at);
  }
  controller.link = parse_link(link);
  controller.kind = kind_of({controller.link});
  return controller;
}

InitSignal parse_signal(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    throw Failure(text + ": must be NAME=TABLE:ADDRESS[:TYPE[:VALUE_OF_A_COUNT]]");
  return {text.substr(0, equals), parse_place(text.substr(equals + 1))};
}

}  // namespace thermocomp::cli
