// Logs that were once misread without a word: each is now read right, or refused.
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "cli/import/import_runs.hpp"
#include "config/run_forms/column_map.hpp"
#include "config/runs/run_file.hpp"
#include "config/text/problems.hpp"

namespace {

using namespace thermocomp;
using namespace thermocomp::cli;

struct MisreadLog {
  std::string what;
  std::string text;
  std::string answer;  ///< the run that import writes, or a part of the message
  std::string map{};
};

std::string answer_to(const MisreadLog& log) {
  ColumnMap map = parse_column_map(log.map, "map.toml");
  map.takes_signals = true;
  try {
    return write_run(parse_run(log.text, "log", {}, &map));
  } catch (const ConfigurationError& error) {
    return error.what();
  }
}

void check_all(const std::vector<MisreadLog>& logs) {
  for (const MisreadLog& log : logs) {
    INFO(log.what);
    CHECK_THAT(answer_to(log), Catch::Matchers::Contains(log.answer));
  }
}

}  // namespace

TEST_CASE("named values keep their decimals, units and names", "[import]") {
  check_all({
      {"decimal comma", "08:00:00 T1=20,5 z=-0,5\n08:00:10 T1=20,6 z=-0,25\n",
       "time_s,T1,z\n0,20.5,-0.5\n10,20.6,-0.25\n"},
      {"units", "08:00:00 Bed: 20,5 °C; Gap: 1,5um load=20% n = 3\n08:00:10 Bed: 21,5 °C\n",
       "time_s,Bed_degC,Gap_um,load_percent,n\n0,20.5,1.5,20,3\n10,21.5,,,\n"},
      {"thousands", "08:00:00 n=1,500 T=20.5\n08:00:10 n=2,500 T=20.5\n",
       "log:1: 1,500: may have a group of thousands"},
      {"hyphens, umlauts, quotes", "08:00:00 bed-T=20.5 T_Öl=21.5 {\"head\": 22.5}\n",
       "time_s,bed-T,T_Öl,head\n0,20.5,21.5,22.5\n"},
      {"names of two words", "08:00:00 Bed temp: 20.5, Head temp: 25.5\n",
       "log:1: temp = 25.5: must be there once at a time"},
      {"a target below zero", "08:00:00 T:20.5/-1 n:1\n08:00:10 T:20.6/-1 n:1\n",
       "time_s,T,n\n0,20.5,1\n10,20.6,1\n"},
      {"two polls in a second", "08:00:00 T=20.5\n08:00:00 T=20.6\n08:00:01 T=20.7\n",
       "log:2: T = 20.6: must be there once at a time"},
      {"a word among numbers", "start\n08:00:00 T=20.5\n\n08:00:10 T=lost\n08:00:20 T=21\n",
       "log:4: T = lost: must be a number"},
  });
}

TEST_CASE("a header has a name for each field, or is refused", "[import]") {
  check_all({
      {"an empty column between blanks", "t[s] BED[degC] HEAD[degC] GAP[um]\n0 20 0.0\n10 21 0.5\n",
       "log:1: 4 names: must be one for each of the 3 fields"},
      {"its names are given", "t[s] BED[degC] HEAD[degC] GAP[um]\n0 20 0.0\n10 21 0.5\n",
       "time_s,t_degC,z_um\n0,20,0\n10,21,0.5\n", "names = [\"time_s\", \"t_degC\", \"z_um\"]"},
      {"only the first row is full", "t[s] T1[C] z[um]\n0 20 0.0\n1 0.5\n2 1.0\n3 1.5\n",
       "log:2: 3 fields: must have 2"},
      {"the same with tabs", "t[s]\tT1[C]\tT2[C]\n0\t20\t21\n1\t20\n2\t21\n3\t21\n",
       "log:2: 3 fields: must have 2"},
      {"rows one shorter", "No,Time [s],T1 [C],T2 [C]\n0,20.5,30.1\n10,20.6,30.0\n",
       "log:1: 4 names: must be one for each of the 3 fields"},
      {"rows with a checksum", "Time [s],T1 [C],z [um]\n0,20.5,1,165\n10,20.6,2,17\n",
       "log:1: 3 names: must be one for each of the 4 fields"},
      {"rows with a number", "Time [s],t1 [C]\n1,0,20.5\n2,10,20.6\n",
       "time_s,t1_degC\n0,20.5\n10,20.6\n"},
      {"quoted parts of a name", "t [s],\"AI\".Bed [C],\"Axis Z\".Pos [mm]\n0,20.5,1\n1,20.6,2\n",
       "time_s,_AI_.Bed_degC,_Axis_Z_.Pos_mm\n0,20.5,1\n1,20.6,2\n"},
      {"names of an index above", "    bed_degC  z_um\ntime\n2026-02-01 08:00:00 20.5 0.0\n",
       "log:2: 1 names: must be one for each of the 4 fields"},
  });
}

