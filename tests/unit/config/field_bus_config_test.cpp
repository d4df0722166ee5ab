// CANopen and J1939 buses of a configuration: refused content.
#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

const std::string twice_given = "is already the COB-ID of a TPDO of the device cantrans";

/// Edits that are refused without the data sheet.
void check_all(const std::string& file, const std::vector<Broken>& table) {
  const std::string model = example("column_model.toml");
  for (const Broken& broken : table) {
    check_refused(broken, example(file), "machine.toml", [&](const std::string& text) {
      return parse_daemon_config(text, "machine.toml", model, "model.toml");
    });
  }
}

/// The problems after one edit of the CANopen example or a file next to it.
std::string error_after(const std::string& file, const std::string& from, const std::string& to) {
  const ExampleFolder folder({"canopen.toml", "two_channel_module.eds", "column_model.toml"});
  folder.edit(file, from, to);
  return folder.problems_text();
}
std::string error_after(const std::string& from, const std::string& to) {
  return error_after("canopen.toml", from, to);
}

}  // namespace

TEST_CASE("two senders of one number or COB-ID are refused", "[canopen][config]") {
  const std::string spindle = "index = 0x7130\nsub = 2\ntype";
  check_all("canopen.toml",
            {{"a number twice", "node = 6", "node = 0x5", "", "device[ai_module].node",
              "is already that of the device cantrans"},
             {"our own number", "node = 7", "node = 0x7F", "", "device[spindle_module].node",
              "is our own (own_node of the bus)"},
             {"a sensor's COB-ID", spindle, "cob_id = 0x185\nstart_bit = 0\ntype", "",
              "sensor[spindle].cob_id", twice_given},
             {"a mapping's COB-ID", "start_bit = 16", "start_bit = 16\ncob_id = 0x1A7", "cob_id",
              "sensor[column_back].cob_id",
              "is already the COB-ID of a TPDO of the device spindle_module"},
             {"a COB-ID in two mappings of two devices", "read_mappings = [1]",
              "read_mappings = [1]\nmapping = [{cob_id = 0x1A7, object = [{index = 0x2000, "
              "length_bits = 8}]}]",
              "[[device.mapping]]", "device[spindle_module].mapping",
              "is already the COB-ID of a TPDO of the device ai_module"},
             {"a COB-ID in two mappings of one device", "[[device.mapping]]",
              "[[device.mapping]]\ncob_id = 0x1A7\nobject = [{index = 0x2000, length_bits = "
              "8}]\n[[device.mapping]]",
              "cob_id = 0x1A7   ", "device[spindle_module].mapping[2].cob_id",
              "is already the COB-ID of a TPDO of this device"}});
}

TEST_CASE("a CANopen bus and its nodes are refused by key and rule", "[canopen][config]") {
  check_all(
      "canopen.toml",
      {{"no number of a node", "node = 7", "node = 128", "", "device[spindle_module].node",
        "[1, 127]"},
       {"values that hold while nothing is watched", "node = 7", "node = 7\npdo_on_change = true",
        "pdo_on_change = true", "device[spindle_module].pdo_on_change", "needs heartbeat_s"},
       {"heartbeat of nobody", "own_node = 127   ", "# nobody", "heartbeat_s = 1.0",
        "bus[module_bus].heartbeat_s", "needs own_node"},
       {"a time-out within the period", "heartbeat_timeout_s = 1.5", "heartbeat_timeout_s = 0.5",
        "", "device[cantrans].heartbeat_timeout_s", "must be more than heartbeat_s"},
       {"unknown form of emergencies", "node = 7", "node = 7\nemergency = \"jumo\"", "\"jumo\"",
        "device[spindle_module].emergency", "\"jumo_cantrans\""},
       {"misspelled key", "sdo_timeout_s", "sdo_timout_s", "", "bus[module_bus].sdo_timout_s",
        "did you mean \"sdo_timeout_s\"?"},
       {"a TPDO asked for twice", "read_mappings = [1]", "read_mappings = [1, 1]", "",
        "device[ai_module].read_mappings", "is listed twice"},
       {"a setting beyond its type", "type = \"uint16\"\nvalue = 1",
        "type = \"uint16\"\nvalue = 65536", "value = 65536", "device[ai_module].write[2].value",
        "[0, 65535]"},
       {"a setting of 8 bytes", "type = \"uint16\"", "type = \"uint64\"", "",
        "device[ai_module].write[2].type", "at most 32 bits"},
       {"a setting without a type", "type = \"uint16\"", "#", "[[device.write]]\nindex",
        "device[ai_module].write[2].type", "must be given"},
       {"a mapping of more than 8 bytes", "sub = 2, length_bits = 16", "sub = 2, length_bits = 64",
        "object = [  ", "device[spindle_module].mapping[1].object", "take 88 bits of 64"},
       {"a mapping without a COB-ID", "cob_id = 0x1A7", "#", "[[device.mapping]]",
        "device[spindle_module].mapping[1].pdo", "must be given, or cob_id"},
       {"a COB-ID of heartbeats", "cob_id = 0x1A7", "cob_id = 0x707", "",
        "device[spindle_module].mapping[1].cob_id", "is kept for other messages"}});
}

