#include "config/toml_reader.hpp"

#include <algorithm>
#include <limits>

#include "config/number_text.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

TomlDocument document(const std::string& text) {
  return TomlDocument::from_text(text, "a.toml");
}

std::vector<std::string> told(const TomlDocument& read) {
  std::vector<std::string> lines;
  for (const Problem& problem : problems_of([&] {
         read.finish();
         return 0;
       })) {
    lines.push_back(to_string(problem));
  }
  return lines;
}

}  // namespace

TEST_CASE("what is read in full has no problem", "[config][toml]") {
  const TomlDocument read = document(
      "a = 1\nb = 2.5\nc = \"x\"\nd = true\ne = [1, 2.0]\nf = [\"p\"]\ng = [3]\n"
      "m = [[1, 2], [3, 4]]\n[t]\nu = 7\n[[l]]\nname = \"first\"\n[[l]]\nname = \"second\"\n");
  const TomlTable root = read.root();
  CHECK(root.integer("a", 0, 5) == 1);
  CHECK(root.number("b") == 2.5);
  CHECK(root.text("c") == "x");
  CHECK(root.flag("d"));
  CHECK(root.numbers("e") == std::vector<double>{1, 2});
  CHECK(root.texts("f") == std::vector<std::string>{"p"});
  CHECK(root.integers("g", 0, 9) == std::vector<std::int64_t>{3});
  CHECK(root.matrix("m", 2, 2) == std::vector<std::vector<double>>{{1, 2}, {3, 4}});
  CHECK(root.table("t").integer("u", 0, 9) == 7);
  CHECK(root.table_or_empty("absent").integer("x", 0, 9, 4) == 4);
  REQUIRE(root.tables("l").size() == 2);
  CHECK(root.tables("l")[1].text("name") == "second");
  CHECK(root.tables("l")[1].path() == "l[second]");
  CHECK(root.tables("l")[1].line() == 13);
  CHECK(told(document("")).empty());
  CHECK(root.tables("l")[0].text("name") == "first");
  CHECK(told(read).empty());
}

TEST_CASE("each problem names file, line, key, value and rule", "[config][toml]") {
  const TomlDocument read = document("a = 9\n\nb = \"x\"\nspeling = 1\n");
  const TomlTable root = read.root();
  CHECK(root.integer("a", 0, 5) >= 0);
  CHECK(root.number("b", Range::above(0, 3)) > 0);
  CHECK(root.number("spelling", Range::any(), 2.0) == 2.0);
  CHECK(root.text("c").empty());
  CHECK(told(read) ==
        std::vector<std::string>{"a.toml:1: a = 9: must be a whole number in [0, 5]",
                                 "a.toml:1: c = (missing): must be given",
                                 "a.toml:3: b = \"x\": must be a number",
                                 "a.toml:4: speling = 1: unknown key; did you mean \"spelling\"?"});
}

TEST_CASE("numbers that are none, or beyond their range, are refused", "[config][toml]") {
  for (const char* value :
       {"nan", "inf", "-inf", "true", "\"1\"", "[1]", "-0.5", "3.5", "1979-05-27"}) {
    INFO(value);
    const TomlDocument read = document(std::string("a = ") + value);
    const double harmless = read.root().number("a", Range::between(0, 3));
    CHECK((harmless >= 0 && harmless <= 3));
    CHECK(told(read).size() == 1);
  }
  for (const char* value : {"0", "3", "0.0", "3.0", "-0.0", "1e-300", "9007199254740993"}) {
    const TomlDocument read = document(std::string("a = ") + value);
    static_cast<void>(read.root().number("a", Range::at_least(0)));
    CHECK(told(read).empty());
  }
}

TEST_CASE("an excluded bound is excluded and the other is not", "[config][toml]") {
  CHECK_FALSE(Range::above(0, 500).contains(0));
  CHECK(Range::above(0, 500).contains(500));
  CHECK(Range::above(0, 500).rule() == "must be in (0, 500]");
  CHECK(Range::at_least(2).rule() == "must be at least 2");
  CHECK_FALSE(Range::any().contains(std::numeric_limits<double>::infinity()));
  CHECK_FALSE(Range::any().contains(std::numeric_limits<double>::quiet_NaN()));
}

TEST_CASE("every bad element of a list is told and the count stays", "[config][toml]") {
  const TomlDocument read = document("a = [1, \"x\", 3, nan]\nb = [\"p\", 5]\nm = [[1], [1, 2]]\n");
  CHECK(read.root().numbers("a").size() == 4);
  CHECK(read.root().texts("b").size() == 2);
  CHECK(read.root().matrix("m", 2, 2).empty());
  CHECK(told(read).size() == 4);
}

TEST_CASE("nothing is said about the inside of a table that is missing", "[config][toml]") {
  const TomlDocument read = document("other = 5\n");
  const TomlTable absent = read.root().table("needed");
  CHECK_FALSE(absent);
  CHECK(absent.text("x").empty());
  CHECK(absent.table("y").number("z") == 0.0);
  CHECK(read.root().integer("other", 0, 9) == 5);
  CHECK(told(read) == std::vector<std::string>{"a.toml:1: needed = (missing): must be given"});
}

TEST_CASE("a section that may be left out still requires its keys", "[config][toml]") {
  const TomlDocument read = document("");
  CHECK(read.root().table_or_empty("section").text("x").empty());
  CHECK(told(read).size() == 1);
}

TEST_CASE("nothing is suggested where nothing is near", "[config][toml]") {
  CHECK(nearest_name("prot", {"host", "port", "unit"}) == "port");
  CHECK(nearest_name("temperature", {"host", "port"}).empty());
  CHECK(nearest_name("x", {"y"}).empty());
}

TEST_CASE("numbers are written so that they read back to the same bits", "[config]") {
  for (const double value : {0.1, 1.0 / 3.0, 5e-324, 1.7976931348623157e308, -0.0, 1e22}) {
    CHECK(std::strtod(number_text(value).c_str(), nullptr) == value);
  }
  CHECK(number_text(-std::numeric_limits<double>::quiet_NaN()) == "nan");
}

TEST_CASE("a problem stays on its line whatever its names hold, and shows an empty name",
          "[config][toml]") {
  const TomlDocument read = document("\"a\\nb\\u001b[2J\" = 1\nname = \"x\"\n");
  read.root().problem("name", "", "is no name");
  const std::vector<std::string> lines = told(read);
  REQUIRE(lines.size() == 2);
  for (const std::string& line : lines) {
    CHECK(std::none_of(line.begin(), line.end(), [](char c) { return c >= 0 && c < ' '; }));
  }
  CHECK(lines[1] == "a.toml:2: name = \"\": is no name");
}
