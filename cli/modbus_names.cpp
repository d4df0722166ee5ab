#include "cli/modbus_names.hpp"

namespace thermocomp::cli {

std::string table_name(ModbusTable table) {
  switch (table) {
    case ModbusTable::coil:
      return "coil";
    case ModbusTable::discrete_input:
      return "discrete_input";
    case ModbusTable::holding:
      return "holding";
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

}  // namespace thermocomp::cli
