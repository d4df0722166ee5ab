/// What people are told about a bus before it is opened.
#pragma once

#include <cstddef>
#include <string>

namespace thermocomp {

struct BusOutline {
  std::string kind;       ///< as the key `kind` and BusHealth tell it
  std::string interface;  ///< "can0"; empty where the bus has none
  std::size_t units{0};   ///< as many as its source's health has
  const char* unit_called{"device"};
};

}  // namespace thermocomp