TEST_CASE(
    "the header is the lowest line above the rows that names the time or a unit, else of words",
    "[import]") {
  check_all({
      {"statistics above it",
       "\"testo\";\"Nr. 4\";\n\"Start:\";\"01.02.2026 08:00:00\";\n\"Mean:\";\"20,55\";\"21,05\"\n"
       ";\"T1 [°C]\";\"T2 [°C]\"\n\"01.02.2026 08:00:00\";20,4;20,9\n\"01.02.2026 "
       "08:05:00\";20,5;21,0\n",
       "time_s,T1_degC,T2_degC\n0,20.4,20.9\n300,20.5,21\n"},
      {"a title of words above it",
       "Operator,MK,Shift 2\n,Bed [°C],Bed [°C]\n2026-02-13 08:00:00,20.1,20.9\n"
       "2026-02-13 08:01:00,20.2,21.0\n",
       "time_s,Bed_degC,Bed_2_degC\n0,20.1,20.9\n60,20.2,21\n"},
      {"a title that names a date above it",
       "Date;Report\nStamp;T1 [C]\n2026-02-01 08:00:00;20\n2026-02-01 08:00:10;21\n",
       "time_s,T1_degC\n0,20\n10,21\n"},
      {"serial numbers above it", "Serial,A123,B345\nTime [s],T [°C],T [°C]\n0,20,21\n10,20,22\n",
       "time_s,T_degC,T_2_degC\n0,20,21\n10,20,22\n"},
      {"units and limits below it",
       "Time,T1,T2\nUnit,°C,°F\nMax,100,212\nMin,0,32\n13.02.2026 08:00:00,20.5,69.8\n"
       "13.02.2026 08:00:10,20.6,68\n",
       "time_s,T1_degC,T2_degC\n0,20.5,21\n10,20.6,20\n"},
      {"channel numbers below it", "Time [s],T1 [°C],T2 [°C]\n,1,2\n0,20.5,21\n10,20.6,22\n",
       "time_s,T1_degC,T2_degC\n0,20.5,21\n"},
      {"rows of missing values below it",
       "Time [s],T1 [°C],T2 [°C]\n0,,\n10,OL,\n20,20.5,21\n30,20.6,22\n40,20.6,22\n",
       "time_s,T1_degC,T2_degC\n0,,\n10,,\n20,20.5,21\n"},
      {"a missing first column", "T1 [°C],z [µm]\n,0\n,0.5\n20.5,1\n20.6,1.5\n20.7,2\n",
       "time_s,T1_degC,z_um\n0,,0\n10,,0.5\n20,20.5,1\n", "period_s = 10"},
      {"no name of the time", ",bed_degC\n2026-02-13 08:00:00,20\n2026-02-13 08:00:10,21\n",
       "time_s,bed_degC\n0,20\n10,21\n"},
      {"a name that is a number", ",0\n2026-02-13 08:00:00,20\n2026-02-13 08:00:10,21\n",
       "log:1: ,0: is neither a row like those below"},
      {"the same, said to be one", ",0\n2026-02-13 08:00:00,20\n2026-02-13 08:00:10,21\n",
       "time_s,0\n0,20\n10,21\n", "header_line = 1"},
      {"names of groups, names, and the index below",
       ",bed,head\n,mean,max\ntime,,\n2026-02-13 08:00:00,20,21\n2026-02-13 08:00:10,22,23\n",
       "time_s,mean,max\n0,20,21\n"},
      {"clock times that are none", "Time,T1 [°C]\n-00:00:05,20\n00:00:00,21\n00:00:05,21\n",
       "log:2: -00:00:05,20: is neither a row like those below"},
      {"factors below the units", "Time,T1,T2\ns,°C,°C\n1,0.1,0.1\n10,205,210\n20,206,220\n",
       "log:3: 1,0.1,0.1: is neither a row like those below"},
      {"factors with a word", "Time,T1\ns,°C\nFactor,0.1\n10,205\n20,206\n",
       "log:3: Factor,0.1: is neither a row like those below"},
  });
}

