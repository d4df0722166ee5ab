#include "config/toml/toml_reader.hpp"

#include <algorithm>
#include <limits>

#include "config/text/printable_text.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

TomlDocument document(const std::string& text) {
  return TomlDocument::from_text(text, "a.toml");
}

std::vector<std::string> problem_texts(const TomlDocument& read) {
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

TEST_CASE("a completely read document has no problem", "[config][toml]") {
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
  CHECK(problem_texts(document("")).empty());
  CHECK(root.tables("l")[0].text("name") == "first");
  CHECK(problem_texts(read).empty());
}

TEST_CASE("each problem names file, line, key, value and rule", "[config][toml]") {
  const TomlDocument read = document("a = 9\n\nb = \"x\"\nspeling = 1\n");
  const TomlTable root = read.root();
  CHECK(root.integer("a", 0, 5) >= 0);
  CHECK(root.number("b", Range::above(0, 3)) > 0);
  CHECK(root.number("spelling", Range::any(), 2.0) == 2.0);
  CHECK(root.text("c").empty());
  CHECK(problem_texts(read) ==
        std::vector<std::string>{"a.toml:1: a = 9: must be a whole number in [0, 5]",
                                 "a.toml:1: c = (missing): must be given",
                                 "a.toml:3: b = \"x\": must be a number",
                                 "a.toml:4: speling = 1: unknown key; did you mean \"spelling\"?"});
}

TEST_CASE("values that are not numbers, or out of range, are refused", "[config][toml]") {
  for (const char* value :
       {"nan", "inf", "-inf", "true", "\"1\"", "[1]", "-0.5", "3.5", "1979-05-27"}) {
    INFO(value);
    const TomlDocument read = document(std::string("a = ") + value);
    const double harmless = read.root().number("a", Range::between(0, 3));
    CHECK((harmless >= 0 && harmless <= 3));
    CHECK(problem_texts(read).size() == 1);
  }
  for (const char* value : {"0", "3", "0.0", "3.0", "-0.0", "1e-300", "9007199254740993"}) {
    const TomlDocument read = document(std::string("a = ") + value);
    static_cast<void>(read.root().number("a", Range::at_least(0)));
    CHECK(problem_texts(read).empty());
  }
}

TEST_CASE("an excluded bound is refused and the other is accepted", "[config][toml]") {
  CHECK_FALSE(Range::above(0, 500).contains(0));
  CHECK(Range::above(0, 500).contains(500));
  CHECK(Range::above(0, 500).rule() == "must be in (0, 500]");
  CHECK(Range::at_least(2).rule() == "must be at least 2");
  CHECK_FALSE(Range::any().contains(std::numeric_limits<double>::infinity()));
  CHECK_FALSE(Range::any().contains(std::numeric_limits<double>::quiet_NaN()));
}

TEST_CASE("every invalid element of a list is reported and the count is kept", "[config][toml]") {
  const TomlDocument read = document("a = [1, \"x\", 3, nan]\nb = [\"p\", 5]\nm = [[1], [1, 2]]\n");
  CHECK(read.root().numbers("a").size() == 4);
  CHECK(read.root().texts("b").size() == 2);
  CHECK(read.root().matrix("m", 2, 2).empty());
  CHECK(problem_texts(read).size() == 4);
}

TEST_CASE("no problems are reported inside a missing table", "[config][toml]") {
  const TomlDocument read = document("other = 5\n");
  const TomlTable absent = read.root().table("needed");
  CHECK_FALSE(absent);
  CHECK(absent.text("x").empty());
  CHECK(absent.table("y").number("z") == 0.0);
  CHECK(read.root().integer("other", 0, 9) == 5);
  CHECK(problem_texts(read) ==
        std::vector<std::string>{"a.toml:1: needed = (missing): must be given"});
}

TEST_CASE("an optional section still requires its keys", "[config][toml]") {
  const TomlDocument read = document("");
  CHECK(read.root().table_or_empty("section").text("x").empty());
  CHECK(problem_texts(read).size() == 1);
}

TEST_CASE("no suggestion without a near name", "[config][toml]") {
  CHECK(nearest_name("prot", {"host", "port", "unit"}) == "port");
  CHECK(nearest_name("temperature", {"host", "port"}).empty());
  CHECK(nearest_name("x", {"y"}).empty());
  // Ambiguous.
  CHECK(nearest_name("NearTheSpindle", {"NearTheSp_01", "NearTheSp_02"}).empty());
  CHECK(nearest_name("Temp_3", {"Temp_1", "Temp_2"}).empty());
  CHECK(nearest_name("Tmp_01", {"Temp_01", "Temp_02"}) == "Temp_01");
}

TEST_CASE("numbers are written so that they parse to the same bits", "[config]") {
  for (const double value : {0.1, 1.0 / 3.0, 5e-324, 1.7976931348623157e308, -0.0, 1e22}) {
    CHECK(std::strtod(number_text(value).c_str(), nullptr) == value);
  }
  CHECK(number_text(-std::numeric_limits<double>::quiet_NaN()) == "nan");
}

TEST_CASE("a problem stays on one line for any names, and shows an empty name", "[config][toml]") {
  const TomlDocument read = document("\"a\\nb\\u001b[2J\" = 1\nname = \"x\"\n");
  read.root().problem("name", "", "is no name");
  const std::vector<std::string> lines = problem_texts(read);
  REQUIRE(lines.size() == 2);
  for (const std::string& line : lines) {
    CHECK(std::none_of(line.begin(), line.end(), [](char c) { return c >= 0 && c < ' '; }));
  }
  CHECK(lines[1] == "a.toml:2: name = \"\": is no name");
}

TEST_CASE("too deep nesting is refused with its line, before parsing", "[config][toml]") {
  const auto repeated = [](const std::string& part, int count) {
    std::string text;
    for (int i = 0; i < count; ++i) text += part;
    return text;
  };
  const int count = GENERATE(17, 300, 50'000);
  const std::vector<std::string> texts{
      "a = 1\n[" + repeated("a.", count) + "z]\n",
      "a = 1\n[[" + repeated("a.", count) + "z]]\n",
      "a = 1\n" + repeated("\"a\" . ", count) + "z = 1\n",
      "a = 1\nb = " + repeated("[", count) + repeated("]", count) + "\n",
      "a = 1\nb = " + repeated("{ a = ", count) + "1" + repeated(" }", count) + "\n",
      "a = '''\n'''#\n[b]\nc = { " + repeated("a.", count) + "z = 1 }\n"};
  for (const std::string& text : texts) {
    const auto problems = problems_of([&] {
      static_cast<void>(document(text));
      return 0;
    });
    REQUIRE(problems.size() == 1);
    CHECK(problems.front().line >= 2);
    CHECK_THAT(problems.front().rule, Catch::Contains("at most 16 deep"));
  }
}

TEST_CASE("brackets and dots without nesting are not counted", "[config][toml]") {
  CHECK_NOTHROW(document(
      "a = \"[[[[[[[[[[[[[[[[[[[[ a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r \\\" [\"\n# "
      "[[[[[[[[[[[[[[[[[\n"
      "b = [1.5, 2.5, 3.5, 1.5, 2.5, 3.5, 1.5, 2.5, 3.5, 1.5, 2.5, 3.5, 1.5, 2.5, 3.5, 1.5, 2.5]\n"
      "c = \"\"\"\n[[[[[[[[[[[[[[[[[[\"\"\"\"\"\n"
      "d = { a.b = 1, a.c = 2, e.f = 3, g.h = 4, i.j = 5, k.l = 6, m.n = 7, o.p = 8, q.r = 9 }\n"
      "[[t.u]]\n[[t.u]]\n[t.v.w]\nx.y = [[1], [2], [3]]\n"));
}

TEST_CASE("too many keys and elements are refused before parsing", "[config][toml]") {
  std::string keys;
  for (int i = 0; i < 50'001; ++i) keys.append("k").append(std::to_string(i)).append(" = 1\n");
  CHECK_THROWS_WITH(document(keys), Catch::Contains("a.toml:50001: must have at most 50000 keys"));
  CHECK_THROWS_WITH(document("a = 1\nb = [" + std::string(1'100'000, ',') + "]\n"),
                    Catch::Contains("at most 1000000 elements"));
}

TEST_CASE("a hundred problems are reported and the rest is counted", "[config][toml]") {
  std::string text;
  for (int i = 0; i < 400; ++i) {
    text.append("unknown_").append(std::to_string(i)).append(" = 1\n");
  }
  const TomlDocument read = document(text);
  CHECK(!read.root().has("known"));
  const auto lines = problem_texts(read);
  REQUIRE(lines.size() == 101);
  CHECK(lines.front().starts_with("a.toml:1: unknown_0 = 1"));
  CHECK(lines.back() == "a.toml: and 300 more problems");
}

TEST_CASE("names with control codes are refused, and never printed as they are", "[config][toml]") {
  const std::string odd = GENERATE(as<std::string>(), "\\u001b[2J", "\xE2\x80\xAE", "\\u2066",
                                   "\\u0085", "\\u200b", "\\uFEFF");
  const TomlDocument read =
      document("a = \"x" + odd + "\"\nb = [\"y" + odd + "\"]\n\"k" + odd + "\" = 1\n");
  CHECK(read.root().text("a").empty());
  CHECK(read.root().texts("b") == std::vector<std::string>{""});
  const auto lines = problem_texts(read);
  CHECK(lines.size() == 3);
  CHECK_THAT(lines.front(), Catch::Contains("a = ") && Catch::Contains("must be printable"));
  for (const std::string& line : lines) CHECK(is_printable(line));
}

TEST_CASE("a very long key does not make the error very long", "[config][toml]") {
  const TomlDocument read = document(std::string(100'000, 'k') + " = 1\n");
  CHECK(!read.root().has("known"));
  const auto lines = problem_texts(read);
  REQUIRE(lines.size() == 1);
  CHECK(lines.front().size() < 2000);
}
