// Valid and refused content of DBC files. Comparison with canmatrix: tests/integration/can.
#include "config/bus_files/dbc_file.hpp"

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include <catch2/catch.hpp>

using namespace thermocomp;

namespace {

const std::string head = "VERSION \"\"\nNS_ :\nBS_:\nBU_: A B\n";

/// All flaws, one per line; "" for a valid file.
std::string problems_of(const std::string& body) {
  std::string reported;
  for (const DbcFlaw& flaw : read_dbc_text(head + body, "x.dbc").flaws) {
    reported += to_string(flaw.problem) + "\n";
  }
  return reported;
}

std::string message(const std::string& signals, const std::string& bytes = "8") {
  return "BO_ 385 NODE: " + bytes + " A\n" + signals;
}

/// A message with one signal of this place.
std::string placed(const std::string& place, const std::string& bytes = "8") {
  return message(" SG_ T : " + place + " (1,0) [0|0] \"\" B\n", bytes);
}

}  // namespace

TEST_CASE("a DBC file's messages and signals are read", "[dbc]") {
  const DbcFile file =
      read_dbc_text(head +
                        "BO_ 385 NODE: 8 A\n"
                        " SG_ Column : 7|12@0- (0.1,-4E1) [-50|150] \"degC\"  A,B\n"
                        " SG_ Alive : 56|8@1+(1,0)[0|0]\"\" B\r\n"
                        "BO_ 2566844926 WIDE: 16 A\n"
                        " SG_ Late : 96|32@1- (1,0) [0|0] \"\" B\n"
                        "SIG_VALTYPE_ 2566844926 Late : 1;\n",
                    "x.dbc");
  REQUIRE(file.flaws.empty());
  REQUIRE(file.message_names() == std::vector<std::string>{"NODE", "WIDE"});
  const DbcMessage& node = file.messages[0];
  CHECK(node.id == 0x181);
  CHECK_FALSE(node.extended);
  const DbcSignal& column = *node.find("Column");
  CHECK(column.line == 6);
  CHECK(column.unit == "degC");
  CHECK(column.place.start_bit == 7);
  CHECK(column.place.length_bits == 12);
  CHECK(column.place.byte_order == ByteOrder::big_endian);
  CHECK(column.place.is_signed);
  CHECK(column.place.scale == 0.1);
  CHECK(column.place.offset == -40.0);
  CHECK_FALSE(column.place.fd);
  CHECK(node.find("Alive")->place.byte_order == ByteOrder::little_endian);
  CHECK_FALSE(node.find("Alive")->place.is_signed);
  const DbcMessage& wide = *file.find("WIDE");
  CHECK(wide.id == 0x18FEF1FE);
  CHECK(wide.extended);
  CHECK(wide.find("Late")->place.fd);
  CHECK(wide.find("Late")->place.is_float);
  CHECK(wide.find("Missing") == nullptr);
}

TEST_CASE("multiplexors of a DBC file select by page, nested ones by all of theirs", "[dbc]") {
  const std::string simple =
      " SG_ Page M : 0|4@1+ (1,0) [0|0] \"\" B\n SG_ T m3 : 8|16@1- (1,0) [0|0] \"\" B\n";
  const DbcFile paged = read_dbc_text(head + message(simple), "x.dbc");
  REQUIRE(paged.flaws.empty());
  const std::vector<CanSelector> on_three{{{0, 4, ByteOrder::little_endian}, {{3, 3}}}};
  CHECK(paged.messages[0].find("T")->place.selectors == on_three);
  CHECK(paged.messages[0].find("Page")->place.selectors.empty());

  const std::string nested =
      " SG_ Outer M : 0|4@1+ (1,0) [0|0] \"\" B\n SG_ Inner m1M : 4|4@1+ (1,0) [0|0] \"\" B\n"
      " SG_ T m0 : 8|16@1- (1,0) [0|0] \"\" B\n";
  CHECK(problems_of(message(nested)).find("x.dbc:7: Inner = m1: needs a line SG_MUL_VAL_") == 0);
  const DbcFile deep =
      read_dbc_text(head + message(nested) +
                        "SG_MUL_VAL_ 385 Inner Outer 1-1;\nSG_MUL_VAL_ 385 T Inner 0-2, 5-5;\n",
                    "x.dbc");
  REQUIRE(deep.flaws.empty());
  const std::vector<CanSelector> both{{{4, 4, ByteOrder::little_endian}, {{0, 2}, {5, 5}}},
                                      {{0, 4, ByteOrder::little_endian}, {{1, 1}}}};
  CHECK(deep.messages[0].find("T")->place.selectors == both);
}