TEST_CASE("a unit that is not known, or changes, does not reach a column of another", "[import]") {
  check_all({
      {"a changing unit of a series",
       "Time,Tag,Value,Unit\n2026-02-01 08:00:00,Bed,20,°C\n2026-02-01 08:01:00,Bed,69.8,°F\n",
       "time_s,Bed_degC\n0,20\n60,21\n"},
      {"thousandths of an inch", "Time [s],z (mil)\n0,1\n1,2\n", "time_s,z_um\n0,25.4\n1,50.8\n"},
      {"a multiple of a unit", "Time [s],T1 [0.1 °C]\n0,205\n1,206\n",
       "{ name = \"its name\", unit = \"0.1 °C\" }"},
      {"an unknown unit of a mapped name", "Time [s],T1 [0.1 °C]\n0,205\n1,206\n",
       "may not be the unit of 'T1 [0.1 °C]'", "[columns]\n\"T1 [0.1 °C]\" = \"t1_degC\""},
      {"the same with its unit", "Time [s],T1 [0.1 °C]\n0,205\n1,210\n",
       "time_s,t1_degC\n0,20.5\n1,21\n",
       "[columns]\n\"T1 [0.1 °C]\" = { name = \"t1_degC\", unit = \"0.1 degC\" }"},
      {"a place in brackets", "Time [s],T1 (bed 1)\n0,205\n1,206\n",
       "time_s,t1_degC\n0,205\n1,206\n", "[columns]\n\"T1 (bed 1)\" = \"t1_degC\""},
      {"a name and a row of units that disagree", "Time,Bed_degC\ns,°F\n0,68\n1,69\n",
       "log:1: column 2 = Bed_degC: names one unit, and its column is in °F"},
      {"and agree", "Time,Bed_degC\ns,°C\n0,20\n1,21\n", "time_s,Bed_degC\n0,20\n1,21\n"},
      {"a switch", "Time [s],Pump,T1 [C]\n0,TRUE,20\n1,FALSE,21\n",
       "log:2: Pump = TRUE: is a switch: write \"Pump\" = \"Pump_on\""},
      {"a unit behind one number of several", "Time [s],T1\n0,20.5\n10,80.6 A\n",
       "log:3: T1 = 80.6 A: must be a number"},
      {"a difference in degF", "Time [s],dT (°F)\n0,1.8\n1,3.6\n",
       "log:1: column 2 = dT (°F): may be a difference of temperatures"},
      {"the same, said to be one", "Time [s],dT (°F)\n0,1.8\n1,3.6\n", "time_s,dT_K\n0,1\n1,2\n",
       "[columns]\n\"dT (°F)\" = { name = \"dT_K\", unit = \"delta_degF\" }"},
  });
}

TEST_CASE("a date, a fraction of a second and summer time belong to the clock", "[import]") {
  check_all({
      {"a date written where it changes",
       "Date;Time;T1 [°C]\n01.02.2026;16:00:00;20,5\n;17:00:00;20,6\n05.02.2026;18:00:00;19,7\n"
       ";19:00:00;19,8\n",
       "time_s,T1_degC\n0,20.5\n3600,20.6\n352800,19.7\n356400,19.8\n"},
      {"milliseconds beside the clock",
       "Date,Time,ms,T1 [C]\n2026/02/13,08:00:00,250,20\n2026/02/13,08:00:00,750,21\n"
       "2026/02/13,08:00:02,0,22\n",
       "time_s,T1_degC\n0,20\n0.5,21\n1.75,22\n"},
      {"fractions in seconds", "Time,sec.,T1 [C]\n08:00:00,.500,20\n08:00:02,.750,21\n",
       "time_s,T1_degC\n0,20\n2.25,21\n"},
      {"the same, used otherwise", "Time,ms,T1 [C]\n08:00:00,250,20\n08:00:01,750,21\n",
       "time_s,delay,T1_degC\n0,250,20\n1,750,21\n", "[columns]\nms = \"delay\""},
      {"milliseconds of more than a second", "Time,ms,T1 [C]\n08:00:00,250,20\n08:00:01,1250,21\n",
       "time_s,ms,T1_degC\n0,250,20\n1,1250,21\n"},
      {"a database's day and clock",
       "Day;Time;T1 [°C]\n13.02.2026 00:00:00;30.12.1899 23:59:50;20,5\n"
       "14.02.2026 00:00:00;30.12.1899 00:00:10;20,6\n",
       "time_s,T1_degC\n0,20.5\n20,20.6\n"},
      {"the begin of summer time",
       "Time,T1 [C]\n29.03.2026 01:58:00,20\n29.03.2026 01:59:00,21\n29.03.2026 03:00:00,22\n"
       "29.03.2026 03:01:00,23\n",
       "time_s,T1_degC\n0,20\n60,21\n120,22\n180,23\n"},
      {"a gap of that length on another day",
       "Time,T1 [C]\n30.03.2026 01:58:00,20\n30.03.2026 01:59:00,21\n30.03.2026 03:00:00,22\n",
       "time_s,T1_degC\n0,20\n60,21\n3720,22\n"},
      {"the end of summer time, newest row first",
       "Time,T1 [C]\n25.10.2026 02:10:00,23\n25.10.2026 02:00:00,22\n25.10.2026 02:50:00,21\n"
       "25.10.2026 02:40:00,20\n",
       "time_s,T1_degC\n0,20\n600,21\n1200,22\n1800,23\n"},
      {"a clock set back in July",
       "Time,T1 [C]\n14.07.2026 02:40:00,20\n14.07.2026 02:50:00,21\n14.07.2026 02:00:00,22\n"
       "14.07.2026 02:10:00,23\n",
       "log:4: Time = 14.07.2026 02:00:00: must be later than in line 3"},
      {"two times of one name", "Time,T1 [C],Time,z [um]\n0,20,0,1\n1,21,0.1,2\n",
       "log:1: column 3 = Time: is the name of column 1, too"},
  });
}

