// Configurations with named CAN signals: errors of names and of the DBC file.
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

/// The problems after one edit of the configuration.
std::string database_error_after(const std::string& from, const std::string& to) {
  const Folder folder;
  folder.edit("can_dbc.toml", from, to);
  return folder.problems_text();
}

}  // namespace

TEST_CASE("names that are not in the DBC file are refused with a suggestion", "[dbc]") {
  CHECK_THAT(database_error_after("signal = \"Column\"", "signal = \"Colum\""),
             Catch::Contains("sensor[column].signal = \"Colum\": must be a signal of the message "
                             "NODE_TEMPERATURES; did you mean \"Column\"?"));
  CHECK_THAT(database_error_after("message = \"NODE_PAGES\"", "message = \"NODE_PAGE\""),
             Catch::Contains("sensor[spindle].message = \"NODE_PAGE\": must be a message of the "
                             "bus' DBC file; did you mean \"NODE_PAGES\"?"));
  CHECK_THAT(database_error_after("counter = \"Alive\"", "counter = \"Dead\""),
             Catch::Contains("device[node].counter = \"Dead\": must be a signal of the message"));
  CHECK_THAT(
      database_error_after("signal = \"Spindle\"", "signal = \"Spindle\"\ncounter = \"Oil\""),
      Catch::Contains("sensor[spindle].counter = \"Oil\": must be in every frame"));
}

TEST_CASE("a key overrides the DBC file, and the rest is taken from there", "[dbc]") {
  const auto column = [](const std::string& keys) {
    const Folder folder;
    folder.edit("can_dbc.toml", "signal = \"Column\"", "signal = \"Column\"\n" + keys);
    return std::get<CanBusConfig>(folder.load().buses.at(0)).devices.at(0).channels.at(0).signal;
  };
  const CanSignal as_in_file = column("");
  const auto differs_by = [&](const std::string& keys, auto change) {
    CanSignal expected = as_in_file;
    change(expected);
    INFO(keys);
    CHECK(column(keys) == expected);
  };
  differs_by("id = 0x182", [](CanSignal& s) { s.id = 0x182; });
  differs_by("scale = 0.5", [](CanSignal& s) { s.scale = 0.5; });
  differs_by("offset_degC = -40.0", [](CanSignal& s) { s.offset = -40.0; });
  differs_by("unit = \"K\"", [](CanSignal& s) { s.offset = -273.15; });
  differs_by("signed = false", [](CanSignal& s) { s.is_signed = false; });
  differs_by("start_bit = 8", [](CanSignal& s) { s.start_bit = 8; });
  // The same bytes.
  differs_by("byte_order = \"big_endian\"", [](CanSignal& s) {
    s.byte_order = ByteOrder::big_endian;
    s.start_bit = 7;
  });
  differs_by("byte_order = \"big_endian\"\nstart_bit = 23", [](CanSignal& s) {
    s.byte_order = ByteOrder::big_endian;
    s.start_bit = 23;
  });
  CHECK_THAT(
      database_error_after("signal = \"Column\"", "signal = \"Column\"\nmultiplexor_value = 1"),
      Catch::Contains("sensor[column].multiplexor_value = 1: is given by the DBC file"));
  CHECK_THAT(
      database_error_after("signal = \"Column\"",
                           "signal = \"Column\"\nlength_bits = 12\nbyte_order = \"big_endian\""),
      Catch::Contains("start_bit = (missing): must be given: the value is not in whole"));
  CHECK_THAT(
      database_error_after("signal = \"Spindle\"", "signal = \"Spindle\"\nextended_id = false"),
      Catch::Contains("extended_id = false: is false, but the file's number has more"));
}

