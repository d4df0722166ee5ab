// What a DBC file may say, and what is refused by file, line and rule. Values beside canmatrix:
// tests/integration/can.
#include "config/bus_files/dbc_file.hpp"

#include <string>
#include <string_view>

#include <catch2/catch.hpp>

using namespace thermocomp;

namespace {

const std::string head = "VERSION \"\"\nNS_ :\nBS_:\nBU_: A B\n";

/// All problems, one a line; "" for a good file.
std::string problems_of(const std::string& body) {
  std::string told;
  for (const Problem& problem : read_dbc_text(head + body, "x.dbc").problems) {
    told += to_string(problem) + "\n";
  }
  return told;
}

std::string message(const std::string& signals, const std::string& bytes = "8") {
  return "BO_ 385 NODE: " + bytes + " A\n" + signals;
}

/// A message with one signal of this place.
std::string placed(const std::string& place, const std::string& bytes = "8") {
  return message(" SG_ T : " + place + " (1,0) [0|0] \"\" B\n", bytes);
}

}  // namespace

TEST_CASE("a DBC file's messages and signals are read as they stand", "[dbc]") {
  const DbcReading reading =
      read_dbc_text(head +
                        "BO_ 385 NODE: 8 A\n"
                        " SG_ Column : 7|12@0- (0.1,-4E1) [-50|150] \"degC\"  A,B\n"
                        " SG_ Alive : 56|8@1+(1,0)[0|0]\"\" B\r\n"
                        "BO_ 2566844926 WIDE: 16 A\n"
                        " SG_ Late : 96|32@1- (1,0) [0|0] \"\" B\n"
                        "SIG_VALTYPE_ 2566844926 Late : 1;\n",
                    "x.dbc");
  REQUIRE(reading.problems.empty());
  REQUIRE(reading.file.message_names() == std::vector<std::string>{"NODE", "WIDE"});
  const DbcMessage& node = reading.file.messages[0];
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
  const DbcMessage& wide = *reading.file.find("WIDE");
  CHECK(wide.id == 0x18FEF1FE);
  CHECK(wide.extended);
  CHECK(wide.find("Late")->place.fd);
  CHECK(wide.find("Late")->place.is_float);
  CHECK(wide.find("Missing") == nullptr);
}

TEST_CASE("multiplexors of a DBC file select by page, nested ones by all of theirs", "[dbc]") {
  const std::string simple =
      " SG_ Page M : 0|4@1+ (1,0) [0|0] \"\" B\n SG_ T m3 : 8|16@1- (1,0) [0|0] \"\" B\n";
  const DbcReading paged = read_dbc_text(head + message(simple), "x.dbc");
  REQUIRE(paged.problems.empty());
  const std::vector<CanSelector> on_three{{{0, 4, ByteOrder::little_endian}, {{3, 3}}}};
  CHECK(paged.file.messages[0].find("T")->place.selectors == on_three);
  CHECK(paged.file.messages[0].find("Page")->place.selectors.empty());

  const std::string nested =
      " SG_ Outer M : 0|4@1+ (1,0) [0|0] \"\" B\n SG_ Inner m1M : 4|4@1+ (1,0) [0|0] \"\" B\n"
      " SG_ T m0 : 8|16@1- (1,0) [0|0] \"\" B\n";
  CHECK(problems_of(message(nested)).find("x.dbc:7: Inner = m1: needs a line SG_MUL_VAL_") == 0);
  const DbcReading deep =
      read_dbc_text(head + message(nested) +
                        "SG_MUL_VAL_ 385 Inner Outer 1-1;\nSG_MUL_VAL_ 385 T Inner 0-2, 5-5;\n",
                    "x.dbc");
  REQUIRE(deep.problems.empty());
  const std::vector<CanSelector> both{{{4, 4, ByteOrder::little_endian}, {{0, 2}, {5, 5}}},
                                      {{0, 4, ByteOrder::little_endian}, {{1, 1}}}};
  CHECK(deep.file.messages[0].find("T")->place.selectors == both);
}

TEST_CASE("a DBC file may say what is of no use here", "[dbc]") {
  CHECK(problems_of("VAL_TABLE_ States 1 \"a;b\" 0 \"c\" ;\n" + placed("0|8@1+") +
                    "BO_TX_BU_ 385 : A,B;\nCM_ SG_ 385 T \"two\nlines \\\"quoted\\\"; so\";\n"
                    "BA_DEF_ SG_ \"Start\" INT 0 10;\nBA_DEF_DEF_ \"Start\" 0;\n"
                    "BA_ \"Start\" SG_ 385 T 5;\nVAL_ 385 T 255 \"open\" ;\n"
                    "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n"
                    " SG_ Old : 0|8@1+ (1,0) [0|0] \"\" Vector__XXX\n")
            .empty());
}