TEST_CASE("a CANopen sensor is refused by key and rule", "[canopen][config]") {
  const std::string spindle = "sub = 2\ntype = \"int16\"";
  check_all("canopen.toml",
            {{"behind the 8th byte", "start_bit = 16", "start_bit = 49", "",
              "sensor[column_back].start_bit", "must end within 8 bytes"},
             {"nothing says where", "start_bit = 16", "#", "[[sensor]]\nname = \"column_back\"",
              "sensor[column_back].start_bit", "must be given, or an object"},
             {"two places", spindle, spindle + "\nstart_bit = 8", "start_bit = 8",
              "sensor[spindle].start_bit", "cannot be combined with an object"},
             {"bits cannot be asked for", "start_bit = 16", "start_bit = 16\npoll_s = 1.0",
              "poll_s = 1.0\nemergency", "sensor[column_back].poll_s", "needs an object"},
             {"a name beside an address", "object = \"AI input PV 1\"",
              "index = 0x7130\nobject = \"AI input PV 1\"", "index = 0x7130\nobject",
              "sensor[table].index", "cannot be combined with object"},
             {"unknown type", spindle, "sub = 2\ntype = \"int15\"", "type = \"int15\"",
              "sensor[spindle].type", "must be one of"},
             {"no type", spindle, "sub = 2", "[[sensor]]\nname = \"spindle\"",
              "sensor[spindle].type", "must be given"},
             {"channels that messages do not name", spindle, spindle + "\nemergency_channel = 2",
              "emergency_channel = 2\nscale", "sensor[spindle].emergency_channel",
              "messages name channels"},
             {"a status that is not asked for", "index = 0x6150", "length_bits = 8", "status = {",
              "sensor[motor].status.index", "must be given"},
             {"a status of bits beside an object", "index = 0x6150", "start_bit = 0, index = 1",
              "start_bit = 0, index", "sensor[motor].status.start_bit", ""},
             {"a code that the mask hides", "mask = 0x07", "mask = 0x01", "mask = 0x01",
              "sensor[motor].status.mask", "hides bits of the code 3"},
             {"a status behind the 8th byte", "start_bit = 16",
              "start_bit = 16\nstatus = { start_bit = 60, length_bits = 8 }", "status = {",
              "sensor[column_back].status.start_bit", "does not fit"},
             {"a status beside a mapped object", spindle,
              spindle + "\nstatus = { index = 0x6150, sub = 2 }",
              "status = { index = 0x6150, sub = 2", "sensor[spindle].status", "with poll_s"},
             {"a code that cannot come", "[0x7FFF]", "[0x18000]", "",
              "device[cantrans].over_range_codes", ""}});
}

TEST_CASE("names must be in the node's data sheet", "[canopen][config]") {
  CHECK(error_after("heartbeat_s = 1.0 ", "heartbeat_s = 1.0 ").empty());
  CHECK(error_after("\"AI input PV 1\"", "\"AI input PW 1\"") ==
        "canopen.toml:76: sensor[table].object = \"AI input PW 1\": is not an object of the data "
        "sheet; "
        "did you mean AI input PV 1?\n");
  CHECK_THAT(error_after("\"AI input PV 1\"", "\"Number of entries\""),
             Catch::Contains("sensor[table].object = \"Number of entries\": is ambiguous: AI "
                             "sensor type/Number of entries or AI input PV/Number of entries"));
  CHECK(error_after("two_channel_module.eds\"", "one_channel_module.eds\"") ==
        "canopen.toml:60: device[ai_module].eds = \"one_channel_module.eds\": no such file\n");
  CHECK_THAT(error_after("eds = \"two_channel_module.eds\"", "#"),
             Catch::Contains("sensor[table].object = \"AI input PV 1\": needs the data sheet"));
  CHECK_THAT(
      error_after("read_mappings = [1] ", "#"),
      Catch::Contains("sensor[table].object = \"AI input PV 1\": needs mappings of its device"));
  CHECK(error_after("two_channel_module.eds", "DataType=0x0003", "DataType=0x0009") ==
        "canopen.toml:76: sensor[table].object = \"AI input PV 1\": is not a number in the data "
        "sheet; give its type\n");
  CHECK(error_after("two_channel_module.eds", "[7130sub1]\n", "[7130sub1]\nAccess\n") ==
        "two_channel_module.eds:75: Access: must be a section, an entry KEY=VALUE or a comment; "
        "type in the configuration replaces it\n");
}

