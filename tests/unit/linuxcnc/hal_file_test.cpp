// Tests of the generated HAL files and their options.
#include "linuxcnc/hal_file.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <sstream>

#include <catch2/catch.hpp>

#include "linuxcnc/command_line.hpp"

using namespace thermocomp_linuxcnc;

namespace {

HalFileOptions options(Way way, const std::string& axes = "x=0,y=1,z=2") {
  HalFileOptions made;
  made.way = way;
  made.axes = read_axes(axes);
  return made;
}

bool has(const std::string& text, const std::string& line) {
  return ("\n" + text).find("\n" + line + "\n") != std::string::npos;
}

/// Maps every connected pin to its signal. A pin on two signals would not load.
std::map<std::string, std::string> nets(const std::string& text) {
  std::map<std::string, std::string> signals;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word;
    std::string signal;
    if (!(words >> word) || word != "net" || !(words >> signal)) continue;
    while (words >> word) {
      if (word == "=>" || word == "<=") continue;
      const auto [entry, is_new] = signals.emplace(word, signal);
      CHECK((is_new || entry->second == signal));
    }
  }
  return signals;
}

}  // namespace

TEST_CASE("both ways add the offset of each axis at the right place", "[linuxcnc]") {
  const std::string joint = hal_file(options(Way::joint, "x=0,z=3"));
  auto signals = nets(joint);
  CHECK(signals.at("joint.3.motor-pos-cmd") == signals.at("tc.offset-z.in"));
  CHECK(signals.at("tc.limit-z.out") == signals.at("tc.offset-z.offset"));
  CHECK(signals.at("thermocomp.offset-z") == signals.at("tc.gate-z.in1"));
  CHECK(signals.at("tc.gate-z.sel") == signals.at("motion.is-all-homed"));
  CHECK(signals.at("tc.back-z.out") == signals.at("thermocomp.applied-z"));
  CHECK_FALSE(signals.contains("joint.1.motor-pos-cmd"));
  CHECK(joint.find("eoffset") == std::string::npos);

  const std::string external = hal_file(options(Way::external));
  signals = nets(external);
  CHECK(signals.at("tc.clear.out") == signals.at("axis.y.eoffset-clear"));
  CHECK(signals.at("tc.clear.out") == signals.at("tc.limit-y.load"));
  CHECK(signals.at("axis.y.eoffset") == signals.at("thermocomp.applied-y"));
  CHECK(signals.at("axis.y.eoffset-request") == signals.at("thermocomp.wanted-y"));
  CHECK(external.find("motor-pos-cmd") == std::string::npos);
  CHECK(has(external, "setp axis.y.eoffset-enable 1"));
}

TEST_CASE("every component is loaded and run once", "[linuxcnc]") {
  for (const Way way : {Way::joint, Way::external}) {
    std::istringstream lines(hal_file(options(way)));
    std::set<std::string> loaded;
    std::set<std::string> kinds;
    std::set<std::string> run;
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::string word;
      std::string second;
      words >> word >> second;
      if (word == "loadrt") {
        CHECK(kinds.insert(second).second);
        std::string names;
        words >> names;
        std::istringstream list(names.substr(std::string("names=").size()));
        for (std::string name; std::getline(list, name, ',');) CHECK(loaded.insert(name).second);
      }
      if (word == "addf") CHECK(run.insert(second).second);
    }
    for (const std::string& name : loaded) {
      INFO(name);
      CHECK(std::any_of(run.begin(), run.end(), [&](const std::string& function) {
        return function == name || function.starts_with(name + ".");
      }));
    }
  }
}

TEST_CASE("a pin already on a signal of the machine is read from that signal", "[linuxcnc]") {
  HalFileOptions made = options(Way::joint, "z=2");
  made.signals = {{"spindle.0.speed-out", "spindle-speed"},
                  {"motion.is-all-homed", "all-homed"},
                  {"tc.offset-z.out", "z-cmd"}};
  const auto signals = nets(hal_file(made));
  CHECK(signals.at("thermocomp.spindle-rpm") == "spindle-speed");
  CHECK_FALSE(signals.contains("spindle.0.speed-out"));
  CHECK(signals.at("thermocomp.taking") == "all-homed");
  CHECK(signals.at("tc.gate-z.sel") == "all-homed");
  CHECK(signals.at("tc.offset-z.out") == "z-cmd");
}

TEST_CASE("a signal for a pin that the file does not connect is refused", "[linuxcnc]") {
  for (const char* pin : {"motion.motion-enabld", "tc.offset-q.out", "joint.2.motor-pos-cmd"}) {
    INFO(pin);
    HalFileOptions made = options(Way::joint, "z=2");
    made.signals = {{pin, "s"}};
    CHECK_THROWS_AS(hal_file(made), BadOption);
  }
}

