#include <filesystem>

#include <catch2/catch.hpp>

#include "config/buses/presets.hpp"
#include "config/daemon/daemon_config.hpp"
#include "config/sections/modbus_values.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::sections;

TEST_CASE("a table over another gives its own keys first and names the file of each problem") {
  const TomlDocument own = TomlDocument::from_text("a = 1\n", "own.toml");
  const TomlDocument base = TomlDocument::from_text("a = 2\n\nb = 99\n[t]\nc = 3\n", "base.toml");
  const TomlTable table = own.root().over(base.root());
  CHECK(table.integer("a", 0, 9) == 1);
  CHECK(table.table("t").integer("c", 0, 9) == 3);
  CHECK(table.integer("b", 0, 9, 5) == 5);
  static_cast<void>(table.integer("missing", 0, 9));
  REQUIRE(base.all_problems().size() == 1);
  CHECK(to_string(base.all_problems()[0]) ==
        "base.toml:3: b = 99: must be a whole number in [0, 9]");
  REQUIRE(own.all_problems().size() == 1);
  CHECK(own.all_problems()[0].key == "missing");
}

TEST_CASE("a key of the middle one of three tables hides the lowest one's") {
  const TomlDocument top = TomlDocument::from_text("", "top.toml");
  const TomlDocument middle = TomlDocument::from_text("a = 2\n", "middle.toml");
  const TomlDocument low = TomlDocument::from_text("a = 3\nb = 4\n", "low.toml");
  const TomlTable table = top.root().over(middle.root()).over(low.root());
  CHECK(table.integer("a", 0, 9) == 2);
  CHECK(table.integer("b", 0, 9) == 4);
  CHECK(low.all_problems().empty());  // a is known, although its value was not used
}

TEST_CASE("every installed preset has every channel for each of its types") {
  const std::filesystem::path folder =
      std::filesystem::path(THERMOCOMP_SOURCE) / "config" / "devices";
  Presets presets({folder});
  std::size_t channels = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().stem().string();
    const TomlDocument device_file =
        TomlDocument::from_text("preset = \"" + name + "\"\nscale = 0.5\n", "device.toml");
    const Preset* preset = presets.of_device(device_file.root());
    REQUIRE(preset != nullptr);
    if (preset->protocol != "modbus") continue;
    std::vector<std::string> types{""};
    if (!preset->thermocouples.empty()) types.clear();
    for (const auto& [type, table] : preset->thermocouples) types.push_back(type);
    const TomlTable device = Presets::over_preset(device_file.root(), *preset, "modbus");
    for (const std::string& type : types) {
      for (const auto& [number, table] : preset->channels) {
        std::string text = "channel = " + std::to_string(number) + "\n";
        if (!type.empty()) text += "thermocouple = \"" + type + "\"\n";
        const TomlDocument sensor = TomlDocument::from_text(text, "sensor.toml");
        const TomlTable over = Presets::over_channel(sensor.root(), device, *preset);
        const ModbusChannel channel = read_modbus_channel(over, device);
        INFO(name << " channel " << number);
        CHECK(sensor.all_problems().empty());
        CHECK(channel.scale == (type.empty() ? 0.5 : channel.scale));
        ++channels;
      }
    }
  }
  CHECK(channels > 80);
  for (const Problem& problem : presets.problems()) {
    INFO(to_string(problem));
    CHECK(problem.rule == "unknown key");  // of the other protocols
  }
}

TEST_CASE("base_address moves the registers of a device, not its bits, within the address range") {
  const TomlDocument device = TomlDocument::from_text(
      "table = \"input\"\nencoding = \"int16\"\nbase_address = 100\n", "device.toml");
  const TomlDocument sensor = TomlDocument::from_text(
      "address = 2\nstatus = { table = \"discrete_input\", address = 7 }\n", "sensor.toml");
  const ModbusChannel channel = read_modbus_channel(sensor.root(), device.root());
  CHECK(channel.address == 102);
  CHECK(channel.status->address == 7);
  const TomlDocument far = TomlDocument::from_text("address = 65500\n", "far.toml");
  static_cast<void>(read_modbus_channel(far.root(), device.root()));
  CHECK(far.all_problems().size() == 1);
}

TEST_CASE("a code of a signed number may be given as its bit pattern") {
  const TomlDocument device = TomlDocument::from_text(
      "table = \"input\"\nencoding = \"int16\"\nopen_circuit_codes = [0x8000, 0x7FFF, 0xFFFF]\n"
      "error_codes = [-1]\n",
      "device.toml");
  const TomlDocument sensor = TomlDocument::from_text("address = 2\n", "sensor.toml");
  const ModbusChannel channel = read_modbus_channel(sensor.root(), device.root());
  REQUIRE(channel.sentinels.size() == 3);
  CHECK(channel.sentinels[0].code == -32768);
  CHECK(channel.sentinels[1].code == 32767);
  CHECK(channel.sentinels[2].code == -1);
  REQUIRE(device.all_problems().size() == 1);  // 0xFFFF and -1 are equal
  CHECK(device.all_problems()[0].key == "error_codes");
}

TEST_CASE("without folders presets are not searched for, and missing ones are not a problem") {
  Presets presets({});
  const TomlDocument device = TomlDocument::from_text("preset = \"wago_750_458\"\n", "d.toml");
  CHECK(presets.of_device(device.root()) == nullptr);
  CHECK(device.all_problems().empty());
}

TEST_CASE("a configuration in a history loads without its presets") {
  const std::string text = R"(format = 1
[model]
file = "m.toml"
[[bus]]
name = "net"
kind = "modbus_tcp"
host = "h"
[[device]]
name = "d"
bus = "net"
preset = "wago_750_458"
unit = 1
[[sensor]]
name = "s"
device = "d"
channel = 1
[[block]]
name = "b"
input = "t_degC"
sensors = ["s"]
[controller]
name = "n"
kind = "dry_run"
[[axis]]
name = "z"
output = "z_um"
offset_um_max = 60.0
rate_um_per_s_max = 0.5
)";
  const std::string model = R"(format = 1
inputs = ["t_degC"]
outputs = ["z_um"]
reference = [20.0]
matrix_um_per_K = [[1.0]]
)";
  const DaemonConfig config = parse_daemon_config(text, "c.toml", model, "m.toml");
  CHECK(config.buses.empty());
  CHECK(config.estimator.sensors.size() == 1);
}