TEST_CASE("JSON: lists of sensors, and units beside the values", "[import]") {
  check_all({
      {"a list", "{\"time\":0,\"t\":[20.5,21]}\n{\"time\":1,\"t\":[20.6,null]}\n",
       "time_s,t.1,t.2\n0,20.5,21\n1,20.6,\n", "time_unit = \"s\""},
      {"a list whose elements have names, in any order",
       "[{\"time\":\"08:00:00\",\"t\":[{\"id\":\"bed\",\"value\":20},{\"id\":\"head\",\"value\":25}"
       "]},\n"
       "{\"time\":\"08:00:10\",\"t\":[{\"id\":\"head\",\"value\":26},{\"id\":\"bed\",\"value\":21}]"
       "}]",
       "time_s,t.bed.value,t.head.value\n0,20,25\n10,21,26\n"},
      {"lists of unequal length", "{\"time\":0,\"t\":[20.5,21]}\n{\"time\":1,\"t\":[20.6]}\n",
       "log: t = 1 values: must have as many as the record before, 2"},
      {"a value with its unit",
       "[{\"time\":\"08:00:00\",\"bed\":{\"value\":68,\"unit\":\"°F\"}},\n"
       "{\"time\":\"08:00:10\",\"bed\":{\"value\":21,\"unit\":\"°C\"}}]",
       "time_s,bed_degC\n0,20\n10,21\n"},
      {"units by name",
       "{\"units\":{\"bed\":\"°F\"},\"data\":[{\"time\":\"08:00:00\",\"bed\":68},\n"
       "{\"time\":\"08:00:10\",\"bed\":69.8}]}",
       "time_s,bed_degC\n0,20\n10,21\n"},
  });
}

TEST_CASE("numbers that may be another time are asked for", "[import]") {
  check_all({
      {"a counter of ms, of the size of seconds since 1904",
       "Time,T1 [C]\n3200000000,20\n3200000500,21\n", "log:1: Time = (no unit)"},
      {"a clock without colons, called seconds", "Time,T1 [C]\n95940,20\n95950,21\n100000,22\n",
       "write time_unit = \"hhmmss\"", "time_unit = \"s\""},
      {"seconds of such size", "Time [s],T1 [C]\n95940,20\n95950,21\n95960,22\n",
       "time_s,T1_degC\n95940,20\n95950,21\n95960,22\n"},
      {"a multiple of a unit", "Time [0.1 s],T1 [C]\n0,20\n10,21\n",
       "log:1: Time [0.1 s] = 0.1 s: is a multiple of a unit", "time_unit = \"s\""},
      {"AM and PM in a column of their own",
       "Date,Time,,T1 [C]\n04/13/2026,11:50:00,PM,20\n04/14/2026,12:00:00,AM,21\n",
       "time_s,T1_degC\n0,20\n600,21\n"},
      {"a spreadsheet's minutes and seconds beside a date",
       "Date,Time,T1 [C]\n13.04.2026,00:10.0,20\n13.04.2026,00:20.0,21\n",
       "may be hours and minutes or minutes and seconds"},
      {"a number of records",
       "RecordID;Time;T1 [C]\n1204500001;08:00:00;20\n1204500002;08:00:10;21\n",
       "time_s,T1_degC\n0,20\n10,21\n", "ignore = [\"RecordID\"]"},
      {"a counter without a word for time", "Tick,T1 [C]\n2000000000,20\n2000000100,21\n",
       "log:1: time_s = (missing)"},
      {"seconds of the size of a spreadsheet's days", "Time,T1 [C]\n36512.25,20\n36512.275,21\n",
       "log:1: Time = (no unit)"},
      {"seconds of the day", "Time,T1 [C]\n28800,20\n28810,21\n", "log:1: Time = (no unit)"},
      {"a counter of us", "timestamp,T1 [C]\n1500000000,20\n1500100000,21\n",
       "log:1: timestamp = (no unit)"},
      {"seconds since 1970, once a day", "timestamp,T1 [C]\n1500000000,20\n1500086400,21\n",
       "time_s,T1_degC\n0,20\n86400,21\n", "time_unit = \"s\""},
      {"a clock without colons", "Time,T1 [C]\n95950,20\n100000,21\n", "hhmmss"},
      {"the same, said to be one", "Time,T1 [C]\n95950,20\n100000,21\n",
       "time_s,T1_degC\n0,20\n10,21\n", "time_unit = \"hhmmss\""},
      {"with its date", "Date;Time;T1 [C]\n20260201;235950;20\n20260202;5;21\n",
       "time_s,T1_degC\n0,20\n15,21\n", "time = [\"Date\", \"Time\"]\ntime_unit = \"hhmmss\""},
  });
}

TEST_CASE("values of a fault are missing, or asked for", "[import]") {
  check_all({
      {"the overload of an instrument", "Time [s],T1 [C],U [V]\n0,20,+9.9E+37\n1,-9.9E37,2\n",
       "time_s,T1_degC,U_V\n0,20,\n1,,2\n"},
      {"below absolute zero", "Time [s],T1 [C]\n0,20\n1,-9999\n",
       "log:3: T1 [C] = -9999: must be between -273.15 and 2500 degC"},
      {"the same, said to be missing", "Time [s],T1 [C]\n0,20\n1,-9999\n",
       "time_s,T1_degC\n0,20\n1,\n", "missing = [\"-9999\"]"},
      {"bad quality in words",
       "Time,Tag,Value,Unit,Quality\n2026-02-01 08:00:00,Bed,20,°C,Good\n"
       "2026-02-01 08:01:00,Bed,0,°C,Bad\n2026-02-01 08:02:00,Bed,21,°C,Good\n",
       "time_s,Bed_degC\n0,20\n60,\n120,21\n"},
      {"bad quality in OPC's numbers",
       "Tag;Time;Value;Detail\nBed;13.02.2026 08:00:00;20,5;192\nHead;13.02.2026 08:00:00;21;192\n"
       "Bed;13.02.2026 08:01:00;0;24\nHead;13.02.2026 08:01:00;22;64\n",
       "time_s,Bed,Head\n0,20.5,21\n60,,22\n"},
  });
}

