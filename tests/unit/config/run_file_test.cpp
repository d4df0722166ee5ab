#include "config/runs/run_file.hpp"

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "config/runs/model_inputs.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

const std::string good_run =
    "# measured on a Monday\n"
    "time_s,t1_degC,z_um,coolant_on\n"
    "0,20.5,0,0\n"
    "# a comment between rows\n"
    "15,,1.25,1\n"
    "31.5,nan,-2e-3,1\n";

RunFile parsed(const std::string& text) {
  return parse_run(text, "run.csv");
}

struct BadRun {
  std::string what;
  std::string text;
  int line;
  std::string key;
  std::string rule;
};

}  // namespace

TEST_CASE("a room temperature is recognised by the beginning of a word", "[runs]") {
  for (const char* name :
       {"room_degC", "t_room_degC", "Raumluft_degC", "ambient2_degC", "roomtemp"})
    CHECK(is_called_like_a_room(name));
  for (const char* name : {"spindle_pair_degC", "shallow_bore_degC", "column_degC"})
    CHECK_FALSE(is_called_like_a_room(name));
}

TEST_CASE("a run file is read column by column", "[config][run]") {
  const RunFile run = parsed(good_run);
  CHECK(run.columns == std::vector<std::string>{"time_s", "t1_degC", "z_um", "coolant_on"});
  CHECK(run.rows() == 3);
  CHECK(run.time_s() == std::vector<double>{0, 15, 31.5});
  CHECK(run.column("z_um") == std::vector<double>{0, 1.25, -2e-3});
  CHECK(run.column("t1_degC")[0] == 20.5);
  CHECK(std::isnan(run.column("t1_degC")[1]));
  CHECK(std::isnan(run.column("t1_degC")[2]));
  CHECK(run.find("t2_degC") == std::nullopt);
  CHECK(run.selected_begin == 0);
  CHECK(run.selected_end == 3);
}

TEST_CASE("line ends, byte order mark, blanks and empty last lines do not matter",
          "[config][run]") {
  const RunFile run = parsed("\xEF\xBB\xBFtime_s, z_um\r\n0, +1\r\n 1 ,NaN\r\n\r\n\n");
  CHECK(run.columns[1] == "z_um");
  CHECK(run.rows() == 2);
  CHECK(run.column("z_um")[0] == 1.0);
  CHECK(parsed("time_s\n0\n1").rows() == 2);
}

TEST_CASE("each invalid run file is refused with file, line, column and rule", "[config][run]") {
  const std::vector<BadRun> table = {
      {"nothing", "", 0, "", "no header"},
      {"comments only", "# a\n# b\n", 0, "", "no header"},
      {"header only", "time_s,a\n", 0, "", "no row"},
      {"no time", "t1_degC,z_um\n1,2\n", 1, "time_s", "must be one of the columns"},
      {"no header", "0,1\n1,2\n", 1, "names", "has no header"},
      {"column twice", "time_s,a,a\n0,1,2\n", 1, "column 3", "twice"},
      {"column without a name", "time_s,,a\n0,1,2\n", 1, "column 2", "name"},
      {"quoted header", "time_s,\"a\"\n0,1\n", 1, "column 2", "quoted"},
      {"bar in a name", "time_s,a|b\n0,1\n", 1, "column 2", "name"},
      {"too few fields", "time_s,a\n0\n", 2, "", "must have 2"},
      {"too many fields", "time_s,a\n0,1,2\n", 2, "", "must have 2"},
      {"empty line between rows", "time_s,a\n0,1\n\n1,2\n", 3, "", "must have 2"},
      {"a word", "time_s,a\n0,hot\n", 2, "a", "finite number"},
      {"decimal comma's remains", "time_s,a\n0,1;5\n", 2, "a", "finite number"},
      {"quoted number", "time_s,a\n0,\"1\"\n", 2, "a", "quoted"},
      {"infinite", "time_s,a\n0,inf\n", 2, "a", "finite number"},
      {"too large for a double", "time_s,a\n0,1e999\n", 2, "a", "finite number"},
      {"time missing", "time_s,a\n0,1\n,2\n", 3, "time_s", "must not be missing"},
      {"time not a number", "time_s,a\n0,1\nsoon,2\n", 3, "time_s", "finite number"},
      {"time stands still", "time_s,a\n0,1\n0,2\n", 3, "time_s", "greater than"},
      {"time runs backwards", "time_s,a\n5,1\n4,2\n", 3, "time_s", "before (5)"},
      {"backwards past a comment", "time_s,a\n5,1\n#\n4,2\n", 4, "time_s", "greater than"},
  };
  for (const BadRun& bad : table) {
    const auto problems = problems_of([&] { return parsed(bad.text); });
    INFO(bad.what);
    REQUIRE(problems.size() == 1);
    INFO(to_string(problems.front()));
    CHECK(problems.front().file == "run.csv");
    CHECK(problems.front().line == bad.line);
    CHECK(problems.front().key == bad.key);
    CHECK_THAT(problems.front().rule, Catch::Contains(bad.rule));
  }
}

