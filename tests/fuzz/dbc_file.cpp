/// DBC files: refused with file, line and rule, or their signals can be decoded from any frame.
#include "config/bus_files/dbc_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "common/fuzz.hpp"
#include "drivers/can/signal_codec.hpp"

using namespace thermocomp;

namespace {

/// True if configurations refuse it: the signal or, without a name, its whole message.
bool is_flawed(const DbcFile& file, const std::string& message, const std::string& signal) {
  return std::any_of(file.flaws.begin(), file.flaws.end(), [&](const DbcFlaw& flaw) {
    return flaw.message == message && (flaw.signal.empty() || flaw.signal == signal);
  });
}

void check_signal(const DbcMessage& message, const DbcSignal& signal) {
  FUZZ_REQUIRE(!signal.name.empty() && signal.line >= message.line);
  if (message.bytes > can_bytes_max) return;  // configurations that use it are refused
  check(signal.place);
  FUZZ_REQUIRE(bytes_needed(signal.place) <= message.bytes);
  FUZZ_REQUIRE(signal.place.id == message.id && signal.place.extended_id == message.extended);
  std::array<std::uint8_t, can_bytes_max> data{};
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::uint8_t>(37 * i + 11);
  const std::span<const std::uint8_t> frame(data.data(), message.bytes);
  if (!carries(frame, signal.place)) return;
  const CanValue value = decode(frame, signal.place);
  FUZZ_REQUIRE(std::isfinite(value.value) == (value.fault == Fault::none));
  FUZZ_REQUIRE(value.fault != Fault::bad_frame);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  constexpr const char* name = "machine.dbc";
  const DbcFile file = read_dbc_text(text, name);
  FUZZ_REQUIRE(file.flaws.size() <= 1001);
  std::vector<Problem> problems;
  for (const DbcFlaw& flaw : file.flaws) problems.push_back(flaw.problem);
  const fuzz::NamedText files[] = {{name, text}};
  if (!problems.empty()) fuzz::check_problems(problems, files);
  for (const DbcMessage& message : file.messages) {
    if (is_flawed(file, message.name, "")) continue;
    FUZZ_REQUIRE(file.find(message.name) == &message);
    for (const DbcSignal& signal : message.signals) {
      if (is_flawed(file, message.name, signal.name)) continue;
      FUZZ_REQUIRE(message.find(signal.name) == &signal);
      check_signal(message, signal);
    }
  }
  return 0;
}
