#include "config/daemon/daemon_config.hpp"

#include <functional>
#include <set>

#include "config/buses/buses.hpp"
#include "config/model/model_file.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

DaemonConfig parse(const std::string& text, const std::string& model = "small_machine_model.toml") {
  return parse_daemon_config(text, "machine.toml", example(model), "model.toml");
}

/// Examples of daemon configurations; the others are models or for other programs.
std::vector<std::filesystem::path> configurations() {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(examples)) {
    const std::string text = text_of(entry.path());
    if (text.find("\n[[bus]]\n") != std::string::npos &&
        text.find("\n[model]\n") != std::string::npos) {
      paths.push_back(entry.path());
    }
  }
  return paths;
}

DaemonConfig edited_machine(const std::string& from, const std::string& to) {
  return parse(edited(example("small_machine.toml"), from, to));
}

}  // namespace

TEST_CASE("every example loads", "[config]") {
  const std::vector<std::filesystem::path> paths = configurations();
  for (const auto& path : paths) {
    INFO(path);
    CHECK_NOTHROW(load_daemon_config(path));
  }
  CHECK(paths.size() >= 4);
}

TEST_CASE("every kind of bus has a commented example", "[config]") {
  std::set<std::string> kinds;
  for (const auto& path : configurations())
    for (const BusConfig& bus : load_daemon_config(path).buses) {
      const BusOutline outline = outline_of(bus);
      kinds.insert(outline.kind);
      CHECK(outline.units > 0);
    }
  for (const sections::BusKind& kind : sections::bus_kinds()) {
    INFO(kind.name);
    CHECK(kinds.count(kind.name) == 1);
  }
  CHECK(kinds.size() == sections::bus_kinds().size());
}

TEST_CASE("the small machine is loaded as in its file", "[config]") {
  const DaemonConfig config = load_daemon_config(examples / "small_machine.toml");
  CHECK(config.loop.rate_hz == 100);
  CHECK(config.estimator.axes[0].limiter.step_s_max == 0.02);  // two cycles
  CHECK(config.model_file == examples / "small_machine_model.toml");
  CHECK(config.text == example("small_machine.toml"));
  CHECK(config.model_text == example("small_machine_model.toml"));
  CHECK(config.model_checksum == sha256_hex(config.model_text));
  REQUIRE(config.buses.size() == 2);
  const auto& over_tcp = std::get<ModbusBusConfig>(config.buses[0]);
  const auto& serial = std::get<ModbusBusConfig>(config.buses[1]);
  const ModbusDeviceConfig& bed = over_tcp.devices.at(0);
  REQUIRE(bed.channels.size() == 4);
  CHECK(bed.channels[1].sensor == 1);
  CHECK(bed.channels[1].scale == 0.1);
  REQUIRE(bed.channels[1].sentinels.size() == 1);
  CHECK(bed.channels[1].sentinels[0].code == 32767);
  CHECK(bed.channels[1].sentinels[0].fault == Fault::open_circuit);
  const ModbusDeviceConfig& column = serial.devices.at(0);
  REQUIRE(column.channels.size() == 4);
  CHECK(column.channels[3].sensor == 7);
  CHECK(column.channels[3].address == 6);
  CHECK(column.channels[3].encoding == Encoding::float32);
  CHECK(column.channels[3].word_order == WordOrder::cdab);
  const auto& line = serial.line;
  CHECK(std::get<ModbusRtu>(line.link).parity == 'E');
  CHECK(line.inter_frame_delay_ms == 2.0);
  CHECK(over_tcp.line.inter_frame_delay_ms < 0);
}

TEST_CASE("a sensor's own keys override those for every sensor", "[config]") {
  const DaemonConfig config = load_daemon_config(examples / "small_machine.toml");
  const auto& sensors = config.estimator.sensors;
  REQUIRE(sensors.size() == 8);
  CHECK(sensors[3].smoothing.half_width_K == 1.0);
  CHECK(sensors[3].smoothing.samples == 6);
  CHECK(sensors[2].smoothing.half_width_K == 0.3);
  CHECK(sensors[6].screening.rate_K_per_s_max == 1.0);
  CHECK(sensors[7].screening.rate_K_per_s_max == 0.5);
}