TEST_CASE("a DBC file may contain unused statements", "[dbc]") {
  CHECK(problems_of("VAL_TABLE_ States 1 \"a;b\" 0 \"c\" ;\n" + placed("0|8@1+") +
                    "BO_TX_BU_ 385 : A,B;\nCM_ SG_ 385 T \"two\nlines \\\"quoted\\\"; so\";\n"
                    "BA_DEF_ SG_ \"Start\" INT 0 10;\nBA_DEF_DEF_ \"Start\" 0;\n"
                    "BA_ \"Start\" SG_ 385 T 5;\nVAL_ 385 T 255 \"open\" ;\n"
                    "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n"
                    " SG_ Old : 0|8@1+ (1,0) [0|0] \"\" Vector__XXX\n")
            .empty());
}

TEST_CASE("invalid content of a DBC file is refused by line and rule", "[dbc]") {
  const auto reports = [](const std::string& body, const std::string& start) {
    INFO(problems_of(body));
    return problems_of(body).find(start) == 0;
  };
  CHECK(reports(placed("0|65@1+"), "x.dbc:6: T = 65: must have 1 to 64 bits"));
  CHECK(reports(placed("0|0@1+"), "x.dbc:6: T = 0: must have 1 to 64 bits"));
  CHECK(reports(placed("60|8@1+"), "x.dbc:6: T = 60|8: must end within the 8 bytes of NODE"));
  CHECK(reports(placed("0|16@0+", "1"), "x.dbc:6: T = 0|16: must end within the 1 bytes of NODE"));
  CHECK(
      reports(message(" SG_ T : 0|8@1+ (0,0) [0|0] \"\" B\n"), "x.dbc:6: T = 0: the factor must"));
  CHECK(reports("BO_ 2048 NODE: 8 A\n", "x.dbc:5: NODE = 2048: must be a number of 11 bits"));
  CHECK(reports("BO_ 3758096384 NODE: 8 A\n", "x.dbc:5: NODE = 3758096384: must be a number"));
  CHECK(reports(placed("0|8@1+") + placed("0|8@1+"), "x.dbc:7: NODE: is the name of two messages"));
  CHECK(reports(placed("0|8@1+") + " SG_ T : 8|8@1+ (1,0) [0|0] \"\" B\n",
                "x.dbc:7: T: is the name of two signals of NODE"));
  CHECK(reports(placed("0|16@1+") + "SIG_VALTYPE_ 385 T : 1;\n", "x.dbc:7: T = 16: must have 32"));
  CHECK(
      reports(placed("0|16@1+") + "SIG_VALTYPE_ 385 U : 1;\n", "x.dbc:7: U: must be a signal of"));
  CHECK(reports(placed("0|16@1+") + "SIG_VALTYPE_ 9 T : 1;\n",
                "x.dbc:7: T = 9: is the number of no message"));
  CHECK(reports(message(" SG_ T m1 : 0|8@1+ (1,0) [0|0] \"\" B\n"), "x.dbc:6: T = m1: needs a"));
  CHECK(reports(message(" SG_ P M : 0|2@1+ (1,0) [0|0] \"\" B\n"
                        " SG_ T m4 : 8|8@1+ (1,0) [0|0] \"\" B\n"),
                "x.dbc:7: T = 4: is more than its multiplexor can be"));
  CHECK(reports(message(" SG_ P m0M : 0|2@1+ (1,0) [0|0] \"\" B\n") + "SG_MUL_VAL_ 385 P P 0-1;\n",
                "x.dbc:6: P: must not be selected by itself"));
  CHECK(reports(placed("0|8@1+") + "SG_MUL_VAL_ 385 T T 0-1;\n",
                "x.dbc:7: T: has a multiplexor here"));
  CHECK(reports("BA_DEF_ BO_ \"VFrameFormat\" ENUM \"a\",\"b\";\n" + placed("0|8@1+") +
                    "BA_ \"VFrameFormat\" BO_ 385 2;\n",
                "x.dbc:8: VFrameFormat = 2: must be one of the formats"));
}

