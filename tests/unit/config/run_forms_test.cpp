// Run files of other programs: how they are read, and which ambiguities are reported.
#include <cmath>

#include "config/run_forms/column_map.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/runs/run_file.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

using Lines = std::vector<std::string>;

struct Form {
  std::string what;
  std::string text;
  std::string map;
  std::vector<std::string> columns;
  std::vector<double> last_row;
  Lines understood;
};

RunFile read(const std::string& text, const std::string& map = "") {
  if (map.empty()) return parse_run(text, "run.csv");
  const ColumnMap parsed = parse_column_map(map, "map.toml");
  return parse_run(text, "run.csv", {}, &parsed);
}

const std::vector<Form> forms = {
    {"spreadsheet of a German computer",
     "\xEF\xBB\xBFZeit;T1 [°C];T2 [°C];z (µm)\r\n2026-03-01T08:30:00;20,51;21;0\r\n"
     "2026-03-01T08:30:15;20,6;;1,25\r\n;;;\r\n\r\n",
     "",
     {"time_s", "T1_degC", "T2_degC", "z_um"},
     {15, 20.6, NAN, 1.25},
     {"separator ';', decimal comma",
      "time_s: 'Zeit', year-month-day, seconds after the first row (2026-03-01 08:30:00)",
      "'T1 [°C]' is T1_degC", "'T2 [°C]' is T2_degC", "'z (µm)' is z_um"}},
    {"tabs and Latin-1",
     "Time [min]\tTemp \xB0"
     "C\tz [\xB5m]\n0\t20.5\t0.25\n0.5\t20.6\t1.5\n",
     "",
     {"time_s", "Temp_degC", "z_um"},
     {30, 20.6, 1.5},
     {"separator 'tab', decimal point, letters Latin-1",
      "time_s: 'Time [min]', numbers [min], times 60", "'Temp °C' is Temp_degC",
      "'z [µm]' is z_um"}},
    {"days of a spreadsheet, and a position in mm",
     "Date,T1 [C],z (mm)\n45992.5,20.5,0.001\n45992.50017361,20.6,0.0125\n",
     "",
     {"time_s", "T1_degC", "z_mm"},
     {14.999904, 20.6, 0.0125},
     {"separator ',', decimal point",
      "time_s: 'Date', numbers [day], seconds after the first row (45992.5)", "'T1 [C]' is T1_degC",
      "'z (mm)' is z_mm, a position (a displacement: write \"z (mm)\" = \"z_um\" under [columns] "
      "in "
      "the file of --columns)"}},
    {"date and clock apart",
     "Datum;Uhrzeit;Bett [°F];Drehzahl [U/min]\n31.03.2026;23:59:50;68,0;0\n01.04.2026;00:00:05;"
     "69,8;1500\n",
     "",
     {"time_s", "Bett_degC", "Drehzahl_rpm"},
     {15, 21, 1500},
     {"separator ';', decimal comma",
      "time_s: 'Datum' and 'Uhrzeit', day.month.year, seconds after the first row (2026-03-31 "
      "23:59:50)",
      "'Bett [°F]' is Bett_degC, times 0.5555555555555556, plus -17.77777777777778",
      "'Drehzahl [U/min]' is Drehzahl_rpm"}},
    {"a clock alone, over midnight",
     "time;T1 °C\n23:59:45;20.5\n00:00:00;20.6\n00:00:15;20.7\n",
     "",
     {"time_s", "T1_degC"},
     {30, 20.7},
     {"separator ';', decimal point",
      "time_s: 'time', time of the clock, seconds after the first row (23:59:45)",
      "'T1 °C' is T1_degC"}},
    {"American dates that tell themselves, afternoons",
     "DateTime,t1_degC,I / A\n3/14/2026 11:59:30 AM,20.5,1\n3/14/2026 12:00:30 PM,20.75,2.5\n",
     "",
     {"time_s", "t1_degC", "I_A"},
     {60, 20.75, 2.5},
     {"separator ',', decimal point",
      "time_s: 'DateTime', month/day/year, seconds after the first row (2026-03-14 11:59:30)",
      "'t1_degC' is t1_degC", "'I / A' is I_A"}},
    {"units in a row of their own",
     "t;T1;z;n\ns;°C;µm;rpm\n0;20,5;0;0\n0,5;20,6;-1,5;100\n",
     "time = \"t\"",
     {"time_s", "T1_degC", "z_um", "n_rpm"},
     {0.5, 20.6, -1.5, 100},
     {"separator ';', decimal comma, units in a row of their own", "time_s: 't', numbers [s]",
      "'T1' is T1_degC", "'z' is z_um", "'n' is n_rpm"}},
    {"a map says what the file does not",
     "Time;T1;z (mm);Status\n0;1,234;1;ok\n1;2,345;0,002;ok\n",
     "decimal = \",\"\ntime_unit = \"min\"\nignore = [\"Status\"]\n[columns]\n\"T1\" = "
     "\"t1_degC\"\n"
     "\"z (mm)\" = \"z_um\"\n",
     {"time_s", "t1_degC", "z_um"},
     {60, 2.345, 2},
     {"separator ';', decimal comma", "time_s: 'Time', numbers [min], times 60", "'T1' is t1_degC",
      "'z (mm)' is z_um, times 1000", "'Status' left out"}},
    {"thousands that a map tells of",
     "time_s;n [rpm];T1 [°C]\n0;1.500;20,5\n1;12.000,5;20,6\n",
     "thousands = \".\"",
     {"time_s", "n_rpm", "T1_degC"},
     {1, 12000.5, 20.6},
     {"separator ';', decimal comma, thousands '.'", "time_s: 'time_s', numbers [s]",
      "'n [rpm]' is n_rpm", "'T1 [°C]' is T1_degC"}},
    {"our own names between semicolons",
     "# from the cell\ntime_s;t1_degC;coolant_on\n0;20.5;0\n# shift\n10;NA;on\n",
     "",
     {"time_s", "t1_degC", "coolant_on"},
     {10, NAN, 1},
     {"separator ';', decimal point", "time_s: 'time_s', numbers [s]", "'t1_degC' is t1_degC",
      "'coolant_on' is coolant_on", "missing: 1 fields like 'NA'"}},
    {"quotes, zones, a separator at the end",
     "sep=,\n\"Timestamp\",\"T, top [°C]\",\n2026-03-29T00:59:00Z,\"20,5\",\n"
     "2026-03-29T01:01:00Z,\"20,6\",\n",
     "",
     {"time_s", "T__top_degC"},
     {120, 20.6},
     {"separator ',', decimal comma",
      "time_s: 'Timestamp', year-month-day, seconds after the first row (2026-03-29 00:59:00 UTC)",
      "'T, top [°C]' is T__top_degC"}},
    {"kilowatts, hours, and a logger's lines in front",
     "Logger 4711\nfirmware;2\nt [h];P [kW];T1 [K]\n0;0,5;293,15\n0,5;1,25;294,15\n",
     "header_line = 3\n[columns]\n\"T1 [K]\" = \"t1_degC\"\n",
     {"time_s", "P_W", "t1_degC"},
     {1800, 1250, 21},
     {"separator ';', decimal comma", "time_s: 't [h]', numbers [h], times 3600",
      "'P [kW]' is P_W, times 1000", "'T1 [K]' is t1_degC, plus -273.15"}},
};