TEST_CASE("a flaw of a data sheet is a warning if no sensor uses it, or if type replaces it",
          "[canopen][config]") {
  const ExampleFolder folder({"canopen.toml", "two_channel_module.eds", "column_model.toml"});
  folder.edit("two_channel_module.eds", "AccessType=ro\n", "AccessType\n");
  const std::vector<std::string> remarks = folder.load().remarks;
  REQUIRE(remarks.size() == 1);
  CHECK_THAT(remarks[0], Catch::EndsWith(".eds:22: AccessType: must be a section, an entry "
                                         "KEY=VALUE or a comment"));
  folder.edit("two_channel_module.eds", "[7130sub1]\nParameterName=AI input PV 1\nDataType=0x0003",
              "[7130sub1]\nParameterName=AI input PV 1\nDataType=int16");
  CHECK_THAT(folder.problems_text(), Catch::Contains("DataType = int16: must be a whole number"));
  folder.edit("canopen.toml", "object = \"AI input PV 1\"",
              "object = \"AI input PV 1\"\ntype = \"int16\"");
  CHECK(folder.problems_text().empty());
}

TEST_CASE("a J1939 bus and its devices are refused by key and rule", "[j1939][config]") {
  check_all(
      "j1939.toml",
      {{"an address without a NAME", "own_name = ", "# ", "[[bus]]", "bus[module_bus].own_name",
        "must be given with own_address"},
       {"a NAME that is none", "\"0x00FF00FF00012345\"", "\"0x00FF00FF0001234G\"", "",
        "bus[module_bus].own_name", "must be a NAME"},
       {"a NAME that is too long", "\"0x8000FF0012345678\"", "\"0x8000FF00123456789\"", "",
        "device[back].j1939_name", "must be a NAME"},
       {"no address", "address = 0x80", "address = 254", "", "device[front].address", "[0, 253]"},
       {"our own address", "address = 0x80", "address = 0xF9 # ours", "", "device[front].address",
        "is our own (own_address of the bus)"},
       {"an address twice", "j1939_name = ", "address = 0x80 #", "", "device[back].address",
        "is already that of the device front"},
       {"a NAME twice", "address = 0x80", "j1939_name = \"0x8000FF0012345678\" #",
        "j1939_name = \"0x8000FF0012345678\"  ", "device[back].j1939_name",
        "is already that of the device front"},
       {"neither", "address = 0x80", "#", "[[device]]\nname = \"front\"", "device[front].address",
        "must be given, or j1939_name"}});
}

TEST_CASE("a J1939 sensor is refused by key and rule", "[j1939][config]") {
  check_all("j1939.toml", {{"no group", "pgn = 65262", "#", "[[sensor]]\nname = \"spindle\"",
                            "sensor[spindle].pgn", "must be given"},
                           {"beyond all groups", "pgn = 65262", "pgn = 0x40000", "",
                            "sensor[spindle].pgn", "[0, 262143]"},
                           {"a group of one node with a lowest byte", "pgn = 65262", "pgn = 0xEF01",
                            "", "sensor[spindle].pgn", "has 0 in its lowest byte"},
                           {"bytes are counted from 1", "start_byte = 1 ", "start_byte = 0 ", "",
                            "sensor[column].start_byte", "[1, 1785]"},
                           {"bits are counted from 1", "start_bit = 1 ", "start_bit = 9 ", "",
                            "sensor[column].start_bit", "[1, 8]"},
                           {"behind the last byte", "start_byte = 1 ", "start_byte = 1785 ", "",
                            "sensor[column].start_byte", "must end within 1785 bytes"},
                           {"too long", "length_bits = 16\nscale", "length_bits = 33\nscale", "",
                            "sensor[spindle].length_bits", "[2, 32]"},
                           {"unknown meaning", "\"open_circuit\"", "\"broken\"", "",
                            "device[front].error_means", "must be one of"},
                           {"a code that cannot come", "[0xFE01]", "[0x1FE01]", "",
                            "device[front].short_circuit_codes", ""}});
}
