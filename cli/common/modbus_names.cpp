#include "cli/common/modbus_names.hpp"

#include <array>
#include <variant>

#include "config/text/printable_text.hpp"

namespace thermocomp::cli {

std::string table_name(ModbusTable table) {
  switch (table) {
    case ModbusTable::coil:
      return "coil";
    case ModbusTable::discrete_input:
      return "discrete_input";
    case ModbusTable::holding:
      return "holding";
    case ModbusTable::data_block:
      return "data block";
    case ModbusTable::input:
      break;
  }
  return "input";
}

std::string order_name(WordOrder order) {
  switch (order) {
    case WordOrder::abcd:
      return "ABCD";
    case WordOrder::dcba:
      return "DCBA";
    case WordOrder::badc:
      return "BADC";
    case WordOrder::cdab:
      break;
  }
  return "CDAB";
}

std::string encoding_name(Encoding encoding) {
  switch (encoding) {
    case Encoding::int16:
      return "int16";
    case Encoding::uint16:
      return "uint16";
    case Encoding::int32:
      return "int32";
    case Encoding::uint32:
      return "uint32";
    case Encoding::float32:
      return "float32";
    case Encoding::float64:
      break;
  }
  return "float64";
}

/// Address in the notation of STEP 7 and TIA Portal: "DBD 4".
std::string data_block_place(const ModbusValue& value) {
  const std::size_t words = registers_of(value.encoding);
  const char* width = words == 1 ? "DBW " : words == 2 ? "DBD " : "DBB ";
  return width + std::to_string(2 * value.address);
}

std::string data_block_type(Encoding encoding) {
  switch (encoding) {
    case Encoding::int16:
      return "INT";
    case Encoding::uint16:
      return "WORD";
    case Encoding::int32:
      return "DINT";
    case Encoding::uint32:
      return "DWORD";
    case Encoding::float32:
      return "REAL";
    case Encoding::float64:
      break;
  }
  return "LREAL";
}

std::string place_name(const ModbusValue& value) {
  if (value.table == ModbusTable::data_block) return data_block_place(value);
  const auto words = words_of(value.table, value.encoding);
  std::string text = table_name(value.table) + " " + std::to_string(value.address);
  if (words > 1) text += ".." + std::to_string(value.address + words - 1);
  return text;
}

std::string type_name(const ModbusValue& value) {
  if (value.table == ModbusTable::data_block) return data_block_type(value.encoding);
  if (is_bit_table(value.table)) return "bit";
  const std::string type = encoding_name(value.encoding);
  return registers_of(value.encoding) == 1 ? type : type + " " + order_name(value.word_order);
}

ModbusValue without_sign(ModbusValue value) noexcept {
  if (value.encoding == Encoding::int16) value.encoding = Encoding::uint16;
  if (value.encoding == Encoding::int32) value.encoding = Encoding::uint32;
  return value;
}

TravelValueText travel_value_text(const TravelShape& travel, const std::string& unit,
                                  std::size_t index) {
  if (!travel.p0_mm) return {"offset at " + number_text(travel.nodes_mm[index]) + " mm", unit};
  const std::string at = number_text(*travel.p0_mm) + " mm";
  if (index == 0) return {"K0, offset at " + at, unit};
  return index == 1 ? TravelValueText{"slope", unit + "/m"} : TravelValueText{"P0", "mm"};
}

std::string line_name(const ModbusLine& line) {
  if (const auto* rtu = std::get_if<ModbusRtu>(&line.link)) {
    return rtu->device + ", " + std::to_string(rtu->baud) + " baud, " +
           std::to_string(rtu->data_bits) + rtu->parity + std::to_string(rtu->stop_bits);
  }
  const auto& tcp = std::get<ModbusTcp>(line.link);
  std::string text = tcp.host + ":" + std::to_string(tcp.port);
  if (const auto& s7 = tcp.s7)
    text += ", rack " + std::to_string(s7->rack) + ", slot " + std::to_string(s7->slot) + ", DB" +
            std::to_string(s7->db);
  return text;
}

}  // namespace thermocomp::cli
