#include "config/buses/buses.hpp"
#include "config/sections/common.hpp"
#include "config/sections/modbus_values.hpp"

namespace thermocomp::sections {
namespace {

class ModbusSection final : public BusSection {
 public:
  ModbusSection(const TomlTable& table, const std::string& name, const std::string& kind,
                BusFiles& files)
      : files_(files) {
    bus_.name = name;
    bus_.line = read_modbus_line(table, kind);
    refuse_all(table, {"interface", "dbc"}, "does not apply on a Modbus bus");
    if (const auto* rtu = std::get_if<ModbusRtu>(&bus_.line.link)) {
      if (!rtu->device.empty() && !files.serial_lines.try_emplace(rtu->device, *rtu).second) {
        table.problem("device", "is used by two buses: put the devices of a line on one bus");
      }
    }
  }

  void read_device(const TomlTable& table, const std::string& name) override {
    ModbusDeviceConfig device;
    device.name = name;
    device.unit = read_unit(table, bus_.line);
    device.period_s = table.number("period_s", Range::between(0.01, 3600), device.period_s);
    device.registers_per_request_max =
        table.integer("registers_per_request_max", 1, 125, device.registers_per_request_max);
    device.gap_registers_max = table.integer("gap_registers_max", 0, 124, device.gap_registers_max);
    device.one_register_a_request =
        table.flag("one_register_a_request", device.one_register_a_request);
    device.wide_registers = table.flag("wide_registers", device.wide_registers);
    if (table.has("renewal")) device.renewal = read_modbus_renewal(table.table("renewal"));
    bus_.devices.push_back(std::move(device));
  }

  void read_channel(const ChannelTables& tables, std::size_t device) override {
    ModbusDeviceConfig& on = bus_.devices[device];
    ModbusChannel channel = read_modbus_channel(tables.sensor, tables.device);
    channel.sensor = tables.index;
    check_request(tables.sensor, channel, on);
    if (on.wide_registers && registers_of(channel.encoding) != 2)
      tables.sensor.problem("encoding",
                            "must be int32, uint32 or float32: a register has 32 bits "
                            "(wide_registers)");
    tables.check_period(on.period_s, "period_s of the device " + on.name);
    std::string place = "modbus " + bus_.name;
    for (const int part :
         {on.unit, static_cast<int>(channel.table), int{channel.address}, int{channel.mask}})
      place += ' ' + std::to_string(part);
    files_.note_place(tables, place);
    on.channels.push_back(std::move(channel));
  }

  [[nodiscard]] bool has_devices() const override { return !bus_.devices.empty(); }
  [[nodiscard]] BusConfig take() override { return std::move(bus_); }

 private:
  /// A value must be read in one request, or its halves could be of different times.
  static void check_request(const TomlTable& sensor, const ModbusChannel& channel,
                            const ModbusDeviceConfig& device) {
    const auto count = static_cast<int>(words_of(channel.table, channel.encoding));
    if (count > device.registers_per_request_max) {
      sensor.problem("address", "the value takes " + std::to_string(count) +
                                    " registers, more than registers_per_request_max");
    }
  }

  BusFiles& files_;
  ModbusBusConfig bus_;
};

}  // namespace

std::unique_ptr<BusSection> open_modbus(const TomlTable& bus, const std::string& name,
                                        const std::string& kind, BusFiles& files) {
  return std::make_unique<ModbusSection>(bus, name, kind, files);
}

}  // namespace thermocomp::sections