TEST_CASE("several problems of a run file are reported at once, up to a limit", "[config][run]") {
  CHECK(problems_of([] { return parsed("time_s,a,b\n0,x,y\n0,1\n-1,2,3\n"); }).size() == 4);
  std::string text = "time_s,a\n";
  for (int i = 0; i < 1000; ++i) text += std::to_string(i) + ",x\n";
  CHECK(problems_of([&] { return parsed(text); }).size() == 100);
}

TEST_CASE("writing then reading a run preserves every bit", "[config][run]") {
  RunFile run;
  run.columns = {"time_s", "a"};
  run.values = {{0.1, 1.0 / 3.0, 1e9}, {-0.0, std::nan(""), 5e-324}};
  const RunFile back = parsed(write_run(run));
  CHECK(back.columns == run.columns);
  CHECK(back.values[0] == run.values[0]);
  CHECK(std::signbit(back.values[1][0]));
  CHECK(std::isnan(back.values[1][1]));
  CHECK(back.values[1][2] == 5e-324);
  CHECK(write_run(back) == write_run(run));
}

TEST_CASE("a number in any form is read as the nearest double", "[config][run]") {
  for (const char* text : {"0", "-0", "7", "007", "5.", ".5", "-.5", "+2.", "1e22", "-2.5E-3",
                           "1e-30", "0.1", "2.30", "1.0e0", "9007199254740993", "12345678.12345678",
                           "0.0000000000000001", "179769313486231570000000000000000000000"}) {
    INFO(text);
    const double value = parsed(std::string("time_s,z_um\n0,") + text).column("z_um")[0];
    CHECK(std::bit_cast<std::uint64_t>(value) ==
          std::bit_cast<std::uint64_t>(std::strtod(text, nullptr)));
  }
}

TEST_CASE("a field that only begins with a number is refused", "[config][run]") {
  for (const char* text : {"-", "1-", "1.2.3", "1.5x", "12 3", "1,", "--1", "+-1", "1.e", "0x10"}) {
    INFO(text);
    CHECK_THROWS_AS(parsed(std::string("time_s,z_um\n0,").append(text).append("\n")),
                    ConfigurationError);
  }
}

TEST_CASE("a selection is a half-open interval of time, and the run stays whole", "[config][run]") {
  const auto selected = [](const std::string& argument) {
    const RunFile run = parse_run(good_run, "run.csv", parse_selection(argument));
    CHECK(run.rows() == 3);
    const RunFile again = parse_run(good_run, "run.csv", parse_selection(selected_name(run)));
    CHECK(again.selected_begin == run.selected_begin);
    CHECK(again.selected_end == run.selected_end);
    return std::pair(run.selected_begin, run.selected_end);
  };
  CHECK(selected("run.csv") == std::pair<std::size_t, std::size_t>(0, 3));
  CHECK(selected("run.csv@:") == std::pair<std::size_t, std::size_t>(0, 3));
  CHECK(selected("run.csv@15:31.5") == std::pair<std::size_t, std::size_t>(1, 2));
  CHECK(selected("run.csv@15.1:") == std::pair<std::size_t, std::size_t>(2, 3));
  CHECK(selected("run.csv@:15") == std::pair<std::size_t, std::size_t>(0, 1));
  CHECK(selected("run.csv@-5:1e9") == std::pair<std::size_t, std::size_t>(0, 3));
}