TEST_CASE("axes, blocks and signals keep their order and places", "[config]") {
  const DaemonConfig config = load_daemon_config(examples / "small_machine.toml");
  REQUIRE(config.estimator.blocks.size() == 6);
  CHECK(config.estimator.blocks[5].sensors == std::vector<std::size_t>{6, 7});
  CHECK(config.estimator.signals ==
        std::vector<std::string>{"x_mm", "spindle_rpm", "cutting_on", "compensation_off_on"});
  CHECK(config.estimator.controller_reads_back);
  const auto& controller = std::get<ModbusControllerConfig>(config.controller);
  REQUIRE(controller.axes.size() == 3);
  CHECK(controller.axes[2].offset.address == 4);
  CHECK(controller.axes[2].applied.has_value());
  CHECK(controller.signals.at(2).value.table == ModbusTable::discrete_input);
  CHECK(controller.heartbeat->address == 11);
}

TEST_CASE("the CAN example is loaded as in its file", "[config][can]") {
  const DaemonConfig config = load_daemon_config(examples / "can.toml");
  REQUIRE(config.buses.size() == 1);
  const auto& channels = std::get<CanBusConfig>(config.buses[0]).devices.at(0).channels;
  REQUIRE(channels.size() == 2);
  CHECK(channels[1].signal.id == 0x181);
  CHECK(channels[1].signal.start_bit == 16);
  CHECK(channels[1].signal.length_bits == 16);
  CHECK(channels[1].signal.sentinels.at(0).code == 0x7FFF);
  const auto& controller = std::get<CanControllerConfig>(config.controller);
  CHECK(controller.axes.at(0).applied->byte_order == ByteOrder::big_endian);
  CHECK_FALSE(controller.valid_bits->is_signed);
  CHECK(config.estimator.compensation.hold_while_cutting);
}

TEST_CASE("sensors of a CAN bus can use names of its DBC file", "[config][can][dbc]") {
  const DaemonConfig config = load_daemon_config(examples / "can_dbc.toml");
  const auto& channels = std::get<CanBusConfig>(config.buses.at(0)).devices.at(0).channels;
  REQUIRE(channels.size() == 2);
  CHECK(channels[0].signal.id == 0x181);
  CHECK(channels[0].signal.scale == 0.1);
  CHECK(channels[0].signal.sentinels.at(0).code == 0x7FFF);
  CHECK(channels[0].counter == CanField{60, 4, ByteOrder::little_endian});
  CHECK(channels[1].sensor == 1);
  CHECK(channels[1].signal.id == 0x18FEF1FE);
  CHECK(channels[1].signal.extended_id);
  CHECK(channels[1].signal.fd);
  CHECK(channels[1].signal.offset == Approx(0.0).margin(1e-9));  // K in the file
  CHECK(channels[1].signal.selectors.at(0).pages.at(0).first == 2);
  CHECK(channels[1].counter == CanField{120, 4, ByteOrder::little_endian});
}

TEST_CASE("a replay needs no DBC file", "[config][can][dbc]") {
  CHECK_NOTHROW(parse(example("can_dbc.toml"), "column_model.toml"));
}

TEST_CASE("a dry run reads back the offered offsets", "[config]") {
  const DaemonConfig config = load_daemon_config(examples / "modbus_rtu.toml");
  CHECK(std::get<DryRunControllerConfig>(config.controller).axes == 1);
  CHECK(config.estimator.controller_reads_back);
}

TEST_CASE("a dry run is possible with any controller", "[config]") {
  for (const char* name :
       {"small_machine.toml", "modbus_tcp.toml", "can.toml", "piezo.toml", "s7.toml"}) {
    INFO(name);
    const std::string text = example(name);
    const bool is_small = std::string(name) == "small_machine.toml";
    const char* model = is_small ? "small_machine_model.toml" : "column_model.toml";
    const std::string dry = is_small
                                ? edited(text, "dry_run = false ", "dry_run = true ")
                                : edited(text, "[controller]\n", "[controller]\ndry_run = true\n");
    const DaemonConfig real = parse(text, model);
    const DaemonConfig config = parse(dry, model);
    CHECK_FALSE(real.dry_run);
    CHECK(config.dry_run);
    CHECK(config.controller == real.controller);  // all places are checked
    CHECK(config.estimator.signals == real.estimator.signals);
    CHECK(config.estimator.controller_reads_back);
    // Without an offset at the machine, a measured remainder is the total displacement.
    CHECK(real.estimator.correction.measured == MeasuredMeaning::remaining);
    CHECK(config.estimator.correction.measured == MeasuredMeaning::total);
    CHECK(restart_needed(real, config) == std::vector<std::string>{"dry_run of the controller"});
  }
  CHECK(load_daemon_config(examples / "modbus_rtu.toml").dry_run);  // the kind without a controller
}