TEST_CASE("rows of several sensors are never one column", "[import]") {
  const std::string rows =
      "2026-02-01 08:00:00,Bed,20,40\n2026-02-01 08:00:05,Head,30,41\n"
      "2026-02-01 08:01:00,Bed,21,42\n2026-02-01 08:01:05,Head,31,43\n";
  check_all({
      {"each with a time of its own",
       "Time,Sensor,T1 [C]\n2026-02-01 08:00:00,Bed,20\n2026-02-01 08:00:05,Head,30\n"
       "2026-02-01 08:01:00,Bed,21\n2026-02-01 08:01:05,Head,31\n",
       "time_s,Bed_degC,Head_degC\n0,20,\n5,,30\n60,21,\n65,,31\n"},
      {"with two values each", "Time,Sensor,T [C],H [%]\n" + rows,
       "log:1: Sensor = Bed: names the sensor of a row"},
      {"of which one is read", "Time,Sensor,T [C],H [%]\n" + rows,
       "time_s,Bed_degC,Head_degC\n0,20,\n5,,30\n60,21,\n65,,31\n",
       "pivot = [\"Sensor\", \"T [C]\"]"},
      {"or all are of one", "Time,Sensor,T [C],H [%]\n" + rows,
       "time_s,T_degC,H_percent\n0,20,40\n5,30,41\n60,21,42\n65,31,43\n", "ignore = [\"Sensor\"]"},
  });
}

TEST_CASE("a column may be the unit, the quality or the sensor of another's values", "[import]") {
  check_all({
      {"a unit behind each value", "Time [s],Bed,Unit,Head,Unit\n0,20,C,68,F\n60,21,C,69.8,F\n",
       "time_s,Bed_degC,Head_degC\n0,20,20\n60,21,21\n"},
      {"a quality behind each value",
       "Time [s],Bed [C],Bed Quality,z [um],z Quality\n0,20,Good,1,Good\n60,0,Bad,2,Good\n",
       "time_s,Bed_degC,z_um\n0,20,1\n60,,2\n"},
      {"a quality before its value", "Time [s],Quality,Bed [C]\n0,Good,20\n60,Bad,0\n",
       "time_s,Bed_degC\n0,20\n60,\n"},
      {"in hexadecimal numbers",
       "Time [s],Bed [C],Quality\n0,20,0x000000C0\n60,0,0x00000018\n120,0,0x80000000\n",
       "time_s,Bed_degC\n0,20\n60,\n120,\n"},
      {"as 1 and 0", "Time [s],Bed [C],Validity\n0,20,1\n60,0,0\n", "time_s,Bed_degC\n0,20\n60,\n"},
      {"a state is no quality", "Time [s],Bed [C],State\n0,20,RUN\n60,0,STOP\n",
       "time_s,Bed_degC\n0,20\n60,0\n"},
      {"the number of a sensor", "Time [s],Channel,T [C]\n0,1,20\n1,2,30\n60,1,21\n61,2,31\n",
       "log:1: column 2 = Channel: may say which sensor a row is of"},
      {"each sensor a column", "Time [s],Channel,T [C]\n0,1,20\n1,2,30\n60,1,21\n61,2,31\n",
       "time_s,1_degC,2_degC\n0,20,\n1,,30\n60,21,\n61,,31\n", "pivot = [\"Channel\", \"T [C]\"]"},
      {"a name without a header",
       "2026-02-01 08:00:00|bed|20\n2026-02-01 08:00:05|head|30\n"
       "2026-02-01 08:01:00|bed|21\n2026-02-01 08:01:05|head|31\n",
       "log:1: column 2 = bed: may say what the number of a row is"},
      {"another word in front of the value",
       "08:00:00 INFO Bed temp=20\n08:00:01 INFO Head temp=30\n08:01:00 INFO Bed temp=21\n"
       "08:01:01 WARN Head temp=31\n",
       "log:4: temp = Head: may be of another sensor than the lines with 'Bed'"},
      {"a level is no sensor",
       "08:00:00 INFO temp=20\n08:01:00 WARN temp=21\n08:02:00 INFO temp=22\n"
       "08:03:00 WARN temp=23\n",
       "time_s,temp\n0,20\n60,21\n120,22\n180,23\n"},
  });
}