struct Unclear {
  std::string what;
  std::string text;
  int line;
  std::string to_write;
};

}  // namespace

TEST_CASE("files of other programs are read, and their interpretation is reported line by line",
          "[config][run]") {
  for (const Form& form : forms) {
    INFO(form.what);
    const RunFile run = read(form.text, form.map);
    CHECK(run.columns == form.columns);
    CHECK(run.understood == form.understood);
    REQUIRE(run.values.size() == form.last_row.size());
    for (std::size_t i = 0; i < run.values.size(); ++i) {
      INFO(run.columns[i]);
      const double value = run.values[i].back();
      if (std::isnan(form.last_row[i]))
        CHECK(std::isnan(value));
      else
        CHECK(value == Approx(form.last_row[i]).epsilon(1e-12));
    }
  }
}

TEST_CASE("a column in degF is converted in a file of our own form too", "[config][run]") {
  const RunFile run = parse_run("time_s,t1_degF,z_um\n0,68,0\n10,86,1\n", "run.csv");
  CHECK(run.column("t1_degC")[0] == Approx(20.0));
  CHECK(run.column("t1_degC")[1] == Approx(30.0));
  CHECK_FALSE(run.understood.empty());
}

TEST_CASE("our own form is read without a report", "[config][run]") {
  const std::string own = "time_s,t1_degC,z_um,door\n0,20.5,1,0\n";
  CHECK(read(own).understood.empty());
  CHECK(read(own, "[columns]\n\"T1\" = \"t1_degC\"\n").understood.empty());
  for (const Form& form : forms) {
    const RunFile run = read(form.text, form.map);
    const RunFile again = read(write_run(run));
    INFO(form.what);
    CHECK(again.understood.empty());
    CHECK(again.columns == run.columns);
    CHECK(again.time_s() == run.time_s());
  }
}

