// A travel in CAN frames in the configuration.
#include <functional>

#include "config/daemon/daemon_config.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

DaemonConfig parse_travel(const std::string& text) {
  return parse_daemon_config(text, "machine.toml", example("travel_model.toml"), "model.toml");
}

const CanControllerConfig& controller_of(const DaemonConfig& config) {
  return std::get<CanControllerConfig>(config.controller);
}

/// An edit of one of the tables of axis z.
Broken in_table(const std::string& what, const std::string& from, const std::string& to,
                const std::string& key, const std::string& rule, const std::string& at = "") {
  return {what, from, to, at, "axis[z].table." + key, rule};
}
Broken in_line(const std::string& what, const std::string& from, const std::string& to,
               const std::string& key, const std::string& rule, const std::string& at = "") {
  return {what, from, to, at, "axis[x].line." + key, rule};
}

// NOLINTNEXTLINE(readability-function-size): a table
const std::vector<Broken>& broken_frames() {
  static const std::vector<Broken> table = {
      in_line(
          "a frame without number",
          "slope_um_per_m = { id = 0x210, start_bit = 24, length_bits = 24, scale = 0.001 }\n# p0",
          "slope_um_per_m = { id = 0x213, start_bit = 24, length_bits = 24, scale = 0.001 }\n# p0",
          "slope_um_per_m.id", "carries no number of the set"),
      in_table("a frame of the table without number",
               "  { id = 0x212, start_bit = 48, length_bits = 16 },\n", "", "offsets[4].id",
               "carries no number of the set", "  { id = 0x212, start_bit = 0, length_bits = 16"),
      in_table("a frame that is shown without number",
               "  { id = 0x292, start_bit = 48, length_bits = 16 },\n", "", "applied.offsets[4].id",
               "carries no number of the set", "  { id = 0x292, start_bit = 0, length_bits = 16"),
      in_table("a number in a frame without values",
               "  { id = 0x211, start_bit = 48, length_bits = 16 },",
               "  { id = 0x211, start_bit = 48, length_bits = 16 },\n"
               "  { id = 0x213, start_bit = 48, length_bits = 16 },",
               "set_numbers[2].id", "carries no value of the set",
               "  { id = 0x213, start_bit = 48"),
      in_table("two numbers in a frame", "  { id = 0x212, start_bit = 48, length_bits = 16 },",
               "  { id = 0x212, start_bit = 48, length_bits = 16 },\n"
               "  { id = 0x212, start_bit = 32, length_bits = 16 },",
               "set_numbers[3].id", "has a number of the set already",
               "  { id = 0x212, start_bit = 32"),
      in_table("numbers of two lengths", "  { id = 0x212, start_bit = 48, length_bits = 16 },",
               "  { id = 0x212, start_bit = 48, length_bits = 8 },", "set_numbers[2].length_bits",
               "must be the same in each frame"),
      in_line("a number that is too short",
              "set_numbers = [{ id = 0x210, start_bit = 48, length_bits = 16 }]",
              "set_numbers = [{ id = 0x210, start_bit = 48, length_bits = 7 }]",
              "set_numbers[1].length_bits", "must be in [8, 32]"),
      in_line("a number with a scale",
              "set_numbers = [{ id = 0x210, start_bit = 48, length_bits = 16 }]",
              "set_numbers = [{ id = 0x210, start_bit = 48, length_bits = 16, scale = 2.0 }]",
              "set_numbers[1].scale", "does not apply to a count"),
      in_line("no number at all",
              "set_numbers = [{ id = 0x210, start_bit = 48, length_bits = 16 }]", "", "set_numbers",
              "must be given", "[axis.line]"),
      in_line(
          "values that overlap",
          "slope_um_per_m = { id = 0x210, start_bit = 24, length_bits = 24, scale = 0.001 }\n# p0",
          "slope_um_per_m = { id = 0x210, start_bit = 23, length_bits = 24, scale = 0.001 }\n# p0",
          "slope_um_per_m.start_bit", "shares bits with another value"),
      in_line("a number over a value",
              "set_numbers = [{ id = 0x210, start_bit = 48, length_bits = 16 }]",
              "set_numbers = [{ id = 0x210, start_bit = 47, length_bits = 16 }]",
              "set_numbers[1].start_bit", "shares bits with another value"),
      in_table("values that are shown overlap",
               "  { id = 0x291, start_bit = 32, length_bits = 16, scale = 0.01 },",
               "  { id = 0x291, start_bit = 31, length_bits = 16, scale = 0.01 },",
               "applied.offsets[3].start_bit", "shares bits with another value"),
      in_line("the number that is shown has another length",
              "set_numbers = [{ id = 0x290, start_bit = 48, length_bits = 16 }]",
              "set_numbers = [{ id = 0x290, start_bit = 48, length_bits = 8 }]",
              "applied.set_numbers[1].length_bits", "it is the same number"),
      in_table("too few places",
               "  { id = 0x212, start_bit = 16, length_bits = 16, scale = 0.01 },\n", "", "offsets",
               "must be 5, one per node", "offsets = [ "),
      in_table("too few places are shown",
               "  { id = 0x292, start_bit = 16, length_bits = 16, scale = 0.01 },\n", "",
               "applied.offsets", "must be 5, one per node", "offsets = [\n  { id = 0x291"),
      in_table("an offset that cannot hold the bound",
               "{ id = 0x211, start_bit = 0, length_bits = 16, scale = 0.01 }",
               "{ id = 0x211, start_bit = 0, length_bits = 16, scale = 0.001 }",
               "offsets[1].length_bits", "must be able to hold -offset_um_max"),
      in_line(
          "a slope that is too coarse",
          "slope_um_per_m = { id = 0x210, start_bit = 24, length_bits = 24, scale = 0.001 }\n# p0",
          "slope_um_per_m = { id = 0x210, start_bit = 24, length_bits = 24, scale = 0.2 }\n# p0",
          "slope_um_per_m.length_bits", "one count moves the end of the travel by 0.16 um"),
      in_line(
          "a slope that is too short",
          "slope_um_per_m = { id = 0x210, start_bit = 24, length_bits = 24, scale = 0.001 }\n# p0",
          "slope_um_per_m = { id = 0x210, start_bit = 24, length_bits = 16, scale = 0.001 }\n# p0",
          "slope_um_per_m.length_bits", "must be able to hold +-150 um/m"),
      in_line("a register", "set_numbers = [{ id = 0x210",
              "begin = { table = \"holding\", address = 1, encoding = \"uint16\" }\n"
              "set_numbers = [{ id = 0x210",
              "begin", "each of them has the number of the set", "begin = "),
      in_line("P0 of a register", "# p0_signal_mm = { ... } ", "p0_register_mm = { id = 0x210 }",
              "p0_register_mm", "it is called p0_signal_mm", "p0_register_mm"),
      {"an offset beside the line", "[axis.line] ",
       "offset = { id = 0x201, start_bit = 0, length_bits = 16 }\n[axis.line] ", "offset = { id",
       "axis[x].offset", "cannot be combined with"},
      {"valid bits over a value", "valid_bits = { id = 0x200, start_bit = 0,",
       "valid_bits = { id = 0x212, start_bit = 24,", "", "controller.valid_bits",
       "shares bits with another value"},
      {"a heartbeat over a number", "heartbeat = { id = 0x200, start_bit = 8,",
       "heartbeat = { id = 0x211, start_bit = 56,", "", "controller.heartbeat",
       "shares bits with another value"},
      {"a signal in a frame that is sent", "id = 0x280\nstart_bit = 0\n",
       "id = 0x211\nstart_bit = 0\n", "", "controller.signal[x_mm].id",
       "is in a frame that is sent"},
  };
  return table;
}

}  // namespace

