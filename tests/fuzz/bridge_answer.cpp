/// The LinuxCNC bridge with arbitrary answers of the daemon, and its reports of arbitrary states.
#include <cmath>
#include <string>

#include <nlohmann/json.hpp>

#include "common/fuzz.hpp"
#include "linuxcnc/messages.hpp"

using namespace thermocomp;
using namespace thermocomp_linuxcnc;
using nlohmann::json;

namespace {

constexpr std::string_view axes = "xyz";
constexpr std::uint64_t id = 7;
constexpr double offset_mm_max = 0.5;

void check_bridge_answer(std::string_view line) {
  try {
    const thermocomp_linuxcnc::Answer answer = read_answer(line, id, axes, offset_mm_max);
    FUZZ_REQUIRE(answer.offset_mm.size() == axes.size());
    for (const auto& offset_mm : answer.offset_mm)
      FUZZ_REQUIRE(!offset_mm || std::abs(*offset_mm) <= offset_mm_max);
  } catch (const BadAnswer& bad) {
    FUZZ_REQUIRE(*bad.what() != '\0');
  }
}

/// One line; values that are not numbers are reported as unknown.
void check_request(fuzz::ByteFeed& feed) {
  MachineView view;
  const std::uint8_t flags = feed.u8();
  view.taking = (flags & 1) != 0;
  view.enabled = (flags & 2) != 0;
  view.program_running = (flags & 4) != 0;
  view.motion_type = flags >> 3;
  view.spindle_rpm = feed.f64();
  for (std::size_t i = 0; i < axes.size(); ++i)
    view.axes.push_back({feed.f64(), feed.f64(), feed.f64()});
  const std::string line = request_line(feed.u64(), id, axes, view);
  FUZZ_REQUIRE(line.find('\n') == line.size() - 1);
  const json request = json::parse(line, nullptr, false);
  FUZZ_REQUIRE(request.is_object() && request["id"] == id);
  const json& params = request["params"];
  for (const char* table : {"applied_um", "signals"})
    for (const json& value : params[table])
      FUZZ_REQUIRE(value.is_null() || std::isfinite(value.get<double>()));
  FUZZ_REQUIRE(params["applied_um"].size() == axes.size());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  check_bridge_answer({reinterpret_cast<const char*>(data), size});
  fuzz::ByteFeed feed(data, size);
  check_request(feed);
  return 0;
}