TEST_CASE("an ambiguity is reported with the line to write", "[config][run]") {
  const std::vector<Unclear> table = {
      {"no unit", "time_s;T1\n0;20,5\n", 1, "\"T1\" = \"T1_degC\""},
      {"an unknown unit", "time_s;p [bar]\n0;20,5\n", 1, "\"p [bar]\" = \"p_bar\""},
      {"decimal or thousands", "time_s;z [um]\n0;1,234\n", 2,
       "decimal = \",\" or thousands = \",\""},
      {"point or thousands", "time_s;z [um]\n0;1.234\n", 2, "decimal = \".\" or thousands = \".\""},
      {"thousands", "time_s;z [um];T [C]\n0;1.234,5;20.5\n", 2, "one decimal sign"},
      {"both signs", "time_s;z [um]\n0;1,25\n1;1.5\n", 2, "one decimal sign"},
      {"a group among commas", "time_s;z [um]\n0;1,25\n1;1.500\n", 3, "thousands = \".\""},
      {"day or month", "Time;z [um]\n03/04/2026 08:00:00;1\n04/05/2026 08:00:00;2\n", 2,
       "date_order = \"day.month.year\" or \"month.day.year\""},
      {"time without unit", "Time;z [um]\n0;1\n15;2\n", 1, "time_unit = \"s\""},
      {"hours or minutes", "Time;z [um]\n08:30;1\n08:31;2\n", 2,
       "time_unit = \"hh:mm\" or \"mm:ss\""},
      {"two times", "Time [s];t [h];z [um]\n0;0;1\n", 1,
       "time = \"Time [s]\" and ignore = [\"t [h]\"]"},
      {"no time", "n [rpm];z [um]\n0;1\n", 1, "time = \"its name\""},
      {"a column of words", "time_s;z [um];note [-]\n0;1;cold\n", 2, "ignore = [\"note [-]\"]"},
      {"words", "time_s;z [um]\n0;1\n1;cold\n2;warm\n", 3, "missing = [\"cold\", \"warm\"]"},
      {"no table", "one line\nand another\n", 1, "is not a known table"},
      {"XML", "<?xml version=\"1.0\"?>\n<a/>\n", 1, "is XML"},
      {"an archive", "\x1F\x8B rest", 0, "gunzip"},
  };
  for (const Unclear& unclear : table) {
    INFO(unclear.what);
    const auto problems = problems_of([&] { return read(unclear.text); });
    REQUIRE(problems.size() == 1);
    INFO(to_string(problems.front()));
    CHECK(problems.front().file == "run.csv");
    CHECK(problems.front().line == unclear.line);
    CHECK_THAT(problems.front().rule, Catch::Contains(unclear.to_write));
  }
}

TEST_CASE("faults in a file of another form are reported with their line", "[config][run]") {
  const std::vector<Unclear> table = {
      {"too few fields", "time_s;z [um]\n0;1\n1\n", 3, "must have 2"},
      {"open quote", "time_s;z [um]\n0;\"1\n", 2, "quote"},
      {"a day there is not", "Time;z [um]\n2026-02-28 08:00;1\n2026-02-30 08:00;2\n", 3,
       "calendar"},
      {"another form of time", "Time;z [um]\n2026-02-28 08:00;1\n8:15;2\n", 2, "must be a time"},
      {"a time twice", "Time;z [um]\n08:00:00;1\n08:01:00;2\n08:01:00;3\n", 4,
       "(08:01:00): delete one of the two lines"},
      {"a count of values under the header", "a;t [s];z [um]\nlength;3;3\n;0;1\n;1;1\n;2;1\n", 3,
       "(3): delete line 2 if it belongs to the header"},
      {"a sum in the last line", "Time;z [um]\n08:00:00;1\n08:01:00;2\nsum;3,5\n", 4,
       "delete the line if it is no measurement"},
      {"no header and no unit", "2026-02-28 08:00;4\n2026-02-28 08:01;5\n", 0, "has no unit"},
      {"nothing but a time", "Zeit;Note\n2026-02-28 08:00;cold\n", 0, "no column of numbers"},
      {"no row", "Time [s];z [um]\n", 0, "no row"},
  };
  for (const Unclear& fault : table) {
    INFO(fault.what);
    const auto problems = problems_of([&] { return read(fault.text); });
    REQUIRE(!problems.empty());
    INFO(to_string(problems.front()));
    CHECK_THAT(problems.back().rule, Catch::Contains(fault.to_write));
  }
}