TEST_CASE("a unit that may be another is asked for", "[import]") {
  check_all({
      {"a letter of the name", "Time,Spindle (A)\ns,degC\n0,20\n60,21\n",
       "log:1: column 2 = Spindle (A): may be in A, as its name says, or in degC"},
      {"as the row of units says", "Time,Spindle (A)\ns,degC\n0,20\n60,21\n",
       "time_s,Spindle_degC\n0,20\n60,21\n",
       "[columns]\n\"Spindle (A)\" = { name = \"Spindle_degC\", unit = \"degC\" }"},
      {"tenths", "Time [s],Bed 0.1℃\n0,205\n60,206\n",
       "write \"Bed 0.1℃\" = { name = \"Bed_degC\", unit = \"0.1 ℃\" }"},
      {"ten times", "Time [s],Bed x10°C\n0,205\n60,206\n", "may be a multiple of its unit"},
      {"factors above the names", "Name,Run\nScale,0.1\nTime [s],Bed [C]\n0,205\n60,206\n",
       "log:2: Scale,0.1: is neither a row like those below nor names"},
      {"the number of a sensor is no factor", "Time [s],Bed 1 °C\n0,20\n60,21\n",
       "time_s,Bed_1_degC\n0,20\n60,21\n"},
      {"thousands", "Time [s],speed\n0,3.00 K\n60,4.50 K\n", "may be a unit or mean a thousand"},
      {"more than a unit", "Time [s],T [C],speed\n0,20,3 K rpm\n60,21,4.5 K rpm\n",
       "log:2: speed = 3 K rpm: must be a number"},
  });
}

TEST_CASE("what may be a part of the time is asked for", "[import]") {
  check_all({
      {"seconds beside hours and minutes",
       "Date;Time;Sec;T "
       "[C]\n01.02.2026;08:00;0;20\n01.02.2026;08:01;30;21\n01.02.2026;08:03;0;22\n",
       "log:1: column 3 = Sec: may be a part of the time"},
      {"counts of ms",
       "Time,T [C]\n2026-02-01 08:00:00.3,20\n2026-02-01 08:00:01.20,21\n2026-02-01 "
       "08:00:02.370,22\n",
       "may end with a fraction of a second or with a number of ms"},
      {"counts of ms behind a colon",
       "Time;T [C]\n01.02.2026 8:0:0:3;20\n01.02.2026 8:0:1:44;21\n01.02.2026 8:0:2:185;22\n",
       "may end with a fraction of a second or with a number of ms"},
      {"a whole second without a fraction",
       "Time,T [C]\n2026-02-01T08:00:00,20\n2026-02-01T08:00:00.500,21\n",
       "time_s,T_degC\n0,20\n0.5,21\n"},
      {"the year first", "Time,T [C]\n26.04.13 23:59:30,20\n26.04.14 00:00:00,21\n",
       "time_s,T_degC\n0,20\n30,21\n"},
      {"the day first", "Time,T [C]\n13.04.26 23:59:30,20\n14.04.26 00:00:00,21\n",
       "time_s,T_degC\n0,20\n30,21\n"},
      {"two clocks beside the date",
       "Date;Time;Duration;T "
       "[C]\n01.02.2026;08:00:00;00:01:10;20\n02.02.2026;13:00:00;00:01:11;21\n",
       "time_s,T_degC\n0,20\n104400,21\n"},
      {"seconds beside a date without them",
       "Timestamp,Elapsed [s],T [C]\n2026-02-01 08:00,0,20\n2026-02-01 08:01,90,21\n",
       "time_s,T_degC\n0,20\n90,21\n"},
  });
}

TEST_CASE("TwinCAT's scope: groups of thousands are read, a scale is refused", "[import]") {
  const std::string head =
      "Name\tScope\nName\tBed\tName\tWay\nSampleTime[ms]\t500\tSampleTime[ms]\t500\n";
  check_all(
      {{"groups", head + "\n0\t20,5\t0\t1.234,5\n500\t20,75\t500\t1.234,6\n",
        "time_s,Bed,Way\n0,20.5,1234.5\n0.5,20.75,1234.6\n"},
       {"a value that is none", head + "\n0\t20,5\t0\t1,5\n500\tx\t500\t2\n",
        "log:6: Bed = x: must be a number"},
       {"a scale", head + "ScaleFactor\t0,1\tScaleFactor\t1\n\n0\t205\t0\t1\n500\t206\t500\t2\n",
        "log:4: ScaleFactor = 0,1: may be in the values or not"},
       {"blanks and an empty line", "Name Bed\n\nSampleTime[ms] 500\n0 20.5\n500 20.75\n",
        "time_s,Bed\n0,20.5\n0.5,20.75\n"}});
}

TEST_CASE("halsampler's lines may end with CR LF", "[import]") {
  check_all({{"two rows", "20.5\r\n20.75\r\n", "time_s,t1_degC\n0,20.5\n1,20.75\n",
              "names = [\"t1_degC\"]\nperiod_s = 1\n"}});
}

TEST_CASE("the comments of an LVM are left out", "[import]") {
  const std::string head =
      "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\nChannels\t1\n"
      "Y_Unit_Label\tDeg C\n***End_of_Header***\t\nX_Value\tBed\tComment\n";
  check_all({{"in one row", head + "0\t20\tstart\n1\t21\n2\t22\n",
              "time_s,Bed_degC\n0,20\n1,21\n2,22\n"}});
}

