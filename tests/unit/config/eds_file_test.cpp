// What an electronic data sheet may say, and what is refused by file, line and rule.
#include "config/bus_files/eds_file.hpp"

#include <string>

#include <catch2/catch.hpp>

#include "files.hpp"

using namespace thermocomp;

namespace {

/// All problems, one a line; "" for a good file.
std::string told(const std::string& text) {
  std::string told;
  for (const Problem& problem : read_eds_text(text, "x.eds").problems) {
    told += to_string(problem) + "\n";
  }
  return told;
}

EdsFile good(const std::string& text) {
  EdsReading reading = read_eds_text(text, "x.eds");
  INFO(told(text));
  REQUIRE(reading.problems.empty());
  return std::move(reading.file);
}

const std::string array =
    "[7130]\nParameterName=Input PV\nObjectType=0x8\nSubNumber=3\n"
    "[7130sub0]\nParameterName=Number of entries\nDataType=0x0005\n"
    "[7130sub1]\nParameterName=Input PV 1\nDataType=0x0003\n"
    "[7130sub2]\nParameterName=Input PV 2\nDataType=0x0008\n";

}  // namespace

TEST_CASE("objects of a data sheet are found by address and by name", "[eds]") {
  const EdsFile file = good(test::example("two_channel_module.eds"));
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
  // The array itself holds no value, and each array has a number of entries.
  CHECK(file.find("AI input PV").empty());
  CHECK(file.find(ObjectAddress{0x7130, 3}) == nullptr);
  CHECK(file.find("Number of entries").size() == 2);
}

TEST_CASE("a part of a name is no name", "[eds]") {
  const EdsFile file = good(array);
  CHECK(file.find("PV 1").empty());
  CHECK(file.find("").empty());
  CHECK(file.find("Input PV/").empty());
}

TEST_CASE("numbers of a data sheet have the types of CiA 301", "[eds]") {
  const auto type = [](const std::string& code) {
    return good("[2000]\nParameterName=x\nDataType=" + code + "\n").objects.at(0).type;
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
  const EdsFile file = good(
      "\xEF\xBB\xBF; a comment\r\n[FileInfo]\r\nDescription=a = b ; c # \"d\"\r\n\r\n"
      "[1A00SUB0A]\r\n  parametername = Temp\xE9rature \r\nDATATYPE=0x7\r\n"
      "[1a00]\r\nParameterName=Mapping\r\nObjectType=9\r\n");
  REQUIRE(file.objects.size() == 1);
  CHECK(file.objects[0].address == ObjectAddress{0x1A00, 10});
  CHECK(file.objects[0].name == "Mapping/Temp?rature");
}

TEST_CASE("CompactSubObj makes as many objects, named by its list or numbered", "[eds]") {
  const EdsFile file = good(
      "[7130]\nParameterName=PV\nObjectType=8\nDataType=3\nCompactSubObj=3\n"
      "[7130Name]\nNrOfEntries=1\n2=Spindle\n");
  CHECK(file.names() == std::vector<std::string>{"PV/PV1", "PV/Spindle", "PV/PV3"});
  CHECK(file.find("Spindle").at(0)->address == ObjectAddress{0x7130, 2});
  CHECK_THAT(told("[7130]\nParameterName=PV\nObjectType=8\nCompactSubObj=255\n"),
             Catch::Contains("x.eds:1: 7130.CompactSubObj = 255: must be at most 254"));
}

TEST_CASE("what is not the form of a data sheet is refused with its line", "[eds]") {
  CHECK(told("") == "x.eds: is no electronic data sheet: it has no object\n");
  CHECK_THAT(told("[FileInfo]\nFileName=x\n"), Catch::Contains("it has no object"));
  CHECK_THAT(told(array + "PDOMapping\n"),
             Catch::Contains("x.eds:14: PDOMapping: must be a section, an entry KEY=VALUE or a"));
  CHECK_THAT(told(array + "=1\n"), Catch::Contains("x.eds:14: =1: must be a section, an entry"));
  CHECK_THAT(told("FileName=x\n" + array),
             Catch::Contains("x.eds:1: FileName=x: must stand in a section"));
  CHECK_THAT(told(array + "[1018\n"), Catch::Contains("x.eds:14: [1018: must be a section's name"));
  CHECK_THAT(told(array + "DataType=0x0004\n"),
             Catch::Contains("x.eds:14: DataType = 0x0004: stands twice in its section"));
  CHECK_THAT(told(array + "[7130SUB1]\nParameterName=again\n"),
             Catch::Contains("x.eds:14: 7130SUB1: stands there twice, first in line 8"));
}

TEST_CASE("objects of a data sheet that cannot be are refused", "[eds]") {
  CHECK_THAT(told("[2000]\nDataType=3\n"),
             Catch::Contains("x.eds:1: 2000.ParameterName = (missing): must be given"));
  CHECK_THAT(told("[2000]\nParameterName=x\nDataType=int16\n"),
             Catch::Contains("x.eds:3: 2000.DataType = int16: must be a whole number"));
  CHECK_THAT(told("[2000]\nParameterName=x\nDataType=-3\n"), Catch::Contains("whole number"));
  CHECK_THAT(told("[2000sub1]\nParameterName=x\nDataType=3\n"),
             Catch::Contains("x.eds:1: 2000sub1: is a part of an object that is not there"));
  CHECK_THAT(told(array + "[7130sub01]\nParameterName=y\nDataType=3\n"),
             Catch::Contains("is an object that stands there already"));
}

TEST_CASE("a file that is wrong everywhere has at most 100 problems", "[eds]") {
  std::string text;
  for (int i = 0; i < 1000; ++i) text += "rubbish\n";
  CHECK(read_eds_text(text, "x.eds").problems.size() == 100);
  CHECK_THAT(told("[2000]\n" + std::string(5000, 'x') + "\n"),
             Catch::Contains("x.eds:2: " + std::string(60, 'x') + ": must be"));
}
