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
  std::string map;
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
       "time_s,T1,z\n0,20.5,-0.5\n10,20.6,-0.25\n", ""},
      {"units", "08:00:00 Bed: 20,5 °C; Gap: 1,5um load=20% n = 3\n08:00:10 Bed: 21,5 °C\n",
       "time_s,Bed_degC,Gap_um,load_percent,n\n0,20.5,1.5,20,3\n10,21.5,,,\n", ""},
      {"thousands", "08:00:00 n=1,500 T=20.5\n08:00:10 n=2,500 T=20.5\n",
       "log:1: 1,500: may have a group of thousands", ""},
      {"hyphens, umlauts, quotes", "08:00:00 bed-T=20.5 T_Öl=21.5 {\"head\": 22.5}\n",
       "time_s,bed-T,T_Öl,head\n0,20.5,21.5,22.5\n", ""},
      {"names of two words", "08:00:00 Bed temp: 20.5, Head temp: 25.5\n",
       "log:1: temp = 25.5: must be there once at a time", ""},
      {"two polls in a second", "08:00:00 T=20.5\n08:00:00 T=20.6\n08:00:01 T=20.7\n",
       "log:2: T = 20.6: must be there once at a time", ""},
      {"a word among numbers", "start\n08:00:00 T=20.5\n\n08:00:10 T=lost\n08:00:20 T=21\n",
       "log:4: T = lost: must be a number", ""},
  });
}

TEST_CASE("a header has a name for each field, or is refused", "[import]") {
  check_all({
      {"an empty column between blanks", "t[s] BED[degC] HEAD[degC] GAP[um]\n0 20 0.0\n10 21 0.5\n",
       "log:1: 4 names: must be one for each of the 3 fields", ""},
      {"its names are given", "t[s] BED[degC] HEAD[degC] GAP[um]\n0 20 0.0\n10 21 0.5\n",
       "time_s,t_degC,z_um\n0,20,0\n10,21,0.5\n", "names = [\"time_s\", \"t_degC\", \"z_um\"]"},
      {"only the first row is full", "t[s] T1[C] z[um]\n0 20 0.0\n1 0.5\n2 1.0\n3 1.5\n",
       "log:2: 3 fields: must have 2", ""},
      {"the same with tabs", "t[s]\tT1[C]\tT2[C]\n0\t20\t21\n1\t20\n2\t21\n3\t21\n",
       "log:2: 3 fields: must have 2", ""},
      {"rows one shorter", "No,Time [s],T1 [C],T2 [C]\n0,20.5,30.1\n10,20.6,30.0\n",
       "log:1: 4 names: must be one for each of the 3 fields", ""},
      {"rows with a checksum", "Time [s],T1 [C],z [um]\n0,20.5,1,165\n10,20.6,2,17\n",
       "log:1: 3 names: must be one for each of the 4 fields", ""},
      {"rows with a number", "Time [s],t1 [C]\n1,0,20.5\n2,10,20.6\n",
       "time_s,t1_degC\n0,20.5\n10,20.6\n", ""},
      {"quoted parts of a name", "t [s],\"AI\".Bed [C],\"Axis Z\".Pos [mm]\n0,20.5,1\n1,20.6,2\n",
       "time_s,_AI_.Bed_degC,_Axis_Z_.Pos_mm\n0,20.5,1\n1,20.6,2\n", ""},
      {"names of an index above", "    bed_degC  z_um\ntime\n2026-02-01 08:00:00 20.5 0.0\n",
       "log:2: 1 names: must be one for each of the 4 fields", ""},
  });
}
