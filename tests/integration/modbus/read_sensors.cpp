// Reads sensors through ModbusSource and prints them as JSON, for tests against foreign servers.
//
//   read_sensors BUS.json
//
// BUS.json: {"tcp": {"host": ..., "port": ...}} or {"rtu": {"device": ..., "baud": ...}}, "unit",
// "channels": [{"table", "address", "encoding", "word_order", "scale", "open_circuit_codes"}].
// Prints once every channel has been read (or after 10 s) a list of {"fault", "temp_degC"}.
#include <chrono>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <thread>

#include <nlohmann/json.hpp>

#include "drivers/bus_thread.hpp"
#include "drivers/sensors/modbus_source.hpp"

namespace {

using namespace thermocomp;
using nlohmann::json;

const std::map<std::string, Encoding> encodings{
    {"int16", Encoding::int16},   {"uint16", Encoding::uint16},   {"int32", Encoding::int32},
    {"uint32", Encoding::uint32}, {"float32", Encoding::float32}, {"float64", Encoding::float64}};
const std::map<std::string, WordOrder> orders{{"ABCD", WordOrder::abcd},
                                              {"DCBA", WordOrder::dcba},
                                              {"BADC", WordOrder::badc},
                                              {"CDAB", WordOrder::cdab}};
const std::map<std::string, ModbusTable> tables{{"holding", ModbusTable::holding},
                                                {"input", ModbusTable::input},
                                                {"discrete_input", ModbusTable::discrete_input}};

ModbusChannel channel_of(const json& entry, std::size_t sensor) {
  ModbusChannel channel;
  channel.sensor = sensor;
  channel.table = tables.at(entry.value("table", "input"));
  channel.address = entry.at("address").get<std::uint16_t>();
  channel.encoding = encodings.at(entry.value("encoding", "int16"));
  channel.word_order = orders.at(entry.value("word_order", "ABCD"));
  channel.scale = entry.value("scale", 1.0);
  for (const auto& code : entry.value("open_circuit_codes", json::array())) {
    channel.sentinels.push_back({code.get<std::int64_t>(), Fault::open_circuit});
  }
  if (entry.contains("status_bit")) {
    channel.status = ModbusStatus{ModbusTable::discrete_input,
                                  entry["status_bit"].get<std::uint16_t>(),
                                  0xFFFF,
                                  {{1, Fault::open_circuit}}};
  }
  return channel;
}

ModbusBusConfig bus_of(const json& description) {
  ModbusBusConfig bus;
  bus.name = "bus";
  if (description.contains("tcp")) {
    bus.line.link = ModbusTcp{description["tcp"]["host"], description["tcp"]["port"]};
  } else {
    ModbusRtu rtu;
    rtu.device = description.at("rtu").at("device");
    rtu.baud = description["rtu"].at("baud");
    bus.line.link = rtu;
  }
  bus.line.timeout_ms = 1000.0;
  ModbusDeviceConfig device;
  device.name = "module";
  device.unit = description.at("unit");
  device.period_s = 0.1;
  for (const json& entry : description.at("channels")) {
    device.channels.push_back(channel_of(entry, device.channels.size()));
  }
  bus.devices.push_back(device);
  return bus;
}

bool all_read(const std::vector<Reading>& readings) {
  for (const Reading& reading : readings) {
    if (reading.fault == Fault::never_read || reading.fault == Fault::no_answer) return false;
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: read_sensors BUS.json\n";
    return 2;
  }
  try {
    const ModbusBusConfig bus = bus_of(json::parse(std::ifstream(argv[1])));
    ModbusSource source(bus);
    std::vector<Reading> readings(bus.devices[0].channels.size());
    source.start();
    const auto give_up_at = monotonic_now() + std::chrono::seconds(10);
    do {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      source.newest(readings);
    } while (!all_read(readings) && monotonic_now() < give_up_at);
    source.stop();
    json printed = json::array();
    for (const Reading& reading : readings) {
      printed.push_back({{"fault", to_string(reading.fault)}, {"temp_degC", reading.temp_degC}});
    }
    std::cout << printed.dump() << "\n";
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "read_sensors: " << error.what() << "\n";
    return 1;
  }
}
