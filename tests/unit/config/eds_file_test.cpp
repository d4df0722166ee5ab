// Valid and refused content of electronic data sheets.
#include "config/bus_files/eds_file.hpp"

#include <string>

#include <catch2/catch.hpp>

#include "files.hpp"

using namespace thermocomp;

namespace {

/// All problems, one per line; "" for a valid file.
std::string reported(const std::string& text) {
  std::string reported;
  for (const EdsFlaw& flaw : read_eds_text(text, "x.eds").flaws) {
    reported += to_string(flaw.problem) + "\n";
  }
  return reported;
}

EdsFile eds_file(const std::string& text) {
  EdsFile file = read_eds_text(text, "x.eds");
  INFO(reported(text));
  REQUIRE(file.flaws.empty());
  return file;
}

const std::string array =
    "[7130]\nParameterName=Input PV\nObjectType=0x8\nSubNumber=3\n"
    "[7130sub0]\nParameterName=Number of entries\nDataType=0x0005\n"
    "[7130sub1]\nParameterName=Input PV 1\nDataType=0x0003\n"
    "[7130sub2]\nParameterName=Input PV 2\nDataType=0x0008\n";

}  // namespace

TEST_CASE("objects of a data sheet are found by address and by name", "[eds]") {
  const EdsFile file = eds_file(test::example("two_channel_module.eds"));
  REQUIRE(file.objects.size() == 9);
  const EdsObject* value = file.find(ObjectAddress{0x7130, 2});
  REQUIRE(value != nullptr);
  CHECK(value->name == "AI input PV/AI input PV 2");
  REQUIRE(value->type);
  CHECK(*value->type == ObjectType{16, true, false});
  REQUIRE(file.find("AI input PV 2").size() == 1);
  CHECK(file.find("AI input PV 2")[0] == value);
  REQUIRE(file.find("AI input PV/AI input PV 2").size() == 1);
  CHECK(file.find("AI input PV/AI input PV 2")[0] == value);
  // The array itself has no value, and each array has a number of entries.
  CHECK(file.find("AI input PV").empty());
  CHECK(file.find(ObjectAddress{0x7130, 3}) == nullptr);
  CHECK(file.find("Number of entries").size() == 2);
}

TEST_CASE("a part of a name is not found", "[eds]") {
  const EdsFile file = eds_file(array);
  CHECK(file.find("PV 1").empty());
  CHECK(file.find("").empty());
  CHECK(file.find("Input PV/").empty());
}

TEST_CASE("numbers of a data sheet have the types of CiA 301", "[eds]") {
  const auto type = [](const std::string& code) {
    return eds_file("[2000]\nParameterName=x\nDataType=" + code + "\n").objects.at(0).type;
  };
  CHECK(type("0x0001") == ObjectType{1, false, false});
  CHECK(type("0x0002") == ObjectType{8, true, false});
  CHECK(type("0x0006") == ObjectType{16, false, false});
  CHECK(type("0x0008") == ObjectType{32, true, true});
  CHECK(type("16") == ObjectType{24, true, false});
  CHECK(type("0X1B") == ObjectType{64, false, false});
  CHECK(type("033") == ObjectType{64, false, false});  // octal, as in C
  CHECK(type("0x0009") == std::nullopt);               // a text
  CHECK(type("") == std::nullopt);
}

TEST_CASE("a data sheet may be written as manufacturers do", "[eds]") {
  const EdsFile file = eds_file(
      "\xEF\xBB\xBF; a comment\r\n[FileInfo]\r\nDescription=a = b ; c # \"d\"\r\n\r\n"
      "[1A00SUB0A]\r\n  parametername = Temp\xE9rature \r\nDATATYPE=0x7\r\n"
      "[1a00]\r\nParameterName=Mapping\r\nObjectType=9\r\n");
  REQUIRE(file.objects.size() == 1);
  CHECK(file.objects[0].address == ObjectAddress{0x1A00, 10});
  CHECK(file.objects[0].name == "Mapping/Temp?rature");
}