TEST_CASE("without an applied offset the controller has no read-back", "[config]") {
  const std::string text = edited(
      example("modbus_tcp.toml"),
      "applied = { table = \"input\", address = 0, encoding = \"int16\", scale = 0.01 }\n", "");
  CHECK_FALSE(parse(text, "column_model.toml").estimator.controller_reads_back);
}

TEST_CASE("values at their bounds are accepted", "[config]") {
  const std::vector<std::pair<std::string, std::string>> edits = {
      {"rate_hz = 100", "rate_hz = 1"},
      {"rate_hz = 100", "rate_hz = 1000.0"},
      {"priority = 60", "priority = 98"},
      {"commit_s = 5.0", "commit_s = 10"},
      {"commit_s = 5.0", "commit_s = 0.1"},
      {"unit = 7", "unit = 247"},
      {"unit = 1\nperiod_s", "unit = 255\nperiod_s"},
      {"unit = 1\nperiod_s", "unit = 0\nperiod_s"},
      {"address = 6\n", "address = 65534\n"},
      {"address = 1\n", "address = 0\n"},  // two sensors on the same register
      {"port = 502 ", "port = 65535 "},
      {"host = \"192.168.10.20\"", "host = \"cabinet-1.local\""},
      {"host = \"192.168.10.20\"", "host = \"::1\""},
      {"offset_um_max = 60.0", "offset_um_max = 500.0"},
      {"offset_um_max = 60.0", "offset_um_max = 60"},
      {"sign = 1 ", "sign = -1 "},
      {"samples = 6", "samples = 32"},
      {"samples = 6", "samples = 3"},
      {"stale_after_s = 5.0", "stale_after_s = 3600"},
      {"stuck_after_s = 0.0", "stuck_after_s = 1e6"},
      {"temp_degC_min = -30.0", "temp_degC_min = -273.15"},
      {"open_circuit_codes = [32767]", "open_circuit_codes = [32767, -32768, 0]"},
      {"form = \"sliding_line\"", "form = \"off\""},
  };
  for (const auto& [from, to] : edits) {
    INFO(to);
    CHECK_NOTHROW(edited_machine(from, to));
  }
}

TEST_CASE("keys with a \"default\" comment may be left out without a change", "[config]") {
  const std::string full = example("small_machine.toml");
  std::string text;
  std::size_t dropped = 0;
  std::size_t begin = 0;
  while (begin < full.size()) {
    const std::size_t end = full.find('\n', begin) + 1;
    const std::string line = full.substr(begin, end - begin);
    begin = end;
    const bool has_default = line.find("# default") != std::string::npos && line.front() != '#';
    dropped += has_default ? 1 : 0;
    if (!has_default) text += line;
  }
  CHECK(dropped > 40);
  const DaemonConfig a = parse(full);
  const DaemonConfig b = parse(text);
  CHECK(a.loop == b.loop);
  CHECK(a.buses == b.buses);
  CHECK(a.controller == b.controller);
  CHECK(a.socket == b.socket);
  CHECK(a.history == b.history);
  CHECK(a.estimator.compensation.hold_s == b.estimator.compensation.hold_s);
  CHECK(a.estimator.sensors[0].screening.stale_after_s ==
        b.estimator.sensors[0].screening.stale_after_s);
  CHECK(a.estimator.correction == b.estimator.correction);
  CHECK(a.estimator.correction.form == CorrectionForm::off);
}