TEST_CASE("a travel is in frames, each with the number of its set", "[config][travel][can]") {
  const DaemonConfig config = load_daemon_config(examples / "travel_can.toml");
  REQUIRE(config.estimator.axes.size() == 7);
  CHECK(config.estimator.axes[6].node->position_mm == 600.0);
  CHECK(config.estimator.controller_reads_back);
  const CanControllerConfig& controller = controller_of(config);
  REQUIRE(controller.axes.size() == 2);
  CHECK(controller.offsets() == 7);
  const CanTravel& line = *controller.axes[0].travel;
  CHECK(line.p0_mm == 0.0);
  CHECK(line.nodes_mm == std::vector<double>{0.0, 800.0});
  REQUIRE(line.sent.values.size() == 2);
  CHECK(line.sent.values[1].start_bit == 24);
  CHECK(line.sent.values[1].is_signed);
  REQUIRE(line.sent.numbers.size() == 1);
  CHECK_FALSE(line.sent.numbers[0].is_signed);
  const CanTravel& table = *controller.axes[1].travel;
  CHECK_FALSE(table.p0_mm);
  REQUIRE(table.sent.values.size() == 5);
  CHECK(table.sent.values[3].id == 0x212);
  CHECK(table.sent.numbers.at(1).id == 0x212);
  CHECK(table.applied.values.at(4).id == 0x292);
  CHECK(table.applied.numbers.size() == 2);
}

TEST_CASE("an invalid travel in frames is refused with file, line, key and rule",
          "[config][travel][can]") {
  for (const Broken& broken : broken_frames())
    check_refused(broken, example("travel_can.toml"), "machine.toml", parse_travel);
}