TEST_CASE("CompactSubObj makes as many objects, named by its list or numbered", "[eds]") {
  const EdsFile file = eds_file(
      "[7130]\nParameterName=PV\nObjectType=8\nDataType=3\nCompactSubObj=3\n"
      "[7130Name]\nNrOfEntries=1\n2=Spindle\n");
  CHECK(file.names() == std::vector<std::string>{"PV/PV1", "PV/Spindle", "PV/PV3"});
  CHECK(file.find("Spindle").at(0)->address == ObjectAddress{0x7130, 2});
  CHECK_THAT(reported("[7130]\nParameterName=PV\nObjectType=8\nCompactSubObj=255\n"),
             Catch::Contains("x.eds:1: 7130.CompactSubObj = 255: must be at most 254"));
}

TEST_CASE("a malformed line of a data sheet is refused", "[eds]") {
  CHECK(reported("") == "x.eds: is not an electronic data sheet: it has no objects\n");
  CHECK_THAT(reported("[FileInfo]\nFileName=x\n"), Catch::Contains("it has no object"));
  CHECK_THAT(reported(array + "PDOMapping\n"),
             Catch::Contains("x.eds:14: PDOMapping: must be a section, an entry KEY=VALUE or a"));
  CHECK_THAT(reported(array + "=1\n"),
             Catch::Contains("x.eds:14: =1: must be a section, an entry"));
  CHECK_THAT(reported("FileName=x\n" + array),
             Catch::Contains("x.eds:1: FileName=x: must be in a section"));
  CHECK_THAT(reported(array + "[1018\n"),
             Catch::Contains("x.eds:14: [1018: must be a section's name"));
  CHECK_THAT(reported(array + "DataType=0x0004\n"),
             Catch::Contains("x.eds:14: DataType = 0x0004: appears twice in its section"));
  CHECK_THAT(reported(array + "[7130SUB1]\nParameterName=again\n"),
             Catch::Contains("x.eds:14: 7130SUB1: appears twice, first in line 8"));
}

TEST_CASE("invalid objects of a data sheet are refused", "[eds]") {
  CHECK_THAT(reported("[2000]\nDataType=3\n"),
             Catch::Contains("x.eds:1: 2000.ParameterName = (missing): must be given"));
  CHECK_THAT(reported("[2000]\nParameterName=x\nDataType=int16\n"),
             Catch::Contains("x.eds:3: 2000.DataType = int16: must be a whole number"));
  CHECK_THAT(reported("[2000]\nParameterName=x\nDataType=-3\n"), Catch::Contains("whole number"));
  CHECK_THAT(reported("[2000sub1]\nParameterName=x\nDataType=3\n"),
             Catch::Contains("x.eds:1: 2000sub1: is part of a missing object"));
  CHECK_THAT(reported(array + "[7130sub01]\nParameterName=y\nDataType=3\n"),
             Catch::Contains("is a duplicate object"));
}

TEST_CASE("reading a data sheet stops after too many flaws", "[eds]") {
  std::string text = array;
  for (int i = 0; i < 2000; ++i) text += "rubbish\n";
  const EdsFile file = read_eds_text(text, "x.eds");
  CHECK(file.flaws.size() == 1001);
  CHECK(file.objects.empty());
  CHECK_THAT(reported("[2000]\n" + std::string(5000, 'x') + "\n"),
             Catch::Contains("x.eds:2: " + std::string(60, 'x') + ": must be"));
}

TEST_CASE("a flaw of a data sheet belongs to its object", "[eds]") {
  const EdsFile file = read_eds_text("rubbish\n" + array +
                                         "[2000]\nDataType=int\n[2001sub1]\nParameterName=x\n"
                                         "DataType=3\n",
                                     "x.eds");
  REQUIRE(file.flaws.size() == 4);
  CHECK_FALSE(file.flaws[0].object);
  CHECK(file.flaws[1].object == ObjectAddress{0x2000, 0});  // no name
  CHECK(file.flaws[2].object == ObjectAddress{0x2000, 0});  // no type
  CHECK(file.flaws[3].object == ObjectAddress{0x2001, 1});  // without a parent
  CHECK(file.find("Input PV 1").size() == 1);
  REQUIRE(file.find(ObjectAddress{0x2001, 1}) != nullptr);
  CHECK(file.find(ObjectAddress{0x2001, 1})->type == ObjectType{16, true, false});
}
