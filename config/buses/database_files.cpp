#include "config/buses/database_files.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "config/run_forms/spelled_unit.hpp"
#include "config/sections/can_signals.hpp"
#include "config/sections/common.hpp"
#include "config/text/printable_text.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::sections {

std::shared_ptr<EdsFile> EdsFiles::read(const TomlTable& device) {
  if (!device.has("eds")) return nullptr;
  const std::filesystem::path named = device.text("eds");
  if (!folder_ || named.empty()) return nullptr;
  const std::filesystem::path path = *folder_ / named;
  if (const auto known = read_.find(path); known != read_.end()) return known->second;
  std::shared_ptr<EdsFile>& file = read_[path];
  try {
    file = std::make_shared<EdsFile>(
        read_eds_text(read_text_file(path, bus_table_bytes_max), path.string()));
  } catch (const ConfigurationError& error) {
    device.problem("eds", error.problems().front().rule);
  }
  return file;
}

namespace {

constexpr std::uint64_t fd_bytes_max = 64;
constexpr std::uint64_t classic_bytes_max = 8;

/// Suggests the nearest known name, else lists known names.
std::string did_you_mean(std::string_view name, const std::vector<std::string>& known) {
  constexpr std::size_t listed_max = 8;
  const std::string near = nearest_name(name, known);
  if (!near.empty()) return "; did you mean \"" + near + "\"?";
  std::string text;
  for (std::size_t i = 0; i < known.size() && i < listed_max; ++i) {
    text.append(i == 0 ? "; it has \"" : "\", \"").append(known[i]);
  }
  if (text.empty()) return {};
  return text + (known.size() > listed_max ? "\" and others" : "\"");
}

/// Marks the flaws of a named message or signal as used; without a signal all of the message's,
/// without a message those outside of messages.
/// @return true if some are not overridden by configured keys
bool mark_flaws(DbcFile& file, std::string_view message, std::optional<std::string_view> signal,
                const TomlTable& own, const TomlTable& base) {
  bool found = false;
  for (DbcFlaw& flaw : file.flaws) {
    const bool is_near = flaw.message.empty() && !signal;
    if (!is_near && flaw.message != message) continue;
    if (signal && !flaw.signal.empty() && flaw.signal != *signal) continue;
    const bool is_replaced =
        std::any_of(flaw.keys.begin(), flaw.keys.end(),
                    [&](std::string_view key) { return own.has(key) || base.has(key); });
    if (is_replaced) continue;
    if (signal && !flaw.in_use) {
      flaw.problem.rule +=
          flaw.keys.empty()
              ? "; correct the file, or give the sensor its place (id, start_bit, ...) for signal"
              : "; " + std::string(flaw.keys.front()) + " in the configuration replaces it";
    }
    flaw.in_use = found = true;
  }
  return found;
}

/// Converts the signal to degC, by its unit.
void to_degC(const TomlTable& own, const TomlTable& base, const std::string& in_file,
             CanSignal& place) {
  const TomlTable& source = own.has("unit") ? own : base;
  const bool is_given = source.has("unit");
  const std::string text = is_given ? source.text("unit") : in_file;
  if (text.find_first_not_of(' ') == std::string::npos) return;  // no unit: degC
  const SpelledUnit* unit = spelled_unit(text);
  if (unit == nullptr || unit->dimension != "temperature") {
    (is_given ? source : own)
        .problem(is_given ? "unit" : "signal", text,
                 std::string(is_given ? "" : "the unit of the signal in the DBC file ") +
                     "is not a temperature unit; give unit = \"degC\", \"K\" or \"degF\"");
    return;
  }
  place.scale *= unit->factor;
  if (own.has("offset_degC") || base.has("offset_degC")) return;
  place.offset = place.offset * unit->factor + unit->offset;
}

/// The message named by a sensor or its device; nullptr after a problem.
const DbcMessage* find_message(const TomlTable& own, const TomlTable& base, DbcFile& file) {
  const TomlTable& source = own.has("message") ? own : base;
  const std::string name = source.text("message", "");
  if (name.empty()) return nullptr;
  const TomlTable& numbered = own.has("id") ? own : base;
  std::optional<std::uint32_t> id;
  if (numbered.has("id")) id = numbered.integer<std::uint32_t>("id", 0, 0x1FFFFFFF, 0);
  const DbcMessage* message = file.find(name, id);
  if (message == nullptr) {
    const bool is_hidden = mark_flaws(file, name, std::nullopt, own, base);
    source.problem("message", "must be a message of the bus' DBC file" +
                                  (is_hidden ? "; a flaw of the file may hide it"
                                             : did_you_mean(name, file.message_names())));
    return nullptr;
  }
  const bool several = message->bytes > fd_bytes_max;
  const bool is_short = message->declared_fd == false && !own.has("fd") && !base.has("fd");
  if (several || (message->bytes > classic_bytes_max && is_short)) {
    std::string rule = "has " + std::to_string(message->bytes) + " bytes in the DBC file, " +
                       (several ? "more than a frame" : "but is not a CAN FD frame");
    if (message->is_group) rule += "; a bus of kind = \"j1939\" reads it by pgn";
    source.problem("message", rule);
    return nullptr;
  }
  return message;
}

const DbcSignal* find_signal(const TomlTable& table, std::string_view key, std::string_view name,
                             const DbcMessage& message, DbcFile& file) {
  const DbcSignal* signal = message.find(name);
  if (signal == nullptr) {
    const bool is_hidden = mark_flaws(file, message.name, std::nullopt, table, table);
    table.problem(key, "must be a signal of the message " + message.name +
                           (is_hidden ? "; a flaw of the file may hide it"
                                      : did_you_mean(name, message.signal_names())));
  }
  return signal;
}

std::optional<CanField> counter_of(const TomlTable& own, const TomlTable& base,
                                   const DbcMessage& message, DbcFile& file, bool fd) {
  const TomlTable& source = own.has("counter") ? own : base;
  if (!source.has("counter")) return std::nullopt;
  if (!source.is_text("counter")) return read_can_field(own, base, "counter", fd);
  const std::string name = source.text("counter");
  const DbcSignal* signal = find_signal(source, "counter", name, message, file);
  if (signal == nullptr || mark_flaws(file, message.name, signal->name, own, base)) return {};
  if (!signal->place.selectors.empty()) {
    source.problem("counter", "must be in every frame of the message, not multiplexed");
  }
  return CanField{signal->place.start_bit, signal->place.length_bits, signal->place.byte_order};
}

/// Adds the codes by which J1939 signals "error" and "not available". In longer numbers "error" is
/// beyond all temperatures.
void add_group_codes(CanSignal& signal) {
  const int bits = signal.length_bits;
  if (signal.is_signed || signal.is_float || (bits != 8 && bits != 16 && bits != 32)) return;
  const std::int64_t all_ones = (std::int64_t{1} << bits) - 1;
  signal.sentinels.push_back({all_ones, Fault::device_error});
  if (bits == 8) signal.sentinels.push_back({all_ones - 1, Fault::device_error});
}

/// Named values outside of the file's range are no temperatures: error codes. Those inside may be.
void add_named_codes(const DbcSignal& signal, CanSignal& place,
                     std::vector<std::string>& warnings) {
  constexpr std::size_t listed_max = 4;
  std::string listed;
  std::string codes;
  std::size_t count = 0;
  for (const auto& [code, name] : signal.value_names) {
    const auto is_same = [code = code](const Sentinel& each) { return each.code == code; };
    if (std::any_of(place.sentinels.begin(), place.sentinels.end(), is_same)) continue;
    const double value = static_cast<double>(code) * signal.place.scale + signal.place.offset;
    if (signal.min < signal.max && !(value >= signal.min && value <= signal.max)) {
      place.sentinels.push_back({code, Fault::device_error});
      continue;
    }
    if (++count > listed_max) continue;
    const double temp_degC = static_cast<double>(code) * place.scale + place.offset;
    const std::string separator = count == 1 ? "" : ", ";
    listed += separator + std::to_string(code) + " \"" + name + "\" (" + number_text(temp_degC) +
              " degC)";
    codes += separator + std::to_string(code);
  }
  if (count > listed_max) listed += " and " + std::to_string(count - listed_max) + " more";
  if (count != 0)
    warnings.push_back("the DBC file names values of " + signal.name + ": " + listed +
                       "; one that is a fault is a temperature until it is in error_codes = [" +
                       codes + "]");
}

CanChannel read_by_name(const TomlTable& own, const TomlTable& base, const CanDatabase& database,
                        double stale_after_s, std::vector<std::string>& warnings) {
  for (const TomlTable& table : {own, base}) {
    refuse_all(table, {"multiplexor", "multiplexor_value"}, "is given by the DBC file");
  }
  CanChannel channel;
  const std::string name = own.text("signal");
  if (!own.has("message") && !base.has("message")) own.problem("message", "must be given");
  if (!database.named) own.problem("signal", "needs a bus that names a DBC file (dbc)");
  const DbcMessage* message = database.file ? find_message(own, base, *database.file) : nullptr;
  const DbcSignal* signal =
      message != nullptr ? find_signal(own, "signal", name, *message, *database.file) : nullptr;
  if (signal == nullptr || mark_flaws(*database.file, message->name, signal->name, own, base)) {
    own.ignore_rest();
    base.ignore_rest();
    return channel;
  }
  channel.signal = read_can_signal(own, base, CanUse::temperature, &signal->place);
  to_degC(own, base, signal->unit, channel.signal);
  if (message->is_group) add_group_codes(channel.signal);
  add_named_codes(*signal, channel.signal, warnings);
  if (message->cycle_s >= stale_after_s)
    warnings.push_back("the DBC file gives " + message->name + " a cycle of " +
                       number_text(message->cycle_s) + " s: its readings are stale after " +
                       number_text(stale_after_s) + " s (screening.stale_after_s)");
  channel.counter = counter_of(own, base, *message, *database.file, channel.signal.fd);
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
  if (const auto known = read_.find(full); known != read_.end()) return {true, known->second};
  try {
    database.file = std::make_shared<DbcFile>(
        read_dbc_text(read_text_file(full, bus_table_bytes_max), full.string()));
    read_.emplace(full, database.file);
  } catch (const ConfigurationError& error) {
    bus.problem("dbc", error.problems().front().rule + " (" + full.string() + ")");
  }
  return database;
}

CanChannel read_can_channel(const TomlTable& own, const TomlTable& base,
                            const CanDatabase& database, double stale_after_s,
                            std::vector<std::string>& warnings) {
  if (own.has("signal")) return read_by_name(own, base, database, stale_after_s, warnings);
  refuse_all(own, {"message"}, "does not apply without the signal's name (signal)");
  CanChannel channel;
  channel.signal = read_can_signal(own, base, CanUse::temperature);
  channel.counter = read_can_field(own, base, "counter", channel.signal.fd);
  return channel;
}

}  // namespace thermocomp::sections