TEST_CASE("a frame of the controller's set must not be one that is sent", "[config][travel][can]") {
  std::string text = example("travel_can.toml");
  for (const char* key : {"k0_um", "slope_um_per_m"})
    text = edited(text, std::string(key) + " = { id = 0x290", std::string(key) + " = { id = 0x210");
  text = edited(text, "set_numbers = [{ id = 0x290", "set_numbers = [{ id = 0x210");
  std::size_t reported = 0;
  for (const Problem& problem : problems_of([&] { return parse_travel(text); }))
    if (problem.rule == "is in a frame that is sent, not received") ++reported;
  CHECK(reported == 3);
}

TEST_CASE("either all sets in frames are read back or none", "[config][travel][can]") {
  std::string text = example("travel_can.toml");
  text.resize(text.find("[axis.table.applied]"));
  CHECK_THROWS_WITH(parse_travel(text), Catch::Contains("must be given for all axes or for none"));
  const auto begin = text.find("[axis.line.applied]");
  text.erase(begin, text.find("[[axis]]\nname = \"z\"") - begin);
  const DaemonConfig config = parse_travel(text);
  CHECK_FALSE(config.estimator.controller_reads_back);
  CHECK_FALSE(controller_of(config).axes[0].reads_back());
}

TEST_CASE("set numbers must not repeat while a read-back is still valid", "[config][travel][can]") {
  const auto with = [](const char* silent_after_s) {
    return parse_travel(
        edited(example("travel_can.toml"), "period_s = 0.1\nvalid",
               std::string("period_s = 0.05\nsilent_after_s = ") + silent_after_s + "\nvalid"));
  };
  CHECK_NOTHROW(with("3270"));
  const auto problems = problems_of([&] { return with("3280"); });
  REQUIRE(problems.size() == 2);  // 65536 periods of 0.05 s, for each axis
  CHECK(problems[0].key == "axis[x].line.set_numbers");
  CHECK(problems[0].rule ==
        "must have more bits: the numbers repeat after 3276.8 s, within "
        "silent_after_s");
}

TEST_CASE("P0 has a place of sufficient range in the frames", "[config][travel][can]") {
  const std::string wide =
      edited(edited(example("travel_can.toml"),
                    "set_numbers = [{ id = 0x210, start_bit = 48, length_bits = 16 }]",
                    "set_numbers = [{ id = 0x210, start_bit = 48, length_bits = 16 }, { id = "
                    "0x214, start_bit = 48, length_bits = 16 }]"),
             "p0_mm = 0.0 ", "p0_mm = 12.5 ");
  const auto with_p0 = [&](const char* place) {
    return parse_travel(
        edited(wide, "# p0_signal_mm = { ... } ", std::string("p0_signal_mm = ") + place));
  };
  const DaemonConfig config =
      with_p0("{ id = 0x214, start_bit = 0, length_bits = 16, scale = 0.1 }");
  CHECK(controller_of(config).axes[0].travel->sent.values.size() == 3);
  CHECK_THROWS_WITH(with_p0("{ id = 0x214, start_bit = 0, length_bits = 16, scale = 0.2 }"),
                    Catch::Contains("must be able to hold p0_mm = 12.5"));
  CHECK_THROWS_WITH(with_p0("{ id = 0x214, start_bit = 0, length_bits = 6, scale = 0.1 }"),
                    Catch::Contains("must be able to hold p0_mm = 12.5"));
}

TEST_CASE("a reload cannot change a place in the frames", "[config][travel][can]") {
  const std::string text = example("travel_can.toml");
  const DaemonConfig running = parse_travel(text);
  CHECK(restart_needed(running, parse_travel(text)).empty());
  const std::vector<std::string> changed{"controller, or registers of the axes"};
  const std::string moved =
      edited(edited(text, "{ id = 0x212, start_bit = 16, length_bits = 16, scale = 0.01 }",
                    "{ id = 0x212, start_bit = 32, length_bits = 16, scale = 0.01 }"),
             "rate_um_per_s_max = 0.5", "rate_um_per_s_max = 0.4");
  CHECK(restart_needed(running, parse_travel(moved)) == changed);
}

TEST_CASE("only a controller on Modbus or CAN accepts a set", "[config][travel]") {
  const std::string text = example("travel_can.toml");
  const auto begin = text.find("[controller]");
  const std::string bridge = text.substr(0, begin) +
                             "[controller]\nname = \"mill\"\nkind = \"linuxcnc\"\n" +
                             text.substr(text.find("[[axis]]"));
  CHECK_THROWS_WITH(parse_travel(bridge), Catch::Contains("takes a set of values as a whole"));
}
