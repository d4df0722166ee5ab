// Tests of the table of registers and frame bits.
#include "cli/check/register_table.hpp"

#include <filesystem>

#include <catch2/catch.hpp>

namespace {

using Catch::Matchers::Contains;
using thermocomp::DaemonConfig;
using thermocomp::load_daemon_config;
using thermocomp::cli::register_table;

DaemonConfig example(const char* name) {
  return load_daemon_config(std::filesystem::path(THERMOCOMP_EXAMPLES) / name);
}

}  // namespace

TEST_CASE("the table names every register, its unit and who writes it", "[cli][registers]") {
  const std::string text = register_table(example("small_machine.toml"));
  CHECK_THAT(text, Contains("controller cnc: modbus_tcp 192.168.10.30:502, unit 1, every 0.1 s"));
  const auto read = text.find("Written by the controller");
  REQUIRE(read != std::string::npos);
  const std::string written = text.substr(0, read);
  const std::string shown = text.substr(read);
  for (const char* row :
       {"holding 0..1  int32 ABCD  offset of axis x", "holding 4..5  int32 ABCD  offset of axis z",
        "holding 10    uint16", "bit 0: x, bit 1: y, bit 2: z; 1: take the offset",
        "holding 11    uint16", "um, count x 0.01"}) {
    INFO(row);
    CHECK_THAT(written, Contains(row));
  }
  for (const char* row : {"input 4..5        int32 ABCD  applied offset of axis z",
                          "mm, count x 0.001", "input 26          uint16      spindle_rpm",
                          "discrete_input 1  bit         compensation"}) {
    INFO(row);
    CHECK_THAT(shown, Contains(row));
  }
  CHECK_THAT(text, Contains("axis z: offset within +-60 um, changing by at most 0.5 um/s"));
  CHECK_THAT(text, !Contains("Missing"));
  CHECK_THAT(text, !Contains("DRY RUN"));
}

TEST_CASE("the table says which output is a diameter", "[cli][registers]") {
  DaemonConfig config = example("small_machine.toml");
  config.model.diameters = {{config.estimator.axes.front().output, "x", -1.0}};
  CHECK_THAT(
      register_table(config),
      Contains("axis x corrects " + half_of(config.model.diameters.front()) + ", a diameter"));
  CHECK_THAT(half_of(config.model.diameters.front()), Contains("half"));
}

TEST_CASE("the table of CAN goes by frames and bits", "[cli][registers]") {
  DaemonConfig config = example("can.toml");
  const std::string text = register_table(config);
  CHECK_THAT(text, Contains("CAN can0, every 0.1 s"));
  const auto read = text.find("Sent by the controller, each frame at least every 2 s");
  REQUIRE(read != std::string::npos);
  const std::string sent = text.substr(0, read);
  CHECK_THAT(sent, Contains("frame 0x200 (11 bits)"));
  CHECK_THAT(sent, Contains("0, 16 bits            signed, little endian    offset of axis z"));
  CHECK_THAT(sent, Contains("56, 8 bits            unsigned, little endian  heartbeat"));
  CHECK_THAT(text.substr(read), Contains("frame 0x281 (11 bits)"));
  CHECK_THAT(text.substr(read), Contains("signed, big endian       applied offset of axis z"));
  CHECK_THAT(text.substr(read),
             Contains("16, 1 bit             unsigned, little endian  cutting_on"));
  config.dry_run = true;
  CHECK_THAT(register_table(config), Contains("DRY RUN: the daemon reads"));
}

TEST_CASE("missing optional signals are listed", "[cli][registers]") {
  DaemonConfig config = example("can.toml");
  auto& controller = std::get<thermocomp::CanControllerConfig>(config.controller);
  controller.valid_bits.reset();
  controller.heartbeat.reset();
  controller.axes.at(0).applied.reset();
  const std::string text = register_table(config);
  CHECK_THAT(text, Contains("no valid_bits"));
  CHECK_THAT(text, Contains("no heartbeat"));
  CHECK_THAT(text, Contains("no applied"));
}

TEST_CASE("a set is shown register by register, and how it is interpolated", "[cli][registers]") {
  const std::string text = register_table(example("travel.toml"));
  for (const char* part :
       {"begin: number of the set of axis x", "K0, offset at 0 mm of axis x", "um/m, count x 0.001",
        "P0 of axis x", "offset at 150 mm of axis z", "applied offset at 600 mm of axis z",
        "bit 0: x, bit 1: z", "offset = K0 + slope (x_mm - 0 mm)", "everywhere on the travel"})
    CHECK_THAT(text, Contains(part));
}

TEST_CASE("a set in frames is shown frame by frame, with its number in each", "[cli][registers]") {
  const std::string text = register_table(example("travel_can.toml"));
  const auto read = text.find("Sent by the controller, each frame");
  REQUIRE(read != std::string::npos);
  const auto frame = [](const std::string& part, const char* id) {
    const auto begin = part.find(std::string("frame ") + id);
    REQUIRE(begin != std::string::npos);
    return part.substr(begin, part.find(" frame ", begin + 1) - begin);
  };
  const std::string sent = text.substr(0, read);
  const std::string shown = text.substr(read);
  for (const char* row :
       {"0, 24 bits", "K0, offset at 0 mm of axis x", "um/m, count x 0.001",
        "48, 16 bits           unsigned, little endian  number of the set of axis x"})
    CHECK_THAT(frame(sent, "0x210"), Contains(row));
  CHECK_THAT(frame(sent, "0x211"), Contains("offset at 300 mm of axis z"));
  CHECK_THAT(frame(sent, "0x211"), Contains("number of the set of axis z"));
  CHECK_THAT(frame(sent, "0x212"), Contains("offset at 600 mm of axis z"));
  CHECK_THAT(frame(sent, "0x212"), Contains("number of the set of axis z"));
  CHECK_THAT(frame(sent, "0x200"), Contains("bit 0: x, bit 1: z"));
  CHECK_THAT(frame(shown, "0x292"), Contains("applied offset at 600 mm of axis z"));
  CHECK_THAT(frame(shown, "0x292"), Contains("applied number of the set of axis z"));
  for (const char* part :
       {"its newest frames carry the same number, none older than 1 s",
        "offset = K0 + slope (x_mm - 0 mm)", "everywhere on the travel within +-60 um"})
    CHECK_THAT(text, Contains(part));
  CHECK_THAT(text, !Contains("Missing"));
}

TEST_CASE("a piezo's registers are in volts; without a controller the table is empty",
          "[cli][registers]") {
  CHECK_THAT(register_table(example("piezo.toml")), Contains("voltage of axis"));
  CHECK_THAT(register_table(example("modbus_rtu.toml")),
             Contains("no controller and no registers"));
}

TEST_CASE("a data block is shown in a PLC programmer's notation", "[cli][registers]") {
  const std::string text = register_table(example("s7.toml"));
  for (const char* part :
       {"s7 192.168.10.30:102, rack 0, slot 1, DB100, every 0.1 s", "optimized block access off",
        "DBD 0    DINT  offset of axis z", "DBW 6    WORD  heartbeat",
        "DBD 8    DINT  applied offset of axis z", "DBW 12   INT   spindle_rpm"})
    CHECK_THAT(text, Contains(part));
  for (const char* part : {"function", "unit 1", "also read"}) CHECK_THAT(text, !Contains(part));
}