TEST_CASE("a syntax error of a DBC file is refused at its position", "[dbc]") {
  const auto reports = [](const std::string& body, const std::string& start) {
    INFO(problems_of(body));
    return problems_of(body).find(start) == 0;
  };
  CHECK(reports(placed("0|8@1+") + "HELLO\n", "x.dbc:7: HELLO: must be a keyword of DBC files"));
  CHECK(reports(" SG_ T : 0|8@1+ (1,0) [0|0] \"\" B\n", "x.dbc:5: SG_: must follow a message"));
  CHECK(reports(placed("0|8@2+"), "x.dbc:6: 2+ (1,0) [0|0] \"\" B: must be 1 (Intel) or 0"));
  CHECK(reports(placed("0|8@1 "), "x.dbc:6: (1,0) [0|0] \"\" B: must be '+'"));
  CHECK(
      reports(message(" SG_ T : 0|8@1+ (nan,0) [0|0] \"\" B\n"), "x.dbc:6: nan,0) [0|0] \"\" B: "));
  CHECK(reports(message(" SG_ T : 0|8@1+ (1e999,0) [0|0] \"\" B\n"), "x.dbc:6: 1e999,0)"));
  CHECK(reports(message(" SG_ T q1 : 0|8@1+ (1,0) [0|0] \"\" B\n"), "x.dbc:6: q1 : 0|8"));
  CHECK(reports("BO_ 4294967296 NODE: 8 A\n", "x.dbc:5: 4294967296 NODE: 8 A: must be a message"));
  CHECK(reports("CM_ \"no end;\n", "x.dbc:5: the string that begins here has no end"));
  CHECK(reports("VAL_ 385 T 1\n", "x.dbc:6: the end of the file: must be ';'"));
  CHECK(reports(std::string("BO_ 1 \x01\x02"), "x.dbc:5: ??: must be a message's name"));
}

TEST_CASE("a flaw of a DBC file belongs to its message and signal, and the others are read",
          "[dbc]") {
  const DbcFile file = read_dbc_text(head +
                                         "BO_ 385 NODE: 8 A\n"
                                         " SG_ T : 0|16@1- (0.1,0) [0|0] \"degC\" B\n"
                                         " SG_ U : 16|16@1- (nan,0) [0|0] \"degC\" B\n"
                                         " SG_ V : 32|16@1- (0.1,0) [0|0]\n"  // no unit
                                         " SG_ W : 48|16@1- (0.1,0) [0|0] \"degC\" B\n"
                                         "BO_ x OTHER: 8 A\n"
                                         " SG_ T : 0|16@1- (0.1,0) [0|0] \"degC\" B\n"
                                         "BO_ 386 LAST: 8 A\n"
                                         " SG_ T : 0|16@1- (0.5,0) [0|0] \"degC\" B\n"
                                         "SIG_VALTYPE_ 385 T : 7;\n",
                                     "x.dbc");
  std::vector<std::array<std::string, 3>> flaws;
  for (const DbcFlaw& flaw : file.flaws)
    flaws.push_back({std::to_string(flaw.problem.line), flaw.message, flaw.signal});
  CHECK(flaws == std::vector<std::array<std::string, 3>>{
                     {"7", "NODE", "U"}, {"9", "NODE", "V"}, {"10", "", ""}, {"14", "NODE", "T"}});
  REQUIRE(file.message_names() == std::vector<std::string>{"NODE", "LAST"});
  CHECK(file.find("NODE")->signal_names() == std::vector<std::string>{"T", "W"});
  CHECK(file.find("LAST")->find("T")->place.scale == 0.5);
}

TEST_CASE("an extra quote or a missing semicolon costs only its statement", "[dbc]") {
  for (const char* comment :
       {"CM_ SG_ 385 T \"a 5\" pipe\";\n", "CM_ \"no end;\n", "CM_ \"none\"\n"}) {
    INFO(comment);
    const DbcFile file = read_dbc_text(
        "\xEF\xBB\xBF" + head + comment + "BO_ 385 NODE: 8 A\n" +
            " SG_ T : 0|32@1- (0.1,0) [-inf|inf] \"degC\" B\n SG_ U : 32|8@1- (1,0) [|] \"\" B\n" +
            "SIG_VALTYPE_ 385 T : 1;\n",
        "x.dbc");
    REQUIRE(file.flaws.size() == 1);
    CHECK(file.flaws[0].problem.line <= 6);
    CHECK(file.flaws[0].message.empty());
    REQUIRE(file.find("NODE") != nullptr);
    CHECK(file.find("NODE")->find("T")->place.is_float);
  }
}