TEST_CASE("an export is cut at its references into runs whose names select them", "[config][run]") {
  const std::string text =
      "time_s,z_um\n0,1\n10,2\n# 12.000 s: command reference\n20,0\n30,1\n"
      "# 31.000 s: command reference\n# 32.000 s: command reference\n40,0\n";
  const auto parts_of = [&](const std::string& argument) {
    return between_references(parse_run(text, "run.csv", parse_selection(argument)));
  };
  const std::vector<RunFile> parts = parts_of("run.csv");
  REQUIRE(parts.size() == 3);
  CHECK(parts[0].name == "run.csv@:20");
  CHECK(parts[1].name == "run.csv@20:40");
  CHECK(parts[1].column("z_um") == std::vector<double>{0, 1});
  CHECK(selected_name(parts[1]) == "run.csv@20:40");
  CHECK(parts[2].name == "run.csv@40:");
  for (const RunFile& part : parts) {
    CHECK(part.references.empty());
    const std::vector<RunFile> again = parts_of(part.name);
    REQUIRE(again.size() == 1);
    CHECK(again[0].values == part.values);
  }
  const std::vector<RunFile> late = parts_of("run.csv@25:");
  REQUIRE(late.size() == 2);
  CHECK(late[0].selected_begin == 1);
  CHECK(late[0].rows() == 2);
  CHECK(selected_name(late[0]) == "run.csv@30:40");
  CHECK(between_references(parse_run(good_run, "run.csv")).size() == 1);
}

TEST_CASE("the file's name may contain an @", "[config][run]") {
  CHECK(parse_selection("a@b.csv").file == "a@b.csv");
  CHECK(parse_selection("a@b.csv@1:2").file == "a@b.csv");
  CHECK(parse_selection("c:/runs/a@b.csv").file == "c:/runs/a@b.csv");
}

TEST_CASE("invalid selections are refused", "[config][run]") {
  for (const char* argument : {"", "run.csv@x:", "run.csv@1:y", "run.csv@5:5", "run.csv@6:5",
                               "run.csv@nan:5", "run.csv@0:inf", "@1:2"}) {
    INFO(argument);
    CHECK(problems_of([&] { return parse_selection(argument); }).size() == 1);
  }
  const auto problems = problems_of(
      [] { return parse_run(good_run, "run.csv", parse_selection("run.csv@100:200")); });
  REQUIRE(problems.size() == 1);
  CHECK_THAT(problems.front().rule, Catch::Contains("selects no row"));
}

TEST_CASE("a missing column is named with its file", "[config][run]") {
  const RunFile run = parsed(good_run);
  const auto problems = problems_of([&] { return run.column("t9_degC"); });
  REQUIRE(problems.size() == 1);
  CHECK(problems.front().file == "run.csv");
  CHECK(problems.front().key == "t9_degC");
}

TEST_CASE("a row or a header of many columns is refused with the first 100 problems",
          "[run_file]") {
  std::string header = "time_s";
  std::string row = "0";
  for (int i = 0; i < 1000; ++i) {
    header.append(",c").append(std::to_string(i));
    row += ",x";
  }
  const auto of_row = problems_of([&] { return parse_run(header + "\n" + row + "\n", "run.csv"); });
  CHECK(of_row.size() == 100);
  const std::string commas(1000, ',');
  const auto of_header = problems_of([&] { return parse_run("time_s" + commas + "\n0\n", "r"); });
  CHECK(of_header.size() == 100);
}

TEST_CASE("more than 1024 columns are refused at once", "[run_file]") {
  std::string text = "time_s";
  text.append(1'000'000, ',').append("\n0\n");
  const auto problems = problems_of([&] { return parse_run(text, "run.csv"); });
  REQUIRE(problems.size() == 1);
  CHECK(to_string(problems.front()) == "run.csv:1: 1000001 columns: must be at most 1024");
}