TEST_CASE("what a DBC file must not say is refused by line and rule", "[dbc]") {
  const auto tells = [](const std::string& body, const std::string& start) {
    INFO(problems_of(body));
    return problems_of(body).find(start) == 0;
  };
  CHECK(tells(placed("0|65@1+"), "x.dbc:6: T = 65: must have 1 to 64 bits"));
  CHECK(tells(placed("0|0@1+"), "x.dbc:6: T = 0: must have 1 to 64 bits"));
  CHECK(tells(placed("60|8@1+"), "x.dbc:6: T = 60|8: must end within the 8 bytes of NODE"));
  CHECK(tells(placed("0|16@0+", "1"), "x.dbc:6: T = 0|16: must end within the 1 bytes of NODE"));
  CHECK(tells(message(" SG_ T : 0|8@1+ (0,0) [0|0] \"\" B\n"), "x.dbc:6: T = 0: the factor must"));
  CHECK(tells("BO_ 2048 NODE: 8 A\n", "x.dbc:5: NODE = 2048: must be a number of 11 bits"));
  CHECK(tells("BO_ 3758096384 NODE: 8 A\n", "x.dbc:5: NODE = 3758096384: must be a number"));
  CHECK(tells(placed("0|8@1+") + placed("0|8@1+"), "x.dbc:7: NODE: is the name of two messages"));
  CHECK(tells(placed("0|8@1+") + " SG_ T : 8|8@1+ (1,0) [0|0] \"\" B\n",
              "x.dbc:7: T: is the name of two signals of NODE"));
  CHECK(tells(placed("0|16@1+") + "SIG_VALTYPE_ 385 T : 1;\n", "x.dbc:7: T = 16: must have 32"));
  CHECK(tells(placed("0|16@1+") + "SIG_VALTYPE_ 385 U : 1;\n", "x.dbc:7: U: must be a signal of"));
  CHECK(tells(placed("0|16@1+") + "SIG_VALTYPE_ 9 T : 1;\n", "x.dbc:7: 9: must be a message's"));
  CHECK(tells(message(" SG_ T m1 : 0|8@1+ (1,0) [0|0] \"\" B\n"), "x.dbc:6: T = m1: needs a"));
  CHECK(tells(message(" SG_ P M : 0|2@1+ (1,0) [0|0] \"\" B\n"
                      " SG_ T m4 : 8|8@1+ (1,0) [0|0] \"\" B\n"),
              "x.dbc:7: T = 4: is more than its multiplexor can be"));
  CHECK(tells(message(" SG_ P m0M : 0|2@1+ (1,0) [0|0] \"\" B\n") + "SG_MUL_VAL_ 385 P P 0-1;\n",
              "x.dbc:6: P: must not be selected by itself"));
  CHECK(tells(placed("0|8@1+") + "SG_MUL_VAL_ 385 T T 0-1;\n", "x.dbc:7: T: is said to be"));
  CHECK(tells("BA_DEF_ BO_ \"VFrameFormat\" ENUM \"a\",\"b\";\n" + placed("0|8@1+") +
                  "BA_ \"VFrameFormat\" BO_ 385 2;\n",
              "x.dbc:8: VFrameFormat = 2: must be one of the formats"));
}

TEST_CASE("a DBC file that breaks the grammar is refused where it does", "[dbc]") {
  const auto tells = [](const std::string& body, const std::string& start) {
    INFO(problems_of(body));
    return problems_of(body).find(start) == 0;
  };
  CHECK(tells(placed("0|8@1+") + "HELLO\n", "x.dbc:7: HELLO: must be a keyword of DBC files"));
  CHECK(tells(" SG_ T : 0|8@1+ (1,0) [0|0] \"\" B\n", "x.dbc:5: SG_: must stand below a message"));
  CHECK(tells(placed("0|8@2+"), "x.dbc:6: 2+ (1,0) [0|0] \"\" B: must be 1 (Intel) or 0"));
  CHECK(tells(placed("0|8@1 "), "x.dbc:6: (1,0) [0|0] \"\" B: must be '+'"));
  CHECK(tells(message(" SG_ T : 0|8@1+ (nan,0) [0|0] \"\" B\n"), "x.dbc:6: nan,0) [0|0] \"\" B: "));
  CHECK(tells(message(" SG_ T : 0|8@1+ (1e999,0) [0|0] \"\" B\n"), "x.dbc:6: 1e999,0)"));
  CHECK(tells(message(" SG_ T q1 : 0|8@1+ (1,0) [0|0] \"\" B\n"), "x.dbc:6: q1 : 0|8"));
  CHECK(tells("BO_ 4294967296 NODE: 8 A\n", "x.dbc:5: 4294967296 NODE: 8 A: must be a message"));
  CHECK(tells("CM_ \"no end;\n", "x.dbc:5: the string that begins here has no end"));
  CHECK(tells("VAL_ 385 T 1\n", "x.dbc:6: the end of the file: must be ';'"));
  CHECK(tells(std::string("BO_ 1 \x01\x02"), "x.dbc:5: ??: must be a message's name"));
}
