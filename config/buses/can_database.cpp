#include "config/buses/can_database.hpp"

#include <array>
#include <string>
#include <string_view>

#include "config/bus_files/dbc_scanner.hpp"
#include "config/sections/can_signals.hpp"
#include "config/sections/common.hpp"
#include "config/toml/file_limits.hpp"

namespace thermocomp::sections {
namespace {

constexpr std::uint64_t fd_bytes_max = 64;
constexpr std::uint64_t classic_bytes_max = 8;
constexpr double zero_degC_K = 273.15;

std::string did_you_mean(std::string_view name, const std::vector<std::string>& known) {
  const std::string near = nearest_name(name, known);
  return near.empty() ? "" : "; did you mean \"" + near + "\"?";
}

/// Makes the signal one in degC by the unit that the file gives it. @return whether it could
bool to_degC(CanSignal& place, std::string unit) {
  // The degree sign of UTF-8 and of the code page that most of these files are written in.
  for (const std::string_view sign : {"\xC2\xB0", "\xB0", "deg", "Deg", "_", " "}) {
    for (auto at = unit.find(sign); at != std::string::npos; at = unit.find(sign)) {
      unit.erase(at, sign.size());
    }
  }
  if (unit.empty() || unit == "C" || unit == "c" || unit == "Cel" || unit == "Celsius") return true;
  if (unit == "K" || unit == "Kelvin") {
    place.offset -= zero_degC_K;
    return true;
  }
  if (unit == "F" || unit == "Fahrenheit") {
    place.scale *= 5.0 / 9.0;
    place.offset = (place.offset - 32.0) * 5.0 / 9.0;
    return true;
  }
  return false;
}

/// The message that a sensor or its device names; nullptr after a problem.
const DbcMessage* find_message(const TomlTable& own, const TomlTable& base, const DbcFile& file) {
  const TomlTable& source = own.has("message") ? own : base;
  const std::string name = source.text("message", "");
  if (name.empty()) return nullptr;
  const DbcMessage* message = file.find(name);
  if (message == nullptr) {
    source.problem("message", "must be a message of the bus' DBC file" +
                                  did_you_mean(name, file.message_names()));
    return nullptr;
  }
  const bool several = message->bytes > fd_bytes_max;
  if (several || (message->bytes > classic_bytes_max && message->told_fd == false)) {
    source.problem("message", "has " + std::to_string(message->bytes) + " bytes in the DBC file, " +
                                  (several ? "more than a frame" : "but is no CAN FD frame"));
    return nullptr;
  }
  return message;
}

const DbcSignal* find_signal(const TomlTable& table, std::string_view key, std::string_view name,
                             const DbcMessage& message) {
  const DbcSignal* signal = message.find(name);
  if (signal == nullptr) {
    table.problem(key, "must be a signal of the message " + message.name +
                           did_you_mean(name, message.signal_names()));
  }
  return signal;
}

std::optional<CanField> counter_of(const TomlTable& own, const TomlTable& base,
                                   const DbcMessage& message, bool fd) {
  const TomlTable& source = own.has("counter") ? own : base;
  if (!source.has("counter")) return std::nullopt;
  if (!source.is_text("counter")) return read_can_field(own, base, "counter", fd);
  const std::string name = source.text("counter");
  const DbcSignal* signal = find_signal(source, "counter", name, message);
  if (signal == nullptr) return std::nullopt;
  if (!signal->place.selectors.empty()) {
    source.problem("counter", "must be in every frame of the message, not multiplexed");
  }
  return CanField{signal->place.start_bit, signal->place.length_bits, signal->place.byte_order};
}

CanChannel read_by_name(const TomlTable& own, const TomlTable& base, const CanDatabase& database) {
  for (const TomlTable& table : {own, base}) {
    refuse_all(table,
               {"id", "extended_id", "fd", "start_bit", "length_bits", "byte_order", "signed",
                "float", "scale", "offset_degC", "multiplexor", "multiplexor_value"},
               "is what the DBC file says of the signal");
  }
  CanChannel channel;
  const std::string name = own.text("signal");
  if (!own.has("message") && !base.has("message")) own.problem("message", "must be given");
  if (!database.named) own.problem("signal", "needs a bus that names a DBC file (dbc)");
  const DbcMessage* message = database.file ? find_message(own, base, *database.file) : nullptr;
  const DbcSignal* signal =
      message != nullptr ? find_signal(own, "signal", name, *message) : nullptr;
  if (signal == nullptr) {
    own.ignore_rest();
    base.ignore_rest();
    return channel;
  }
  channel.signal = signal->place;
  if (!to_degC(channel.signal, signal->unit)) {
    own.problem("signal", printable(signal->unit), "the signal's unit is that of no temperature");
  }
  channel.signal.sentinels = read_can_codes(own, base, channel.signal);
  channel.counter = counter_of(own, base, *message, channel.signal.fd);
  return channel;
}

}  // namespace

CanDatabase DbcFiles::read(const TomlTable& bus) {
  CanDatabase database;
  database.named = bus.has("dbc");
  if (!database.named) return database;
  const std::filesystem::path path = bus.text("dbc");
  if (!folder_ || path.empty()) return database;
  const auto full = path.is_absolute() ? path : (*folder_ / path).lexically_normal();
  try {
    DbcReading reading = read_dbc_text(read_text_file(full, bus_table_bytes_max), full.string());
    if (reading.problems.empty()) {
      database.file = std::make_shared<const DbcFile>(std::move(reading.file));
    }
    problems_.insert(problems_.end(), reading.problems.begin(), reading.problems.end());
  } catch (const ConfigurationError& error) {
    bus.problem("dbc", error.problems().front().rule + " (" + full.string() + ")");
  }
  return database;
}

CanChannel read_can_channel(const TomlTable& own, const TomlTable& base,
                            const CanDatabase& database) {
  if (own.has("signal")) return read_by_name(own, base, database);
  refuse_all(own, {"message"}, "makes no sense without the signal's name (signal)");
  CanChannel channel;
  channel.signal = read_can_signal(own, base, CanUse::temperature);
  channel.counter = read_can_field(own, base, "counter", channel.signal.fd);
  return channel;
}

}  // namespace thermocomp::sections