TEST_CASE("times are read as people of several countries write them", "[import]") {
  const std::string run = "time_s,T_degC\n0,20\n60,21\n";
  const auto written = [&](const std::string& first, const std::string& second,
                           const std::string& map = "") {
    return MisreadLog{first, "Time;T [C]\n" + first + ";20\n" + second + ";21\n", run, map};
  };
  check_all({
      written("26. Nov. 2026 06:59:00", "26. Nov. 2026 07:00:00"),
      written("3 décembre 2026 06:59:00", "3 décembre 2026 07:00:00"),
      written("Thursday, November 26, 2026 11:59:00 AM", "Thursday, November 26, 2026 12:00:00 PM"),
      written("mar. 3 mars 2026 06h59", "mar. 3 mars 2026 07h00"),
      written("26.11.2026 06.59.00", "26.11.2026 07.00.00"),
      written("2026年11月26日 6時59分00秒", "2026年11月26日 7時00分00秒"),
      written("'26-11-26 06:59:00.000", "'26-11-26 07:00:00.000",
              "date_order = \"year.month.day\""),
      written("2026-10-25 02:59:00 CEST", "2026-10-25 02:00:00 CET"),
      written("2026-11-26T06:59:00+01:00[Europe/Berlin]",
              "2026-11-26T07:00:00+01:00[Europe/Berlin]"),
      written("26/11/2026 11:59:00 a. m.", "26/11/2026 12:00:00 p. m."),
      written("2026/11/26 上午 11:59:00", "2026/11/26 下午 12:00:00"),
      written("0 days 23:59:00", "1 days 00:00:00"),
      written("23:59:00", "1.00:00:00"),
      written("59:30.0", "00:30.0", "time_unit = \"mm:ss\""),
      {"minutes that begin anew", "Time,T [C]\n44:00,20\n45:00,21\n00:00,22\n01:00,23\n",
       "log:4: Time = 00:00: must be later than in line 3", "time_unit = \"mm:ss\""},
      {"WinCC's millionths of a day",
       "\"VarName\";\"TimeString\";\"VarValue\";\"Validity\";\"Time_ms\"\n"
       "\"T_degC\";\"26.11.2026 06:55:00\";20;1;46352288194,4444\n"
       "\"T_degC\";\"26.11.2026 06:55:00\";21;1;46352288197,3380\n"
       "\"T_degC\";\"26.11.2026 06:55:00\";22;1;46352288200,2315\n"
       "\"$RT_OFF$\";\"26.11.2026 06:55:09\";0;2;46352288300,1230\n",
       "time_s,T_degC\n0,20\n0.250007,21\n"},
      {"a column for each part",
       "Year,Month,Day,Hour,Minute,Second,T [C]\n2026,11,26,6,59,0,20\n2026,11,26,7,0,0,21\n", run},
      {"a time for each channel", "Time [s],T [C],Time [s],z [um]\n0,20,0,1\n60,21,60,2\n",
       "time_s,T_degC,z_um\n0,20,1\n60,21,2\n"},
  });
}

TEST_CASE("lines and bytes that are no rows", "[import]") {
  const std::string run = "time_s,T_degC\n0,20\n60,21\n";
  check_all({
      {"events, another header and statistics",
       "Time [s];T [C]\n0;20\n*** door opened\nTime [s];T [C]\n60;21\n\nMin;20,0\nEnd of data\n",
       run},
      {"a series called max", "name,Time [s],value\nmax,0,20\nmin,0,19\nmax,60,21\nmin,60,18\n",
       "time_s,max,min\n0,20,19\n60,21,18\n"},
      {"a header in another order",
       "Time [s],T [C],z [um]\n0,20,1\nTime [s],z [um],T [C]\n60,2,21\n",
       "log:3: Time [s],z [um],T [C]: names the columns in another order than line 1"},
      {"a comma that separates fields and decimals",
       "Time [s],T [C],z [um]\n0,20,5,1,0\n60,20,6,2,5\n", "seems to be the decimal sign, too"},
      {"lines in quotes", "\"Time [s],T [C]\"\n\"0,20\"\n\"60,21\"\n", run},
      {"a row that was sent twice", "Time [s],T [C]\n0,20\n0,20\n60,21\n", run},
      {"CR CR LF", "Time [s],T [C]\r\r\n0,20\r\r\n60,21\r\r\n", run},
      {"comments", "% bench 3\n// door shut\nTime [s],T [C]\n0,20\n60,21\n", run},
      {"zeros of a lost supply", "Time [s],T [C]\n0,20\n" + std::string(99, '\0') + "60,21\n", run},
      {"which cut a row", "Time [s],T [C]\n0,2" + std::string(9, '\0') + "60,21\n",
       "time_s,T_degC\n0,2\n60,21\n"},
      {"a scope's label without a value", "Sampling period is 1000 ns\nCH1 20\nCH1\n",
       "log:3: CH1 = (missing): must be a label and its value, in turn"},
      {"a scope's log that ends in its first line", "Sampling period is \n0\n",
       "log:1: must be the sampling period in ns"},
      {"UTF-16 without a mark",
       [] {
         std::string wide;
         for (const char c : std::string("Time [s],T [C]\n0,20\n60,21\n")) (wide += c) += '\0';
         return wide;
       }(),
       run},
      {"letters of another encoding", "Time [s],\x89\xb7\x93x(\x81\x8e)\n0,20\n",
       "write encoding = \"shift_jis\""},
      {"which is given", "Time [s],\x89\xb7\x93x(\x81\x8e)\n0,20\n", "time_s,温度_degC\n0,20\n",
       "encoding = \"shift_jis\""},
  });
}

