#include "drivers/sensors/make_source.hpp"

namespace thermocomp {

std::unique_ptr<SensorSource> make_source(const BusConfig& bus) {
  return std::visit([](const auto& each) { return make_bus_source(each); }, bus);
}

}  // namespace thermocomp