TEST_CASE("a correction's groups consist of inputs of the model, each named once", "[config]") {
  const auto with = [](const std::string& correction) {
    std::string text = example("small_machine.toml");
    text.erase(text.find("[correction]"),
               text.find("# ----", text.find("[correction]")) - text.find("[correction]"));
    return text.append("\n[correction]\n").append(correction);
  };
  const std::string input = load_daemon_config(examples / "small_machine.toml").model.inputs[0];
  const std::string group = "[[correction.group]]\ninputs = [\"" + input + "\"]\n";
  const DaemonConfig config = parse(with("form = \"recursive\"\n" + group));
  CHECK(config.estimator.correction.form == CorrectionForm::recursive);
  CHECK(config.estimator.correction.groups == std::vector<std::vector<std::string>>{{input}});
  const std::vector<std::pair<std::string, const char*>> bad = {
      {"form = \"recursive\"\n", "must be 1 to 4"},
      {"form = \"two_phase\"\n" + group, "must be two"},
      {"form = \"recursive\"\n" + group + group, "is named already"},
      {"form = \"recursive\"\n[[correction.group]]\ninputs = [\"t99_degC\"]\n",
       "must be an input of the model"},
      {"gain_min = 2.0\n", "must be in [0, 1]"},
      {"gain = 2.0\n", "gain"},
  };
  for (const auto& [text, rule] : bad) {
    INFO(text);
    CHECK_THROWS_WITH(parse(with(text)), Catch::Contains(rule));
  }
}

TEST_CASE("two sensors on one register cause a warning", "[config]") {
  const std::string text = example("modbus_tcp.toml");
  CHECK(parse(text, "column_model.toml").remarks.empty());
  const auto remarks =
      parse(edited(text, "address = 1\nstatus", "address = 0\nstatus"), "column_model.toml")
          .remarks;
  REQUIRE(remarks.size() == 1);
  CHECK_THAT(remarks.front(),
             Catch::EndsWith(": sensor[spindle]: reads the same value as sensor[column]"));
}

TEST_CASE("places in a data block are bytes, each written for one purpose", "[config]") {
  const DaemonConfig config = load_daemon_config(examples / "s7.toml");
  const auto& controller = std::get<ModbusControllerConfig>(config.controller);
  const S7Block* block = s7_of(controller.line);
  REQUIRE(block != nullptr);
  CHECK(*block == S7Block{100, 0, 1});
  CHECK(controller.heartbeat->address == 3);  // words
  CHECK(config.estimator.controller_reads_back);
  const std::string text = example("s7.toml");
  const std::vector<std::pair<std::pair<std::string, std::string>, const char*>> bad = {
      {{"heartbeat = { address = 6", "heartbeat = { address = 4"}, "byte 4 is written by"},
      {{"heartbeat = { address = 6", "heartbeat = { address = 7"}, "must be even"},
      {{"db = 100", "db = 0"}, "[1, 65535]"},
      {{"db = 100", ""}, "must be given"},
      {{"slot = 1", "slot = 32"}, "[0, 31]"},
      {{"db = 100", "db = 100\nunit = 1"}, "does not apply to kind = \"s7\""},
      {{"address = 12\n", "address = 12\ntable = \"holding\"\n"}, "does not apply"},
  };
  for (const auto& [edit, rule] : bad) {
    INFO(edit.second);
    CHECK_THROWS_WITH(parse(edited(text, edit.first, edit.second), "column_model.toml"),
                      Catch::Contains(rule));
  }
}

TEST_CASE("a piezo's curve is read, must rise, and must reach the axis' bound", "[config]") {
  const DaemonConfig config = load_daemon_config(examples / "piezo.toml");
  const auto& controller = std::get<ModbusControllerConfig>(config.controller);
  REQUIRE(controller.axes.at(0).piezo);
  CHECK(controller.axes[0].piezo->curve_V.size() == 7);
  CHECK_FALSE(config.estimator.controller_reads_back);
  const std::string text = example("piezo.toml");
  const std::string shown = "offset_um_max = 20.0\napplied = { table = \"input\", address = 0, ";
  CHECK(parse(edited(text, "offset_um_max = 20.0", shown + "encoding = \"uint16\", scale = 0.1 }"),
              "column_model.toml")
            .estimator.controller_reads_back);
  const std::vector<std::pair<std::pair<std::string, std::string>, const char*>> bad = {
      {{"offset_um_max = 20.0", "offset_um_max = 30.0"}, "reaches from -22 to 22.8"},
      {{"-9.4", "-19.4"}, "can be inverted"},
      {{"curve_V = [0,", "curve_V = [1,"}, "must begin at 0 V"},
      {{"settle_s = 0.2", "settle_s = -1"}, "settle_s"},
      {{"scale = 0.01 }  # volts", "scale = 0.001 }"}, "hold the curve's voltages"},
      {{"offset_um_max = 20.0", shown + "encoding = \"uint16\", scale = 0.001 }"},
       "hold the curve's voltages"},
      {{"step_um = 0.2", "step_um = 0.2\ntolerance_V = 0"}, "tolerance_V"},
  };
  for (const auto& [edit, rule] : bad) {
    INFO(edit.second);
    CHECK_THROWS_WITH(parse(edited(text, edit.first, edit.second), "column_model.toml"),
                      Catch::Contains(rule));
  }
}

