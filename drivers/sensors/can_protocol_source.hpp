/// Thermocouple readings by a protocol on one CAN interface: CANopen, J1939.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/can/can_protocol.hpp"
#include "drivers/sensors/can_interface_source.hpp"

namespace thermocomp {

/// Gives a protocol its socket, its clock and its thread. While the interface is missing, down or
/// bus-off the protocol is closed, which makes its readings no_answer; it is opened again for ever.
class CanProtocolSource final : public CanInterfaceSource {
 public:
  /// @param kind  as BusHealth tells it
  /// @throws InvalidValue for an impossible interface or number of identifiers
  CanProtocolSource(std::string name, std::string kind, std::string interface, double reconnect_s,
                    std::unique_ptr<CanProtocol> protocol);
  ~CanProtocolSource() override;

 private:
  void bus_opened(nanoseconds now) override;
  void bus_closed(nanoseconds now) override;
  void work() override;
  void write_readings(std::vector<Reading>& readings) override;
  [[nodiscard]] std::vector<UnitHealth> units(nanoseconds now) override;
  void send();

  std::unique_ptr<CanProtocol> protocol_;
};

}  // namespace thermocomp