TEST_CASE("a signal whose multiplexor has a flaw has one as well", "[dbc]") {
  const DbcFile file = read_dbc_text(
      head +
          message(" SG_ P M : 60|8@1+ (1,0) [0|0] \"\" B\n SG_ T m1 : 8|8@1+ (1,0) [0|0] \"\" B\n"
                  " SG_ U : 16|8@1+ (1,0) [0|0] \"\" B\n"),
      "x.dbc");
  REQUIRE(file.flaws.size() == 2);
  CHECK(file.flaws[0].signal == "P");
  CHECK(file.flaws[1].signal == "T");
}

TEST_CASE("reading a DBC file stops at 1000 flaws", "[dbc]") {
  std::string text = placed("0|8@1+");
  for (int i = 0; i < 2000; ++i) text += "BO_ x\n";
  const DbcFile file = read_dbc_text(head + text, "x.dbc");
  CHECK(file.flaws.size() == 1001);
  CHECK(file.messages.empty());
}

TEST_CASE("names of a DBC file may begin with a digit, have a hyphen, and be shortened", "[dbc]") {
  const DbcFile file = read_dbc_text(
      "VERSION \"\"\nBU_: 2A B-C\nBO_ 385 2_Node: 8 2A\n"
      " SG_ Near-Th_01 : 0|16@1- (0.1,0) [0|0] \"\" B-C,2A\n"
      " SG_ Near-Th_02 : 16|16@1- (0.1,0) [0|0] \"\" B-C\n"
      " SG_ Far_01 : 32|16@1- (0.1,0) [0|0] \"\" B-C\n"
      " SG_ Far_02 : 48|16@1- (0.1,0) [0|0] \"\" B-C\n"
      "BA_DEF_ SG_ \"SystemSignalLongSymbol\" STRING ;\n"
      "BA_ \"SystemMessageLongSymbol\" BO_ 385 \"2_Node_Of_The_Spindle\";\n"
      "BA_ \"SystemSignalLongSymbol\" SG_ 385 Near-Th_01 \"NearTheSpindle\";\n"
      "BA_ \"SystemSignalLongSymbol\" SG_ 385 Near-Th_02 \"NearTheBed\";\n"
      "BA_ \"SystemSignalLongSymbol\" SG_ 385 Far_01 \"Far\";\n"
      "BA_ \"SystemSignalLongSymbol\" SG_ 385 Far_02 \"Far\";\n",
      "x.dbc");
  const DbcMessage* node = file.find("2_Node_Of_The_Spindle");
  REQUIRE(node != nullptr);
  CHECK(node == file.find("2_Node"));
  CHECK(node->find("NearTheBed")->place.start_bit == 16);
  CHECK(node->find("Near-Th_02")->place.start_bit == 16);
  // A long name of two signals is ignored.
  CHECK(node->find("Far") == nullptr);
  REQUIRE(file.flaws.size() == 1);
  CHECK(to_string(file.flaws[0].problem) == "x.dbc:13: Far: is the long name of two signals");
}

TEST_CASE("a J1939 group matches any sender and priority, and any receiver if not a broadcast",
          "[dbc]") {
  const auto mask = [](const std::string& number, const std::string& format) {
    const DbcFile file = read_dbc_text(
        head + "BO_ " + number + " NODE: 8 A\n SG_ T : 0|8@1+ (1,0) [0|0] \"\" B\n" +
            "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\"," +
            "\"J1939PG\";\nBA_ \"VFrameFormat\" BO_ " + number + " " + format + ";\n",
        "x.dbc");
    REQUIRE(file.flaws.empty());
    return file.messages.at(0).signals.at(0).place.id_mask;
  };
  CHECK(mask("2566861310", "3") == 0x03FFFF00);  // 18FF31FE, a broadcast
  CHECK(mask("2565812734", "3") == 0x03FF0000);  // 18EF31FE, to one node
  CHECK(mask("2566861310", "1") == 0x1FFFFFFF);
  CHECK(mask("385", "3") == 0x1FFFFFFF);
}