TEST_CASE("an axis whose controller interpolates along the travel becomes its nodes",
          "[config][travel]") {
  const DaemonConfig config = load_daemon_config(examples / "travel.toml");
  const std::vector<AxisConfig>& axes = config.estimator.axes;
  REQUIRE(axes.size() == 7);
  CHECK(axes[0].name == "x_1");
  CHECK(axes[0].node->axis == "x");
  CHECK(axes[1].node->position_mm == 800.0);
  CHECK(axes[1].node->form == TravelForm::line);
  CHECK(axes[6].name == "z_5");
  CHECK(axes[6].node->position == "z_mm");
  CHECK(axes[6].limiter.offset_um_max == 60.0);
  CHECK(config.estimator.controller_reads_back);
  const auto& controller = std::get<ModbusControllerConfig>(config.controller);
  REQUIRE(controller.axes.size() == 2);
  CHECK(controller.offsets() == 7);
  CHECK(controller.axes[0].travel->p0_mm == 0.0);
  CHECK(controller.axes[0].travel->values.size() == 3);
  CHECK(controller.axes[0].travel->end.address == 107);
  CHECK_FALSE(controller.axes[1].travel->p0_mm);
  CHECK(controller.axes[1].travel->values.at(4).address == 125);
  CHECK(controller.axes[1].travel->applied.at(4).address == 125);
}

TEST_CASE("an invalid travel is refused with key and rule", "[config][travel]") {
  const std::string text = example("travel.toml");
  const std::vector<std::pair<std::pair<std::string, std::string>, const char*>> bad = {
      {{"travel_mm = [0.0, 800.0]", "travel_mm = [800.0, 0.0]"}, "travel_mm"},
      {{"travel_mm = [0.0, 800.0]", "travel_mm = [0.0, 400.0, 800.0]"}, "both ends of the travel"},
      {{"p0_mm = 0.0 ", "p0_mm = -1.0 "}, "must be within travel_mm"},
      {{"position = \"x_mm\"", "position = \"y_mm\""},
       "must be a position of the model: x_mm, z_mm"},
      {{"position = \"x_mm\"", "position = \"column_degC\""}, "must be a position"},
      {{"nodes_mm = [0.0, 150.0, 300.0, 450.0, 600.0]", "nodes_mm = [0.0]"}, "2 to 16 nodes"},
      {{"nodes_mm = [0.0, 150.0, 300.0, 450.0, 600.0]",
        "nodes_mm = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14]"},
       "at most 16 axes, nodes of travels counted"},
      {{"address = 103, encoding = \"int32\", scale = 0.001 }\np0_r",
        "address = 104, encoding = \"int32\", scale = 0.001 }\np0_r"},
       "must begin at register 103"},
      {{"address = 126, encoding", "address = 127, encoding"}, "must begin at register 126"},
      {{"address = 107, encoding = \"uint16\"", "address = 107, encoding = \"uint32\""},
       "must have the encoding of `begin`"},
      {{"slope_um_per_m = { table = \"holding\", address = 103, encoding = \"int32\", scale = "
        "0.001",
        "slope_um_per_m = { table = \"holding\", address = 103, encoding = \"int32\", scale = 0.2"},
       "one count moves the end of the travel by 0.16 um"},
      {{"address = 121, encoding = \"int16\", scale = 0.01",
        "address = 121, encoding = \"int16\", scale = 0.001"},
       "must be able to hold -offset_um_max"},
      {{"address = 120, encoding", "address = 107, encoding"}, "is written by"},
      {{"[axis.table] ",
        "offset = { table = \"holding\", address = 1, encoding = \"int16\" }\n"
        "[axis.table] "},
       "cannot be combined with"},
      {{"name = \"z\"", "name = \"x_2\""}, "nodes"},
  };
  for (const auto& [edit, rule] : bad) {
    INFO(edit.second);
    CHECK_THROWS_WITH(parse(edited(text, edit.first, edit.second), "travel_model.toml"),
                      Catch::Contains(rule));
  }
  const std::string play =
      example("travel_model.toml") +
      "\n[[term]]\nkind = \"hysteresis\"\nsubject = \"x_um\"\nwidth_um = 2.0\n";
  CHECK_THROWS_WITH(parse_daemon_config(text, "machine.toml", play, "model.toml"),
                    Catch::Contains("is no curve"));
}