TEST_CASE("a flaw of the DBC file counts if a sensor uses it and no key overrides it", "[dbc]") {
  const Folder folder;
  folder.edit("can_dbc.dbc", "Oil m3 : 64|16@1-", "Oil m3 : 127|16@1-");
  folder.edit("can_dbc.dbc", "CM_ SG_ 385", "SIG_VALTYPE_ 77 Gone : 1;\nCM_ SG_ 385");
  const std::vector<std::string> remarks = folder.load().remarks;
  REQUIRE(remarks.size() == 2);
  CHECK_THAT(remarks[0] + remarks[1],
             Catch::Contains("can_dbc.dbc:17: Oil = 127|16: must end within the 16 "
                             "bytes of NODE_PAGES"));
  CHECK_THAT(remarks[0] + remarks[1],
             Catch::Contains("Gone = 77: is the number of no message (BO_) of this file"));

  folder.edit("can_dbc.toml", "signal = \"Spindle\"", "signal = \"Oil\"");
  CHECK(
      folder.problems_text() ==
      "can_dbc.dbc:17: Oil = 127|16: must end within the 16 bytes of NODE_PAGES; start_bit in the "
      "configuration replaces it\n");
  folder.edit("can_dbc.toml", "signal = \"Oil\"", "signal = \"Oil\"\nstart_bit = 64");
  CHECK(folder.problems_text().empty());
}

TEST_CASE("an unknown name is reported with the flaws that may be the cause", "[dbc]") {
  const Folder folder;
  folder.edit("can_dbc.dbc", "BO_ 385 NODE_TEMPERATURES:", "BO_ 385 NODE_TEMPERATURES");
  const std::string problems_text = folder.problems_text();
  CHECK_THAT(problems_text,
             Catch::Contains("device[node].message = \"NODE_TEMPERATURES\": must be a message "
                             "of the bus' DBC file; a flaw of the file may hide it"));
  CHECK_THAT(problems_text, Catch::Contains("can_dbc.dbc:9: 8 NODE: must be ':'"));
}

TEST_CASE("of two messages of one name the identifier selects one", "[dbc]") {
  const Folder folder;
  folder.edit("can_dbc.dbc", "CM_ SG_ 385",
              "BO_ 400 NODE_TEMPERATURES: 8 NODE\n"
              " SG_ Column : 16|16@1- (0.5,0) [0|0] \"degC\" Vector__XXX\n"
              " SG_ Alive : 60|4@1+ (1,0) [0|15] \"\" Vector__XXX\nCM_ SG_ 385");
  CHECK_THAT(folder.problems_text(),
             Catch::Contains("NODE_TEMPERATURES: is the name of two messages; id in "
                             "the configuration replaces it"));
  folder.edit("can_dbc.toml", "signal = \"Column\"", "signal = \"Column\"\nid = 400");
  const CanSignal signal =
      std::get<CanBusConfig>(folder.load().buses.at(0)).devices.at(0).channels.at(0).signal;
  CHECK(signal.id == 400);
  CHECK(signal.scale == 0.5);
}

TEST_CASE("two sensors that read one place cause a warning", "[dbc]") {
  const Folder folder;
  CHECK(folder.load().remarks.empty());
  folder.edit("can_dbc.toml", "message = \"NODE_PAGES\"\nsignal = \"Spindle\"",
              "signal = \"Column\"");
  const std::vector<std::string> remarks = folder.load().remarks;
  REQUIRE(remarks.size() == 1);
  CHECK_THAT(remarks[0],
             Catch::EndsWith(": sensor[spindle]: reads the same value as sensor[column]"));
}

TEST_CASE("overlapping bits and a slow message cause warnings", "[dbc]") {
  const Folder folder;
  folder.edit("can_dbc.toml", "message = \"NODE_PAGES\"\nsignal = \"Spindle\"",
              "signal = \"Column\"\nstart_bit = 8");
  folder.edit("can_dbc.dbc", "CM_ SG_ 385", "BA_ \"GenMsgCycleTime\" BO_ 385 10000;\nCM_ SG_ 385");
  const std::vector<std::string> remarks = folder.load().remarks;
  REQUIRE(remarks.size() == 3);
  CHECK_THAT(remarks[0],
             Catch::EndsWith("gives NODE_TEMPERATURES a cycle of 10 s: its readings are "
                             "stale after 5 s (screening.stale_after_s)"));
  CHECK_THAT(remarks[2], Catch::EndsWith(": sensor[spindle]: shares bits with sensor[column]"));
}