TEST_CASE("limits are numbers in the machine's unit, which the bridge is told", "[linuxcnc]") {
  HalFileOptions made = options(Way::external, "z=2");
  CHECK(has(hal_file(made), "setp tc.limit-z.max 0.2"));
  made.unit = "inch";
  const std::string inch = hal_file(made);
  CHECK(has(inch, "setp tc.limit-z.min -0.00787401575"));
  CHECK(has(inch, "setp tc.limit-z.maxv 0.00196850394"));
  CHECK(inch.find(" --units [TRAJ]LINEAR_UNITS --made-for inch") != std::string::npos);
  // Commands for a running LinuxCNC are executed without its ini file.
  CHECK(rejoin_file(made, "second").find(" --units inch --made-for inch") != std::string::npos);
  made.unit = "cm";
  CHECK_THROWS_AS(hal_file(made), BadOption);
  CHECK(unit_mm("imperial") == 25.4);
  CHECK(unit_mm("metric") == 1.0);
}

TEST_CASE("a killed bridge's signals are taken over, a bridge that ended is loaded again",
          "[linuxcnc]") {
  const std::string over = rejoin_file(options(Way::external, "x=0"), "second");
  CHECK(has(over, "unlinkp thermocomp.offset-x"));
  CHECK(has(over, "net tc-asked-x <= second.offset-x"));
  CHECK(over.find("loadrt") == std::string::npos);
  CHECK(over.find("loadusr -Wn second ") != std::string::npos);
  // Applied offsets are connected before requested ones.
  CHECK(over.find("applied-x") < over.find("net tc-asked-x"));
  const std::string again = rejoin_file(options(Way::external, "x=0"), "thermocomp");
  CHECK(again.find("unlinkp") == std::string::npos);
  CHECK_THROWS_AS(rejoin_file(options(Way::external), ""), BadOption);
}

TEST_CASE("invalid options are refused", "[linuxcnc]") {
  for (const char* axes :
       {"", "x", "x=", "=0", "x=0,", "x=a", "x=-1", "xx=0", "x=123", "x=0;y=1"}) {
    INFO(axes);
    CHECK_THROWS_AS(read_axes(axes), BadOption);
  }
  for (const char* axes : {"a=0", "x=0,x=1", "x=0,y=0", "x=16", "X=0"}) {
    INFO(axes);
    CHECK_THROWS_AS(hal_file(options(Way::joint, axes)), BadOption);
  }
  const auto refused = [](double HalFileOptions::*member, double value) {
    HalFileOptions made = options(Way::joint);
    made.*member = value;
    CHECK_THROWS_AS(hal_file(made), BadOption);
  };
  refused(&HalFileOptions::offset_mm_max, 0.0);
  refused(&HalFileOptions::offset_mm_max, 1.5);
  refused(&HalFileOptions::speed_mm_per_s, -1.0);
  refused(&HalFileOptions::acceleration_mm_per_s2, NAN);
}

TEST_CASE("the command line is parsed, and an invalid one ends with status 2", "[linuxcnc]") {
  int status = -1;
  const auto read = [&](std::vector<const char*> words) {
    words.insert(words.begin(), "thermocomp-linuxcnc");
    return read_command_line(static_cast<int>(words.size()), words.data(), status);
  };
  const auto bridge = read({"--name", "b", "--axes", "xz", "--socket", "/s", "--period-s", "0.1",
                            "--units", "inch", "--made-for", "imperial"});
  REQUIRE(bridge);
  CHECK_FALSE(bridge->print_hal);
  CHECK(bridge->bridge.name == "b");
  CHECK(bridge->bridge.axes == "xz");
  CHECK(bridge->bridge.period_s == 0.1);
  CHECK(bridge->bridge.unit == "inch");
  CHECK_THROWS_AS(read({"--units", "inch"}), BadOption);  // the HAL file was made for mm
  CHECK_THROWS_AS(read({"--units", "cm"}), BadOption);
  CHECK_FALSE(read({"--axes", "x"}));  // without units
  const auto hal = read({"hal", "--way", "external", "--axes", "x=0,z=2", "--signal", "a.b=c"});
  REQUIRE(hal);
  CHECK(hal->print_hal);
  CHECK(hal->hal.way == Way::external);
  CHECK(hal->hal.axes.at(1).joint == 2);
  CHECK(hal->hal.signals.at("a.b") == "c");
  CHECK_FALSE(read({"--axes", "xx"}));
  CHECK(status == 2);
  CHECK_FALSE(read({"--axes", ""}));
  CHECK_FALSE(read({"--period-s", "nan"}));
  CHECK_FALSE(read({"hal", "--way", "sideways", "--axes", "x=0"}));
  CHECK_FALSE(read({"--unknown"}));
  CHECK_THROWS_AS(read({"hal", "--way", "joint", "--axes", "x=0", "--signal", "=c"}), BadOption);
}