TEST_CASE("a register with too coarse steps for the offset is refused", "[config]") {
  const std::string text = example("small_machine.toml");
  const std::size_t line = text.find("\noffset = { table");
  REQUIRE(line != std::string::npos);
  const auto with = [&](const std::string& place) {
    std::string changed = text;
    changed.replace(line + 1, text.find('\n', line + 1) - line - 1,
                    "offset = { table = \"holding\", address = 900, " + place + " }");
    return parse(changed);
  };
  CHECK_THROWS_WITH(with("encoding = \"int16\", scale = 5.0"),
                    Catch::Contains("one count of 5 um: must be at most"));
  CHECK_THROWS_WITH(with("encoding = \"int32\", scale = 1e10"), Catch::Contains("one count of"));
  CHECK_THROWS_WITH(with("encoding = \"int32\", scale = -1e10"), Catch::Contains("one count of"));
  CHECK_THROWS_WITH(with("encoding = \"float32\", scale = 1e-40"),
                    Catch::Contains("must be able to hold -offset_um_max"));
  CHECK_THROWS_WITH(with("encoding = \"float32\", scale = 1e46"), Catch::Contains("one count of"));
  for (const char* works :
       {"encoding = \"int16\", scale = 1.0", "encoding = \"int16\", scale = -0.01",
        "encoding = \"float32\"", "encoding = \"float32\", scale = 1000.0",
        "encoding = \"float64\", scale = 1e-3"})
    CHECK_NOTHROW(with(works));
}

TEST_CASE("keys of cycles are refused if the offset follows the model", "[config]") {
  CHECK_THROWS_WITH(
      edited_machine("update = \"continuous\"", "update = \"continuous\"\ncycles_per_update = 2"),
      Catch::Contains("does not apply"));
  const DaemonConfig config =
      edited_machine("update = \"continuous\"",
                     "update = \"each_cycle\"\ncycles_per_update = 2\ncycle_ahead = 1.0");
  CHECK(config.estimator.compensation.update == UpdateRule::each_cycle);
  CHECK(config.estimator.compensation.cycles_per_update == 2);
  CHECK_THROWS_WITH(edited_machine("update = \"continuous\"", "cycle_end_signal = \"nothing_on\""),
                    Catch::Contains("must be a signal of the controller"));
}

TEST_CASE("the texts of a history give the same configuration as the files", "[config]") {
  const DaemonConfig loaded = load_daemon_config(examples / "small_machine.toml");
  const DaemonConfig parsed = parse_daemon_config(loaded.text, loaded.file.string(),
                                                  loaded.model_text, loaded.model_file.string());
  CHECK(restart_needed(loaded, parsed).empty());
  CHECK(parsed.model_checksum == loaded.model_checksum);
  CHECK(write_model(parsed.model) == write_model(loaded.model));
}

TEST_CASE("a reload takes over model, blocks, screening, smoothing, limits and policy",
          "[config]") {
  const DaemonConfig running = parse(example("small_machine.toml"));
  const std::vector<std::pair<std::string, std::string>> edits = {
      {"log_level = \"info\"", "log_level = \"debug\""},
      {"sensors = [\"bed_front\", \"bed_rear\"]", "sensors = [\"bed_front\"]"},
      {"rate_K_per_s_max = 0.5 ", "rate_K_per_s_max = 0.7 "},
      {"form = \"sliding_line\"", "form = \"off\""},
      {"offset_um_max = 60.0", "offset_um_max = 30.0"},
      {"on_loss = \"hold\"", "on_loss = \"ramp_to_zero\""},
      {"on_stop = \"hold\"", "on_stop = \"ramp_to_zero\""},
  };
  for (const auto& [from, to] : edits) {
    INFO(to);
    CHECK(restart_needed(running, edited_machine(from, to)).empty());
  }
}

