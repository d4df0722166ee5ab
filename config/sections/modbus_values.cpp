#include "config/sections/modbus_values.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <cfloat>
#include <cmath>
#include <limits>
#include <optional>

#include "config/sections/common.hpp"

namespace thermocomp::sections {
namespace {

constexpr int address_max = 65535;

const Names<Encoding>& encodings() {
  static const Names<Encoding> names{
      {"int16", Encoding::int16},   {"uint16", Encoding::uint16},   {"int32", Encoding::int32},
      {"uint32", Encoding::uint32}, {"float32", Encoding::float32}, {"float64", Encoding::float64}};
  return names;
}

const Names<WordOrder>& word_orders() {
  static const Names<WordOrder> names{{"ABCD", WordOrder::abcd},
                                      {"DCBA", WordOrder::dcba},
                                      {"BADC", WordOrder::badc},
                                      {"CDAB", WordOrder::cdab}};
  return names;
}

const Names<ModbusTable>& all_tables() {
  static const Names<ModbusTable> names{{"coil", ModbusTable::coil},
                                        {"discrete_input", ModbusTable::discrete_input},
                                        {"holding", ModbusTable::holding},
                                        {"input", ModbusTable::input}};
  return names;
}

const Names<ModbusTable>& register_tables() {
  static const Names<ModbusTable> names{{"input", ModbusTable::input},
                                        {"holding", ModbusTable::holding}};
  return names;
}

const Names<ModbusTable>& writable_tables() {
  static const Names<ModbusTable> names{{"holding", ModbusTable::holding}};
  return names;
}

struct Codes {
  std::int64_t low;
  std::int64_t high;
};

/// Range of raw values of an encoding; for a float the integers that it represents exactly.
Codes codes_of(Encoding encoding) {
  switch (encoding) {
    case Encoding::int16:
      return {-0x8000, 0x7FFF};
    case Encoding::uint16:
      return {0, 0xFFFF};
    case Encoding::int32:
      return {-0x80000000LL, 0x7FFFFFFFLL};
    case Encoding::uint32:
      return {0, 0xFFFFFFFFLL};
    case Encoding::float32:
      return {-(1LL << 24), 1LL << 24};
    case Encoding::float64:
      break;
  }
  return {-(1LL << 53), 1LL << 53};
}

/// Whether it may be a host name, an IPv4 or an IPv6 address.
bool is_host(const std::string& host) {
  constexpr std::size_t name_max = 253;
  if (host.empty() || host.size() > name_max) return false;
  std::array<unsigned char, sizeof(in6_addr)> address{};
  if (host.find(':') != std::string::npos) {
    return inet_pton(AF_INET6, host.substr(0, host.find('%')).c_str(), address.data()) == 1;
  }
  if (host.find_first_not_of("0123456789.") == std::string::npos) {
    return inet_pton(AF_INET, host.c_str(), address.data()) == 1;
  }
  constexpr std::string_view allowed =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_";
  return host.find_first_not_of(allowed) == std::string::npos && host.front() != '.' &&
         host.front() != '-' && host.find("..") == std::string::npos;
}

ModbusTcp read_tcp(const TomlTable& table, std::string_view kind) {
  ModbusTcp tcp;
  tcp.rtu_frames = kind == "modbus_rtu_over_tcp";
  tcp.datagrams = kind == "modbus_udp";
  tcp.host = table.text("host");
  if (!tcp.host.empty() && !is_host(tcp.host)) {
    table.problem("host", "must be a host's name or an IP address");
  }
  if (kind == "s7") {
    constexpr int db_max = 65535;
    tcp.port = S7Block::port;
    S7Block& block = tcp.s7.emplace();
    block.db = table.integer("db", 1, db_max);
    block.rack = table.integer("rack", 0, 7, block.rack);
    block.slot = table.integer("slot", 0, S7Block::slots - 1, block.slot);
  }
  tcp.port = table.integer("port", 1, 65535, tcp.port);
  refuse_all(table, {"device", "baud", "parity", "data_bits", "stop_bits", "rs485"},
             "does not apply to kind = \"" + std::string(kind) + "\"");
  return tcp;
}

ModbusRtu read_rtu(const TomlTable& table) {
  // The baud rates of Linux' termios.
  constexpr std::array bauds{300,    600,    1200,    1800,    2400,    4800,   9600,
                             19200,  38400,  57600,   115200,  230400,  460800, 500000,
                             576000, 921600, 1000000, 1152000, 1500000, 2000000};
  ModbusRtu rtu;
  rtu.device = table.text("device");
  if (!rtu.device.empty() && rtu.device.front() != '/') {
    table.problem("device", "must be an absolute path such as \"/dev/ttyUSB0\"");
  }
  rtu.baud = table.integer("baud", bauds.front(), bauds.back());
  if (std::find(bauds.begin(), bauds.end(), rtu.baud) == bauds.end()) {
    table.problem("baud", "must be a usual rate: 1200 ... 9600 19200 38400 57600 115200 ...");
  }
  rtu.parity = table.choice<char>("parity", {{"none", 'N'}, {"even", 'E'}, {"odd", 'O'}});
  rtu.data_bits = table.integer("data_bits", 7, 8, rtu.data_bits);
  rtu.stop_bits = table.integer("stop_bits", 1, 2, rtu.stop_bits);
  rtu.rs485 = table.flag("rs485", rtu.rs485);
  refuse_all(
      table, {"host", "port"},
      "does not apply to kind = \"modbus_rtu\", which is a serial port; serial frames through "
      "a serial server are kind = \"modbus_rtu_over_tcp\"");
  return rtu;
}

/// Refuses a value that extends beyond the last register.
void check_address(const TomlTable& table, int address, Encoding encoding) {
  const auto count = static_cast<int>(registers_of(encoding));
  if (address + count - 1 <= address_max) return;
  table.problem("address", "the value takes " + std::to_string(count) +
                               " registers and would pass register 65535");
}

struct NumberedTable {
  int first;  ///< a manual's number for the first register; with six digits ten times as large
  ModbusTable table;
};
constexpr std::array numbered_tables{NumberedTable{10001, ModbusTable::discrete_input},
                                     NumberedTable{30001, ModbusTable::input},
                                     NumberedTable{40001, ModbusTable::holding}};

/// "400021" is not an address on the wire, but the manual's number for holding register 20.
std::optional<std::pair<ModbusTable, int>> numbered_address(int address) {
  for (const NumberedTable& each : numbered_tables) {
    const int first = 10 * (each.first - 1) + 1;
    if (address >= first && address <= first + address_max)
      return std::pair(each.table, address - first);
  }
  return std::nullopt;
}

/// Explanation of a manual's register number, for a rule.
std::string number_rule(int address) {
  const auto found = numbered_address(address);
  const std::string table = !found                                 ? ""
                            : found->first == ModbusTable::input   ? "input"
                            : found->first == ModbusTable::holding ? "holding"
                                                                   : "discrete_input";
  return found ? "the number in a manual: on the wire it is table = \"" + table +
                     "\", address = " + std::to_string(found->second)
               : "must be a whole number in [0, 65535]";
}

/// @param table  of the register; must agree with a manual's number (400021)
std::uint16_t read_address(const TomlTable& table, ModbusTable of) {
  const int address =
      table.integer("address", std::numeric_limits<int>::min(), std::numeric_limits<int>::max());
  if (!table.has("address")) return 0;
  if (address >= 0 && address <= address_max) return static_cast<std::uint16_t>(address);
  const auto found = numbered_address(address);
  if (found && found->first == of) return static_cast<std::uint16_t>(found->second);
  table.problem("address", number_rule(address));
  return 0;
}

/// @param base_address  first register of the device; does not apply to bits
ModbusStatus read_status(const TomlTable& table, int base_address) {
  ModbusStatus status;
  status.table = table.choice("table", all_tables());
  status.address = read_address(table, status.table);
  if (is_bit_table(status.table)) {
    table.refuse("mask", "does not apply to a bit");
    status.codes = read_status_codes(table, 1, 1);
    return status;
  }
  if (status.address + base_address > address_max) {
    table.problem("address", "exceeds register 65535 with the device's base_address");
  } else {
    status.address = static_cast<std::uint16_t>(status.address + base_address);
  }
  const int mask = table.integer("mask", 1, 0xFFFF, 0xFFFF);
  status.mask = static_cast<std::uint16_t>(mask);
  status.codes = read_status_codes(table, 0xFFFF, mask);
  return status;
}

}  // namespace

ModbusLine read_modbus_line(const TomlTable& table, std::string_view kind) {
  ModbusLine line;
  if (kind == "modbus_rtu") {
    line.link = read_rtu(table);
  } else {
    line.link = read_tcp(table, kind);
  }
  if (kind == "modbus_tcp" || kind == "modbus_udp")
    line.ignore_transaction = table.flag("ignore_transaction", line.ignore_transaction);
  else if (kind != "s7")
    table.refuse("ignore_transaction", "does not apply to serial frames, which have no number");
  line.timeout_ms = table.number("timeout_ms", Range::between(1, 60000), line.timeout_ms);
  line.inter_frame_delay_ms =
      table.number("inter_frame_delay_ms", Range::between(0, 1000), line.inter_frame_delay_ms);
  line.reconnect_s = table.number("reconnect_s", Range::between(0.01, 3600), line.reconnect_s);
  line.backoff_s_max =
      table.number("backoff_s_max", Range::between(0.01, 3600), line.backoff_s_max);
  line.retries = table.integer("retries", 0, 10, line.retries);
  return line;
}

int read_unit(const TomlTable& table, const ModbusLine& line) {
  const auto* tcp = std::get_if<ModbusTcp>(&line.link);
  const bool is_tcp = tcp != nullptr && !tcp->rtu_frames;
  const int unit = table.integer("unit", 0, 255);
  if (!is_tcp && unit == 0 && table.has("unit")) {
    table.problem("unit", "0 is the broadcast address, which gets no answer; must be in [1, 247]");
  }
  if (unit > 247 && !(is_tcp && unit == 255)) {
    table.problem("unit", is_tcp ? "must be in [0, 247] or 255" : "must be in [1, 247]");
  }
  return unit;
}

namespace {

void read_number(const TomlTable& table, RegisterUse use, ModbusValue& value) {
  if (use == RegisterUse::written_bits) {
    value.encoding = table.choice<Encoding>(
        "encoding", {{"uint16", Encoding::uint16}, {"uint32", Encoding::uint32}});
    table.refuse("scale", "does not apply to a count or bits");
  } else {
    value.encoding = table.choice("encoding", encodings());
    value.scale = read_scale(table, value.scale);
  }
}

}  // namespace

ModbusValue read_modbus_value(const TomlTable& table, RegisterUse use) {
  ModbusValue value;
  const bool is_written = use == RegisterUse::written || use == RegisterUse::written_bits;
  const Names<ModbusTable>& tables = is_written                   ? writable_tables()
                                     : use == RegisterUse::signal ? all_tables()
                                                                  : register_tables();
  value.table = table.choice("table", tables);
  value.address = read_address(table, value.table);
  if (is_bit_table(value.table)) {
    refuse_all(table, {"encoding", "word_order", "scale"}, "does not apply to a bit");
    value.encoding = Encoding::uint16;
    return value;
  }
  read_number(table, use, value);
  value.word_order = table.choice("word_order", word_orders(), value.word_order);
  check_address(table, value.address, value.encoding);
  return value;
}

ModbusValue read_s7_value(const TomlTable& table, RegisterUse use) {
  ModbusValue value;
  value.table = ModbusTable::data_block;
  const int byte = table.integer("address", 0, S7Block::byte_max);
  if (byte % 2 != 0)
    table.problem("address", "must be even: it is the byte where the value begins");
  value.address = static_cast<std::uint16_t>(byte / 2);
  refuse_all(table, {"table", "word_order"}, "does not apply to kind = \"s7\"");
  read_number(table, use, value);
  return value;
}

ModbusChannel read_modbus_channel(const TomlTable& sensor, const TomlTable& device) {
  ModbusChannel channel;
  // Keys are read in both tables, so that an unused default is checked as well.
  const auto required = [&](std::string_view key) {
    const bool in_device = device.has(key);
    if (!sensor.has(key) && !in_device) {
      sensor.problem(key, "must be given, here or as default in the device");
    }
  };
  required("table");
  required("encoding");
  channel.table = sensor.choice("table", register_tables(),
                                device.choice("table", register_tables(), channel.table));
  channel.encoding = sensor.choice("encoding", encodings(),
                                   device.choice("encoding", encodings(), channel.encoding));
  channel.word_order = sensor.choice("word_order", word_orders(),
                                     device.choice("word_order", word_orders(), WordOrder::abcd));
  channel.scale = read_scale(sensor, read_scale(device, channel.scale));
  channel.offset_degC = sensor.number("offset_degC", Range::between(-1e4, 1e4),
                                      device.number("offset_degC", Range::between(-1e4, 1e4), 0));
  const int default_mask = device.integer("mask", 1, 0xFFFF, 0xFFFF);
  channel.mask = static_cast<std::uint16_t>(sensor.integer("mask", 1, 0xFFFF, default_mask));
  if (channel.mask != 0xFFFF && registers_of(channel.encoding) != 1)
    sensor.problem("mask", "makes sense for int16 and uint16 only");
  const int base_address = device.integer("base_address", 0, address_max, 0);
  const int address = base_address + read_address(sensor, channel.table);
  check_address(sensor, address, channel.encoding);
  channel.address = static_cast<std::uint16_t>(std::min(address, address_max));
  const Codes codes = codes_of(channel.encoding);
  channel.sentinels = read_codes(sensor, device, codes.low, codes.high);
  if (device.has("status")) channel.status = read_status(device.table("status"), base_address);
  if (sensor.has("status")) channel.status = read_status(sensor.table("status"), base_address);
  refuse_all(sensor, {"id", "start_bit", "length_bits", "byte_order", "extended_id"},
             "does not apply on a Modbus bus");
  return channel;
}

ModbusRenewal read_modbus_renewal(const TomlTable& table) {
  ModbusRenewal renewal;
  renewal.table = table.choice("table", register_tables());
  renewal.address = read_address(table, renewal.table);
  return renewal;
}

double count_of(const ModbusValue& value) {
  if (value.encoding == Encoding::float32) return FLT_TRUE_MIN * std::abs(value.scale);
  if (value.encoding == Encoding::float64) return DBL_TRUE_MIN * std::abs(value.scale);
  return std::abs(value.scale);
}

Range reach(const ModbusValue& value) {
  if (value.encoding == Encoding::float32 || value.encoding == Encoding::float64) {
    const double most = value.encoding == Encoding::float32 ? FLT_MAX : DBL_MAX;
    return Range::between(-most * std::abs(value.scale), most * std::abs(value.scale));
  }
  const Codes codes = codes_of(value.encoding);
  const double a = static_cast<double>(codes.low) * value.scale;
  const double b = static_cast<double>(codes.high) * value.scale;
  return Range::between(std::min(a, b), std::max(a, b));
}

}  // namespace thermocomp::sections
