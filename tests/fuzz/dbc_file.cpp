/// DBC files: refused by file, line and rule, or signals that can be decoded from any frame.
#include "config/bus_files/dbc_file.hpp"

#include <array>
#include <cmath>
#include <string>

#include "common/fuzz.hpp"
#include "drivers/can/signal_codec.hpp"

using namespace thermocomp;

namespace {

void check_signal(const DbcMessage& message, const DbcSignal& signal) {
  FUZZ_PROMISE(!signal.name.empty() && signal.line >= message.line);
  if (message.bytes > can_bytes_max) return;  // naming one of its signals is refused
  check(signal.place);
  FUZZ_PROMISE(bytes_needed(signal.place) <= message.bytes);
  FUZZ_PROMISE(signal.place.id == message.id && signal.place.extended_id == message.extended);
  std::array<std::uint8_t, can_bytes_max> data{};
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::uint8_t>(37 * i + 11);
  const std::span<const std::uint8_t> frame(data.data(), message.bytes);
  if (!carries(frame, signal.place)) return;
  const CanValue value = decode(frame, signal.place);
  FUZZ_PROMISE(std::isfinite(value.value) == (value.fault == Fault::none));
  FUZZ_PROMISE(value.fault != Fault::bad_frame);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  constexpr const char* name = "machine.dbc";
  const DbcReading reading = read_dbc_text(text, name);
  if (!reading.problems.empty()) {
    const fuzz::NamedText files[] = {{name, text}};
    fuzz::check_problems(reading.problems, files);
    return 0;
  }
  for (const DbcMessage& message : reading.file.messages) {
    FUZZ_PROMISE(reading.file.find(message.name) == &message);
    for (const DbcSignal& signal : message.signals) {
      FUZZ_PROMISE(message.find(signal.name) == &signal);
      check_signal(message, signal);
    }
  }
  return 0;
}