TEST_CASE("named values outside of the DBC file's range are error codes, others are named",
          "[dbc]") {
  const Folder folder;
  folder.edit("can_dbc.dbc", "CM_ SG_ 385",
              "VAL_ 385 Column 32767 \"Open\" 32766 \"SNA\" -32768 \"Short\" 255 \"Init\" ;\n"
              "VAL_ 77 Gone 1 \"on\" ;\nCM_ SG_ 385");
  const DaemonConfig config = folder.load();
  const auto& column = std::get<CanBusConfig>(config.buses.at(0)).devices.at(0).channels.at(0);
  CHECK(column.signal.sentinels == std::vector<Sentinel>{{32767, Fault::open_circuit},
                                                         {32766, Fault::device_error},
                                                         {-32768, Fault::device_error}});
  REQUIRE(config.remarks.size() == 1);
  CHECK_THAT(
      config.remarks[0],
      Catch::EndsWith("the DBC file names values of Column: 255 \"Init\" (25.5 degC); one "
                      "that is a fault is a temperature until it is in error_codes = [255]"));
}

TEST_CASE("named signals require a DBC file and a message", "[dbc]") {
  CHECK_THAT(database_error_after("dbc = \"can_dbc.dbc\"", ""),
             Catch::Contains("sensor[column].signal = \"Column\": needs a bus that names a DBC"));
  CHECK_THAT(database_error_after("message = \"NODE_TEMPERATURES\"", ""),
             Catch::Contains("sensor[column].message = (missing): must be given"));
  CHECK_THAT(database_error_after("dbc = \"can_dbc.dbc\"", "dbc = \"other.dbc\""),
             Catch::Contains("bus[machine_bus].dbc = \"other.dbc\": no such file"));
}

TEST_CASE("a code out of range of the named signal is refused", "[dbc]") {
  CHECK_THAT(database_error_after("[0x7FFF]", "[0x10000]"), Catch::Contains("open_circuit_codes"));
}

TEST_CASE("a broken DBC file is reported once, by its own name and line", "[dbc]") {
  const Folder folder;
  folder.edit("can_dbc.dbc", "0|16@1-", "0|77@1-");
  CHECK(folder.problems_text() ==
        "can_dbc.dbc:10: Column = 77: must have 1 to 64 bits; length_bits in the configuration "
        "replaces it\n");
}

TEST_CASE("a named signal without a temperature unit is refused, one in degF is converted",
          "[dbc]") {
  Folder folder;
  folder.edit("can_dbc.dbc", "\"degC\"", "\"bar\"");
  CHECK_THAT(folder.problems_text(),
             Catch::Contains("sensor[column].signal = bar: the unit of the signal in the DBC file "
                             "is not a temperature unit; give unit = \"degC\", \"K\" or \"degF\""));
  folder.edit("can_dbc.dbc", "(0.1,0) [-100|400] \"bar\"",
              "(1,32) [0|0] \"\xB0"
              "F\"");
  const CanSignal signal =
      std::get<CanBusConfig>(folder.load().buses.at(0)).devices.at(0).channels.at(0).signal;
  CHECK(100.0 * signal.scale + signal.offset == Approx(100.0 * 5 / 9));
}

TEST_CASE("a message of more bytes than its frame format is refused", "[dbc]") {
  const Folder folder;
  folder.edit("can_dbc.dbc", "BO_ 2566844926 15;", "BO_ 2566844926 1;");
  CHECK_THAT(folder.problems_text(),
             Catch::Contains("sensor[spindle].message = \"NODE_PAGES\": has 16 bytes "
                             "in the DBC file, but is not a CAN FD frame"));
}
