#include "daemon/state/state_file.hpp"

#include <fstream>

#include <catch2/catch.hpp>

#include "history_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

namespace {

PersistentState sample_state() {
  PersistentState state;
  state.enabled = false;
  state.reference_degC = {{"bed_degC", 20.1}, {"spindle_degC", 0.1 + 0.2}};
  state.model_reference_degC = {{"bed_degC", 20.0}};
  state.reference_signals = {{"spindle_rpm", 1.0 / 3.0}};
  state.offset_um = {{"z", -12.345678901234567}};
  state.corridor_um = {{"z", 1.0}};
  state.sign = {{"z", -1.0}};
  state.controller = "controller at \"CAN\"";
  state.temp_degC = {{"bed_degC", 21.7}};
  state.jumped_from_degC = {{"bed_front", 21.0}};
  state.held_degC = {{"t1_degC", 24.5}};
  state.held_signals = {{"spindle_rpm", 1200.0}};
  state.correction = {{"z.gain1", 1.08}, {"z.gain1_sd", 0.04}};
  return state;
}

}  // namespace

TEST_CASE("a saved state is loaded bit for bit", "[state]") {
  const TempFolder folder;
  const PersistentState state = sample_state();
  REQUIRE(save_state_file(folder / "state.json", state).empty());
  const LoadedState loaded = load_state_file(folder / "state.json", {});
  CHECK(loaded.found);
  CHECK(loaded.warning.empty());
  CHECK(loaded.state.enabled == state.enabled);
  CHECK(loaded.state.reference_degC == state.reference_degC);
  CHECK(loaded.state.model_reference_degC == state.model_reference_degC);
  CHECK(loaded.state.reference_signals == state.reference_signals);
  CHECK(loaded.state.offset_um == state.offset_um);
  CHECK(loaded.state.corridor_um == state.corridor_um);
  CHECK(loaded.state.sign == state.sign);
  CHECK(loaded.state.controller == state.controller);
  CHECK(loaded.state.temp_degC == state.temp_degC);
  CHECK(loaded.state.jumped_from_degC == state.jumped_from_degC);
  CHECK(loaded.state.held_degC == state.held_degC);
  CHECK(loaded.state.held_signals == state.held_signals);
  CHECK(loaded.state.correction == state.correction);
}

TEST_CASE("a missing state file is the first start, without a warning", "[state]") {
  const TempFolder folder;
  const LoadedState loaded = load_state_file(folder / "state.json", sample_state());
  CHECK_FALSE(loaded.found);
  CHECK(loaded.warning.empty());
  CHECK_FALSE(loaded.state.enabled);
}

TEST_CASE("an unusable state file is moved aside and reported", "[state]") {
  const std::string head = R"({"program":"thermocomp",)";
  const std::string without_correction =
      R"(,"model_reference_degC":{},"reference_signals":{},"offset_um":{},"temp_degC":{},)"
      R"("held_degC":{},"held_signals":{})";
  const std::string rest = without_correction + R"(,"correction":{}})";
  const std::string good = R"("reference_degC":{})" + rest;
  const std::string text = GENERATE_COPY(
      std::string(), std::string("{"), std::string("[]"), std::string("null"),
      std::string(R"({"enabled": true})"), std::string(R"({"program":"other","format":1})"),
      head + R"("format":0,"enabled":true,)" + good, head + R"("format":1,"enabled":1,)" + good,
      head + R"("format":1e300,"enabled":true,)" + good,
      head + R"("format":)" + std::string(400000, '[') + std::string(400000, ']') +
          R"(,"enabled":true,)" + good,
      head + R"("format":1,"enabled":true,"reference_degC":{"a":"hot"})" + rest,
      head + R"("format":1,"enabled":true,"reference_degC":3)" + rest,
      head + R"("format":1,"enabled":true,"reference_degC":{})" + without_correction + "}");
  const TempFolder folder;
  const std::filesystem::path file = folder / "state.json";
  std::ofstream(file) << head << R"("format":1,"enabled":true,)" << good;
  REQUIRE(load_state_file(file, sample_state()).found);
  std::ofstream(file) << text;
  const LoadedState loaded = load_state_file(file, sample_state());
  CHECK_FALSE(loaded.found);
  CHECK(loaded.warning.find("state.json cannot be used") != std::string::npos);
  CHECK(loaded.state.offset_um == sample_state().offset_um);
  CHECK_FALSE(std::filesystem::exists(file));
  CHECK(std::filesystem::exists(file.string() + ".unusable"));
}

TEST_CASE("the state of a newer version is kept under a name of its own", "[state]") {
  const TempFolder folder;
  const std::filesystem::path file = folder / "state.json";
  const std::string newer = R"({"program":"thermocomp","format":2,"moved":"elsewhere"})";
  std::ofstream(file) << newer;
  const LoadedState loaded = load_state_file(file, sample_state());
  CHECK_FALSE(loaded.found);
  CHECK(loaded.damaged);
  CHECK_THAT(loaded.warning, Catch::Contains("newer thermocompd wrote it (format 2") &&
                                 Catch::Contains("state.json.format-2"));
  std::ofstream(file) << "damaged";
  CHECK(load_state_file(file, sample_state()).damaged);
  std::ifstream in(folder / "state.json.format-2");
  CHECK(std::string{std::istreambuf_iterator<char>(in), {}} == newer);
}

TEST_CASE("a state that cannot be written is an error and leaves the old file", "[state]") {
  const TempFolder folder;
  const std::filesystem::path file = folder / "state.json";
  REQUIRE(save_state_file(file, sample_state()).empty());
  std::filesystem::create_directory(file.string() + ".new");  // blocks the new file
  CHECK_FALSE(save_state_file(file, PersistentState{}).empty());
  CHECK(load_state_file(file, {}).state.offset_um == sample_state().offset_um);
  CHECK_FALSE(save_state_file(folder / "missing/state.json", sample_state()).empty());
}

TEST_CASE("the reference's origin is loaded, and an unreadable one is ignored", "[state]") {
  const TempFolder folder;
  const auto file = folder / "state.json";
  const ReferenceRecord taken{1772350211.5, ReferenceOrigin::command, "bed_degC +12.0 K/h"};
  REQUIRE(save_state_file(file, sample_state(), false, taken).empty());
  LoadedState loaded = load_state_file(file, {});
  CHECK(loaded.reference.wall_s == 1772350211.5);
  CHECK(loaded.reference.origin == ReferenceOrigin::command);
  CHECK(loaded.reference.changed == taken.changed);
  REQUIRE(save_state_file(file, sample_state()).empty());
  CHECK_FALSE(load_state_file(file, {}).reference.is_known());
  const auto* record = GENERATE("7", "{}", R"({"wall_s": "noon", "by": "operator"})",
                                R"({"wall_s": 1.0, "by": 2})", R"({"wall_s": 1.0, "by": "who"})");
  std::ifstream in(file);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  text.insert(text.find('{') + 1, std::string("\"reference_taken\": ") + record + ",");
  std::ofstream(file) << text;
  loaded = load_state_file(file, {});
  CHECK(loaded.found);
  CHECK_FALSE(loaded.damaged);
  CHECK(loaded.state.reference_degC == sample_state().reference_degC);
  CHECK_FALSE(loaded.reference.is_known());
}