TEST_CASE("a candidate that cannot run affects nothing else and has its reason",
          "[config][candidate]") {
  const ExampleFolder folder({"small_machine.toml", "small_machine_model.toml"});
  folder.edit("small_machine.toml", "file = \"small_machine_model.toml\"",
              "file = \"small_machine_model.toml\"\ncandidate = \"new.toml\"");
  const DaemonConfig missing = folder.load();
  REQUIRE(missing.candidate);
  CHECK_THAT(missing.candidate->problem, Catch::Contains("new.toml"));
  CHECK(missing.remarks.size() == 1);

  const std::string model = example("small_machine_model.toml");
  const auto problem_of = [&](const std::string& text) {
    folder.write("new.toml", text);
    return folder.load().candidate->problem;
  };
  CHECK(problem_of(model).empty());
  CHECK(folder.load().remarks.empty());
  CHECK_THAT(problem_of("nonsense"), Catch::Contains("new.toml"));
  CHECK_THAT(problem_of(edited(model, missing.model.outputs.front(), "other_um")),
             Catch::Contains("other_um") || Catch::Contains("output"));
  // A temperature without a sensor.
  CHECK_THAT(problem_of(edited(model, missing.model.inputs.front(), "other_degC")),
             Catch::Contains("other_degC"));
}

TEST_CASE("changes that need a restart are named", "[config]") {
  const DaemonConfig running = parse(example("small_machine.toml"));
  const std::vector<std::vector<std::string>> edits = {
      {"rate_hz = 100", "rate_hz = 200", "loop"},
      {"timeout_ms = 200", "timeout_ms = 300", "bus cabinet"},
      {"address = 6\n", "address = 8\n", "bus column_line"},
      {"period_s = 0.1 ", "period_s = 0.2 ", "controller, or registers of the axes"},
      {"offset = { table = \"holding\", address = 4", "offset = { table = \"holding\", address = 6",
       "controller, or registers of the axes"},
      {"name = \"z\"", "name = \"w\"", "names, count or order of the axes"},
      {"sign = 1 ", "sign = -1 ", "sign of an axis"},
      {"path = \"/run/thermocomp/status.sock\"", "path = \"/run/other.sock\"", "socket"},
      {"commit_s = 5.0", "commit_s = 6.0", "history"},
      {"state_file = \"/var/lib/thermocomp/state.json\"", "state_file = \"/var/lib/x.json\"",
       "state_file"},
  };
  for (const auto& edit : edits) {
    INFO(edit[1]);
    CHECK(restart_needed(running, edited_machine(edit[0], edit[1])) ==
          std::vector<std::string>{edit[2]});
  }
  std::string text = example("small_machine.toml");
  text = edited(text, "name = \"spindle_rear\"", "name = \"spindle_back\"");
  text = edited(text, "\"spindle_rear\"]", "\"spindle_back\"]");
  CHECK(restart_needed(running, parse(text)) ==
        std::vector<std::string>{"names or order of the sensors"});
}

TEST_CASE("a file that is named twice is refused, through any path or link", "[config][files]") {
  const auto error_with = [&](const std::string& history, const std::string& state) {
    const ExampleFolder folder({"small_machine.toml", "small_machine_model.toml"});
    folder.name_files(history, state);
    return folder.problems_text();
  };
  CHECK(error_with("h.db", "s.json").empty());
  CHECK_THAT(error_with("small_machine_model.toml", "s.json"),
             Catch::Contains("history.file") && Catch::Contains("same file as model.file"));
  CHECK_THAT(error_with("./sub/../small_machine.toml", "s.json"),
             Catch::Contains("same file as this configuration"));
  CHECK_THAT(error_with("h.db", "h.db"), Catch::Contains("same file as state_file"));
  CHECK_THAT(error_with("h.db", "h.db-wal"), Catch::Contains("same file"));
  CHECK_THAT(error_with("link_to_model", "s.json"), Catch::Contains("same file as model.file"));
  CHECK_THAT(error_with("hard_link_to_model", "s.json"),
             Catch::Contains("same file as model.file"));
  CHECK_THAT(error_with("link_to_nothing", "nothing"), Catch::Contains("same file as state_file"));
  CHECK_THAT(error_with("loop_a", "s.json"), Catch::Contains("loop of links"));
  CHECK_THAT(error_with("h.db", "loop_a/s.json"), Catch::Contains("loop of links"));
  CHECK_THAT(error_with("pipe", "s.json"), Catch::Contains("must be a regular file"));
}
