// Configurations whose CAN signals are named: what is wrong with the names, or with the file.
#include <string>

#include "config/daemon/daemon_config.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

class Folder : public ExampleFolder {
 public:
  Folder() : ExampleFolder({"can_dbc.toml", "can_dbc.dbc", "column_model.toml"}) {}
};

/// What is told after one edit of the configuration.
std::string told_after(const std::string& from, const std::string& to) {
  const Folder folder;
  folder.edit("can_dbc.toml", from, to);
  return folder.told();
}

}  // namespace

TEST_CASE("names that are not in the DBC file are refused with what may be meant", "[dbc]") {
  CHECK_THAT(told_after("signal = \"Column\"", "signal = \"Colum\""),
             Catch::Contains("sensor[column].signal = \"Colum\": must be a signal of the message "
                             "NODE_TEMPERATURES; did you mean \"Column\"?"));
  CHECK_THAT(told_after("message = \"NODE_PAGES\"", "message = \"NODE_PAGE\""),
             Catch::Contains("sensor[spindle].message = \"NODE_PAGE\": must be a message of the "
                             "bus' DBC file; did you mean \"NODE_PAGES\"?"));
  CHECK_THAT(told_after("counter = \"Alive\"", "counter = \"Dead\""),
             Catch::Contains("device[node].counter = \"Dead\": must be a signal of the message"));
  CHECK_THAT(told_after("signal = \"Spindle\"", "signal = \"Spindle\"\ncounter = \"Oil\""),
             Catch::Contains("sensor[spindle].counter = \"Oil\": must be in every frame"));
}

TEST_CASE("what the DBC file says is not said again", "[dbc]") {
  CHECK_THAT(told_after("signal = \"Column\"", "signal = \"Column\"\nscale = 0.1"),
             Catch::Contains("sensor[column].scale = 0.1: is what the DBC file says"));
  CHECK_THAT(told_after("open_circuit_codes", "id = 5\nopen_circuit_codes"),
             Catch::Contains("device[node].id = 5: is what the DBC file says"));
}

TEST_CASE("signals are named only where there is a DBC file and a message", "[dbc]") {
  CHECK_THAT(told_after("dbc = \"can_dbc.dbc\"", ""),
             Catch::Contains("sensor[column].signal = \"Column\": needs a bus that names a DBC"));
  CHECK_THAT(told_after("message = \"NODE_TEMPERATURES\"", ""),
             Catch::Contains("sensor[column].message = (missing): must be given"));
  CHECK_THAT(told_after("dbc = \"can_dbc.dbc\"", "dbc = \"other.dbc\""),
             Catch::Contains("bus[machine_bus].dbc = \"other.dbc\": no such file"));
}

TEST_CASE("a code that the named signal cannot show is refused", "[dbc]") {
  CHECK_THAT(told_after("[0x7FFF]", "[0x10000]"), Catch::Contains("open_circuit_codes"));
}

TEST_CASE("a broken DBC file is told by its own name and line, once", "[dbc]") {
  const Folder folder;
  folder.edit("can_dbc.dbc", "0|16@1-", "0|77@1-");
  CHECK(folder.told() == "can_dbc.dbc:10: Column = 77: must have 1 to 64 bits\n");
}

TEST_CASE("a named signal in no unit of temperature is refused, one in degF is turned", "[dbc]") {
  Folder folder;
  folder.edit("can_dbc.dbc", "\"degC\"", "\"bar\"");
  CHECK_THAT(folder.told(), Catch::Contains("the signal's unit is that of no temperature"));
  folder.edit("can_dbc.dbc", "(0.1,0) [-100|400] \"bar\"",
              "(1,32) [0|0] \"\xB0"
              "F\"");
  const CanSignal signal =
      std::get<CanBusConfig>(folder.load().buses.at(0)).devices.at(0).channels.at(0).signal;
  CHECK(100.0 * signal.scale + signal.offset == Approx(100.0 * 5 / 9));
}

TEST_CASE("a message of more bytes than its format has is no frame", "[dbc]") {
  const Folder folder;
  folder.edit("can_dbc.dbc", "BO_ 2566844926 15;", "BO_ 2566844926 1;");
  CHECK_THAT(folder.told(),
             Catch::Contains("sensor[spindle].message = \"NODE_PAGES\": has 16 bytes "
                             "in the DBC file, but is no CAN FD frame"));
}