TEST_CASE("units, missing values and devices of further programs", "[import]") {
  const std::string run = "time_s,T_degC\n0,20\n60,21\n";
  const auto named = [&](const std::string& header) {
    return MisreadLog{header, "Time [s];" + header + "\n0;20\n60;21\n", run};
  };
  check_all({
      named("[°C] T"),
      named("T, deg C"),
      named("T_C"),
      named("T/°C"),
      named("T [\xf8"
            "C]"),
      {"a floor", "Time [s],Temp1F,T (IN)\n0,20,30\n", "column 3 = T (IN): has an unknown unit"},
      {"letters of sensors", "Time [s],Temp A,Temp B,Temp C\n0,20,30,40\n",
       "time_s,Temp_A,Temp_B,Temp_C\n0,20,30,40\n"},
      {"a letter behind another name", "Time [s],bed_C\n0,20\n",
       "bed_C: may be in degC: write \"bed_C\" = { name = \"bed_degC\", unit = \"degC\" }"},
      {"other sizes of letters, a twice coded sign", "Time [s],a (UM),n (Rpm),z [Âµm]\n0,1,2,3\n",
       "time_s,a_um,n_rpm,z_um\n0,1,2,3\n"},
      {"blanks between thousands", "Time [s];n [rpm];T [C]\n0;2 000;20,5\n60;12 000;21,5\n",
       "time_s,n_rpm,T_degC\n0,2000,20.5\n60,12000,21.5\n"},
      {"units behind strokes", "t/ms;T/K;I/A\n0;293.15;1\n60;294.15;2\n",
       "time_s,T_K,I_A\n0,293.15,1\n0.06,294.15,2\n"},
      {"names over two rows", "Time [s],Bed,\n,Min [C],Max [C]\n0,20,21\n",
       "time_s,Min_degC,Max_degC\n0,20,21\n"},
      {"signs for a missing value", "Time [s],T [C]\n0,20\n60,-----\n120,+OVER\n180,Burn Out\n",
       "time_s,T_degC\n0,20\n60,\n120,\n180,\n"},
      {"one series of InfluxDB",
       ",result,table,_start,_stop,_time,_value,_field\n"
       ",,0,2026-02-01T09:00:00Z,2026-02-01T11:00:00Z,2026-02-01T10:00:00Z,20,T_degC\n"
       ",,0,2026-02-01T09:00:00Z,2026-02-01T11:00:00Z,2026-02-01T10:01:00Z,21,T_degC\n",
       run},
      {"devices, each with a time of its own",
       "Time [s],Device,T [C]\n0,bed,20\n5,head,30\n60,bed,21\n65,head,31\n",
       "time_s,bed_degC,head_degC\n0,20,\n5,,30\n60,21,\n65,,31\n"},
      {"words that alternate", "Time [s],Box,T [C]\n0,bed,20\n5,head,30\n60,bed,21\n65,head,31\n",
       "column 2 = Box: alternates, and may say which device a row is of: write pivot"},
      {"two series of points",
       R"({"T_degC":[{"ts":1795676100000,"value":"20"},{"ts":1795676160000,"value":"21"}],)"
       R"("z_um":[{"ts":1795676100000,"value":"1"},{"ts":1795676160000,"value":"2"}]})",
       "time_s,T_degC,z_um\n0,20,1\n60,21,2\n"},
      {"addresses",
       "Time [s],Box,T "
       "[C]\n0,1,20\n5,2,30\n60,1,21\n65,2,31\n120,1,21\n125,2,31\n180,1,21\n185,2,31\n",
       "column 2 = Box: may say which sensor a row is of"},
      {"MTConnect's adapter",
       "2026-02-01T10:00:00Z|T1|20|T2|UNAVAILABLE\n2026-02-01T10:01:00Z|T1|21\n"
       "2026-02-01T10:02:00Z|T2|22\n",
       "time_s,T1,T2\n0,20,\n60,21,\n120,,22\n"},
      {"LabVIEW without times",
       "LabVIEW Measurement\t\nX_Columns\tNo\n***End_of_Header***\t\n\nChannels\t1\t\n"
       "Y_Unit_Label\tDeg C\nDelta_X\t60.0\n***End_of_Header***\t\nX_Value\tT\tComment\n"
       "\t20\t\n\t21\t\n",
       run},
      {"references of an export",
       "# by export\ntime_s,T [C]\n0,20\n# 30.000 s: command reference\n60,21\n",
       "time_s,T_degC\n0,20\n# 60 s: command reference\n60,21\n"},
  });
}