TEST_CASE("a map is read strictly", "[config][run]") {
  for (const char* map :
       {"decimals = \",\"", "separator = \"x\"", "thousands = \",\"\ndecimal = \",\"",
        "time = [\"a\", \"b\", \"c\"]", "[columns]\nT1 = \"a,b\"", "[columns]\nT1 = \"time_s\"",
        "[columns]\nT1 = { name = \"t1_degC\", unit = \"stone\" }", "header_line = 0"}) {
    INFO(map);
    CHECK(problems_of([&] { return parse_column_map(map, "map.toml"); }).size() == 1);
  }
  const std::string text = "Time [s];T1 [°C]\n0;20,5\n";
  for (const char* map : {"[columns]\nT2 = \"t2_degC\"", "ignore = [\"T3\"]", "time = \"t\"",
                          "[columns]\n\"T1 [°C]\" = \"z_um\""}) {
    INFO(map);
    const auto problems = problems_of([&] { return read(text, map); });
    REQUIRE(!problems.empty());
    CHECK(problems.front().file == "map.toml");
  }
}

TEST_CASE("a map may have a format, like every other file", "[config][run]") {
  CHECK(parse_column_map("format = 1\nignore = [\"x\"]", "map.toml").ignored ==
        std::vector<std::string>{"x"});
  CHECK(problems_of([] { return parse_column_map("format = 2", "map.toml"); }).size() == 1);
}

TEST_CASE("a missing displacement is reported with a remedy", "[config][run]") {
  const auto rule_of = [](const std::string& more) {
    const auto problems = problems_of(
        [&] { return read("time_s,bed_degC,z_offset_um" + more + "\n0,20,1,2\n").column("z_um"); });
    REQUIRE(problems.size() == 1);
    return problems.front().rule;
  };
  CHECK_THAT(rule_of(",z_applied_um"), Catch::Contains("thermocomp measured"));
  CHECK_THAT(rule_of(",x_um"), !Catch::Contains("thermocomp measured"));
}

TEST_CASE("a map with a missing unit is reported with the full name", "[config][run]") {
  const auto problems = problems_of([&] {
    return read("Time [s];Temp. t1 [°C];Temp. t7 [°C]\n0;20,5;21\n",
                "[columns]\n\"Temp. t7\" = \"t7_degC\"");
  });
  REQUIRE(!problems.empty());
  CHECK_THAT(problems.front().rule, Catch::Contains("'Temp. t7 [°C]' is"));
}

TEST_CASE("a requested displacement that exists in mm is reported", "[config][run]") {
  const RunFile run = read("Time [s];z (mm)\n0;0,5\n");
  const auto problems = problems_of([&] { return run.column("z_um"); });
  REQUIRE(problems.size() == 1);
  CHECK_THAT(problems.front().rule, Catch::Contains("z_mm") && Catch::Contains("--columns"));
}

TEST_CASE("the commented example of a map loads and works", "[config][run]") {
  const ColumnMap map =
      load_column_map(std::filesystem::path(THERMOCOMP_EXAMPLES) / "columns.toml");
  const RunFile run = parse_run(
      "Datum;Uhrzeit;T1;Tür;z (mm);Leistung;Bemerkung\n03/04/2026;08:00:00;1,234;0;0,001;1,5;-\n"
      "03/04/2026;08:00:30;1,235;1;0,002;2;kalt\n",
      "run.csv", {}, &map);
  CHECK(run.columns == Lines{"time_s", "t1_degC", "door_on", "z_um", "spindle_W"});
  CHECK(run.time_s() == std::vector<double>{0, 30});
  CHECK(run.column("z_um")[1] == Approx(2.0));
  CHECK(run.column("spindle_W")[1] == 2000.0);
}
