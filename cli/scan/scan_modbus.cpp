// Scan of a Modbus bus: reads every channel once with the daemon's poller, and the registers beside
// a refused address or an implausible value. Never writes.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>

#include "cli/common/modbus_names.hpp"
#include "cli/scan/scan_bus.hpp"
#include "drivers/bus.hpp"
#include "drivers/modbus/connection.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "drivers/sensors/modbus_poller.hpp"
#include "status/codes.hpp"

namespace thermocomp::cli {
namespace {

constexpr double busy_s_max = 5.0;  ///< default of stale_after_s

std::string place_of(const ModbusChannel& channel) {
  std::string text = table_name(channel.table);
  text.append(" ").append(std::to_string(channel.address));
  text.append(" ").append(encoding_name(channel.encoding));
  if (registers_of(channel.encoding) > 1 || channel.word_order != WordOrder::abcd) {
    text.append(" ").append(order_name(channel.word_order));
  }
  if (channel.scale != 1.0) text.append(" x ").append(short_number(channel.scale));
  return text;
}

ScanDevice without_answer(const ModbusDeviceConfig& device, const ScanSensors& sensors,
                          const std::string& why) {
  ScanDevice result{device.name, "unit " + std::to_string(device.unit), false, why, {}};
  for (const ModbusChannel& channel : device.channels) {
    ScanChannel& shown = result.channels.emplace_back();
    shown.sensor = sensors.names.at(channel.sensor);
    shown.place = place_of(channel);
    shown.fault = Fault::no_answer;
  }
  return result;
}

struct Answer {
  Exchange exchange;
  std::vector<std::uint16_t> words;
};

class ModbusScan {
 public:
  ModbusScan(const ModbusBusConfig& config, const ScanSensors& sensors,
             const std::function<void(const std::string&)>& progress)
      : config_(config), sensors_(sensors), progress_(progress), connection_(config.line) {
    if (!config.devices.empty()) poller_.emplace(config, connection_);
  }

  void run(ScanBus& bus) {
    if (!connection_.connect()) {
      bus.error = "cannot be opened: " + connection_.last_error();
      for (const ModbusDeviceConfig& device : config_.devices) {
        bus.devices.push_back(without_answer(device, sensors_, ""));
      }
      return;
    }
    if (poller_) ask_as_the_daemon();
    for (std::size_t i = 0; i < config_.devices.size(); ++i) bus.devices.push_back(scan(i));
    judge_silence(bus);
  }

  void find(const UnitSearch& search, ScanBus& bus);

 private:
  [[nodiscard]] bool is_serial() const {
    return std::holds_alternative<ModbusRtu>(config_.line.link);
  }

  Answer ask(int unit, ModbusTable table, std::uint16_t address, std::size_t count) {
    Answer answer{{}, std::vector<std::uint16_t>(count)};
    constexpr int tries_max = 2;
    for (int tried = 0; tried < tries_max; ++tried) {
      answer.exchange = connection_.read(unit, table, address, answer.words);
      if (answer.exchange.unit_answered()) return answer;
      if (answer.exchange.outcome == ExchangeOutcome::exception) return answer;
      if (!connection_.connected() && !connection_.connect()) return answer;
    }
    return answer;
  }

  void ask_as_the_daemon();
  ScanDevice scan(std::size_t index);
  ScanChannel evaluate(const ModbusDeviceConfig& device, std::size_t index);
  void judge_value(const ModbusDeviceConfig& device, const ModbusChannel& channel,
                   std::span<const std::uint16_t> words, ScanChannel& result);
  void hint_refused(const ModbusDeviceConfig& device, const ModbusChannel& channel, int code,
                    ScanChannel& result);
  std::optional<double> look_at(const ModbusDeviceConfig& device, const ModbusChannel& channel,
                                int address, ModbusTable table);
  void hint_neighbours(const ModbusDeviceConfig& device, const ModbusChannel& channel,
                       ScanChannel& result);
  void judge_silence(ScanBus& bus);
  [[nodiscard]] bool would_answer(const ModbusLine& line) const;
  bool answers_within(double timeout_ms);
  std::string working_line();
  [[nodiscard]] std::string describe(const ModbusDeviceConfig& device,
                                     const Exchange& exchange) const;
  [[nodiscard]] const PlausibleRange& range_of(const ModbusChannel& channel) const {
    return sensors_.ranges.at(channel.sensor);
  }

  const ModbusBusConfig& config_;
  const ScanSensors& sensors_;
  const std::function<void(const std::string&)>& progress_;
  ModbusConnection connection_;
  std::optional<ModbusPoller> poller_;  ///< none: no devices configured
  // Answers of the device being scanned, one per channel.
  std::vector<Answer> values_;
  std::vector<std::optional<Answer>> statuses_;
};

std::string ModbusScan::describe(const ModbusDeviceConfig& device, const Exchange& exchange) const {
  if (exchange.outcome == ExchangeOutcome::exception)
    return "the device answers with " + exchange.detail;
  if (exchange.outcome == ExchangeOutcome::timeout) {
    return "unit " + std::to_string(device.unit) + ": " + exchange.detail;
  }
  return exchange.detail;
}

/// Polls until every value was requested; retries a busy device while a reading would be fresh.
void ModbusScan::ask_as_the_daemon() {
  progress_("bus " + config_.name + ": asking its devices as the daemon does");
  const std::size_t count = config_.devices.size();
  const auto has_asked = [this](std::size_t device) { return poller_->has_asked(device); };
  // A gateway may hold each request for some seconds.
  const nanoseconds give_up_at =
      connection_.now() + static_cast<long>(count + 1) * 2 * gateway_wait_max;
  std::vector<std::size_t> all(count);
  std::iota(all.begin(), all.end(), std::size_t{0});
  while (!std::all_of(all.begin(), all.end(), has_asked) && connection_.now() < give_up_at)
    poller_->act();
  const auto is_busy = [this](std::size_t device) {
    for (std::size_t i = 0; i < config_.devices[device].channels.size(); ++i)
      if (poller_->value_of(device, i).exchange.fault() == Fault::device_busy) return true;
    return false;
  };
  const nanoseconds busy_until = connection_.now() + from_seconds(busy_s_max);
  while (std::any_of(all.begin(), all.end(), is_busy) && connection_.now() < busy_until)
    poller_->act();
}

ScanDevice ModbusScan::scan(std::size_t index) {
  const ModbusDeviceConfig& device = config_.devices[index];
  ScanDevice result{device.name, "unit " + std::to_string(device.unit), false, "", {}};
  values_.clear();
  statuses_.clear();
  const auto copied = [&](const ModbusPoller::Answer& answer) {
    result.answers = result.answers || answer.exchange.unit_answered();
    return Answer{answer.exchange, {answer.words.begin(), answer.words.end()}};
  };
  for (std::size_t i = 0; i < device.channels.size(); ++i) {
    values_.push_back(copied(poller_->value_of(index, i)));
    const auto status = poller_->status_of(index, i);
    statuses_.push_back(status ? std::optional(copied(*status)) : std::nullopt);
  }
  if (!result.answers) result.note = describe(device, values_.front().exchange);
  if (poller_->is_split(index)) {
    const auto is_ok = [](const Answer& answer) { return answer.exchange.ok(); };
    result.note = std::all_of(values_.begin(), values_.end(), is_ok)
                      ? "refuses to be read in one request, but answers for each register: "
                        "gap_registers_max = 0 or one_register_a_request = true"
                      : "refuses one request for all values; each was requested alone";
  }
  for (std::size_t i = 0; i < device.channels.size(); ++i) {
    result.channels.push_back(evaluate(device, i));
    if (!result.answers) result.channels.back().why.clear();  // stated in the note
  }
  return result;
}

ScanChannel ModbusScan::evaluate(const ModbusDeviceConfig& device, std::size_t index) {
  const ModbusChannel& channel = device.channels[index];
  const Answer value = values_[index];
  ScanChannel result;
  result.sensor = sensors_.names.at(channel.sensor);
  result.place = place_of(channel);
  if (!value.exchange.ok()) {
    result.fault = value.exchange.fault();
    result.why = describe(device, value.exchange);
    const bool is_refused = result.fault != Fault::device_busy && value.exchange.unit_answered();
    if (is_refused) hint_refused(device, channel, value.exchange.exception_code, result);
    return result;
  }
  const auto seconds = [](nanoseconds time) { return static_cast<double>(time.count()) * 1e-9; };
  result.raw = hex_words(value.words);
  result.round_trip_ms = seconds(value.exchange.arrived_at - value.exchange.sent_at) * 1e3;
  result.age_s = seconds(connection_.now() - value.exchange.arrived_at);
  if (const auto& status = statuses_[index]) {
    result.raw.append(" | ").append(hex_words(status->words));
    if (!status->exchange.ok()) {
      result.fault = status->exchange.fault();
      result.why = "status: " + describe(device, status->exchange);
      return result;
    }
    result.fault = decode_status(*channel.status, status->words[0]);
    if (result.fault != Fault::none) {
      result.why = "the status, " + table_name(channel.status->table) + " " +
                   std::to_string(channel.status->address) + ", says " +
                   std::string(to_string(result.fault));
      return result;
    }
  }
  judge_value(device, channel, value.words, result);
  return result;
}

void ModbusScan::judge_value(const ModbusDeviceConfig& device, const ModbusChannel& channel,
                             std::span<const std::uint16_t> words, ScanChannel& result) {
  const NumberFormat format = format_of(channel);
  const Decoded decoded = decode(words, format, channel.sentinels);
  const Decoded number = decode(words, format, {});
  if (decoded.fault != Fault::none && number.fault == Fault::none) {
    result.fault = decoded.fault;
    result.why = "the device's code for it";
    if (decoded.fault == Fault::open_circuit) {
      result.hints.emplace_back("check this channel's terminals: a thermocouple has a few ohms");
    }
    return;
  }
  result.temp_degC = decoded.value;
  const PlausibleRange& range = range_of(channel);
  if (decoded.fault == Fault::none && is_plausible(channel, decoded.value, range)) {
    result.fault = Fault::none;
    if (decoded.value == channel.offset_degC) {
      result.hints.emplace_back(
          "the register is exactly 0, as for a channel that is switched off: warm the sensor");
    }
    return;
  }
  result.fault = Fault::out_of_range;
  result.why = std::isnan(decoded.value) ? std::string(nan_text().meaning)
                                         : short_number(decoded.value) + " degC is outside [" +
                                               short_number(range.min_degC) + ", " +
                                               short_number(range.max_degC) + "] ([screening])";
  result.hints = hints_for_words(channel, words, range);
  result.likely_open_code = likely_open_code(channel, words);
  // Two words at the next address may be right where the same two in another order look right.
  if (result.hints.empty() || words.size() > 1) hint_neighbours(device, channel, result);
  if (result.hints.empty()) {
    result.hints.emplace_back("compare table, address, encoding and scale with the manual");
  }
}

/// The value at another place, if it is plausible there.
std::optional<double> ModbusScan::look_at(const ModbusDeviceConfig& device,
                                          const ModbusChannel& channel, int address,
                                          ModbusTable table) {
  const std::size_t count = words_of(channel.table, channel.encoding);
  if (address < 0 || address + static_cast<int>(count) > 65536) return std::nullopt;
  const Answer answer = ask(device.unit, table, static_cast<std::uint16_t>(address), count);
  if (!answer.exchange.ok()) return std::nullopt;
  const Decoded decoded = decode(answer.words, format_of(channel), channel.sentinels);
  const bool fits = decoded.fault == Fault::none && decoded.value != channel.offset_degC &&
                    is_plausible(channel, decoded.value, range_of(channel));
  return fits ? std::optional(decoded.value) : std::nullopt;
}

void ModbusScan::hint_neighbours(const ModbusDeviceConfig& device, const ModbusChannel& channel,
                                 ScanChannel& result) {
  for (const int step : {-1, 1}) {
    const int address = channel.address + step;
    if (const auto value = look_at(device, channel, address, channel.table)) {
      result.hints.push_back("address = " + std::to_string(address) + " would make it " +
                             short_number(*value) + " degC: manuals often count from 1");
    }
  }
}

void ModbusScan::hint_refused(const ModbusDeviceConfig& device, const ModbusChannel& channel,
                              int code, ScanChannel& result) {
  result.hints = hints_for_address(channel);
  if (!result.hints.empty()) return;
  hint_neighbours(device, channel, result);
  const ModbusTable other =
      channel.table == ModbusTable::input ? ModbusTable::holding : ModbusTable::input;
  if (const auto value = look_at(device, channel, channel.address, other)) {
    result.hints.push_back("table = \"" + table_name(other) + "\" would make it " +
                           short_number(*value) + " degC");
  }
  if (!result.hints.empty()) return;
  if (code == illegal_function)
    result.hints.emplace_back("compare table with the manual: another function reads it there");
  else if (code == illegal_address || code == illegal_value)
    result.hints.emplace_back(
        "this register does not exist: compare table and address with the manual");
  else
    result.hints.emplace_back("look this exception up in the device's manual");
}

/// True if the first device answers its first request on this line.
bool ModbusScan::would_answer(const ModbusLine& line) const {
  const ModbusDeviceConfig& device = config_.devices.front();
  const ModbusChannel& channel = device.channels.front();
  ModbusConnection connection(line);
  std::vector<std::uint16_t> words(words_of(channel.table, channel.encoding));
  return connection.connect() &&
         connection.read(device.unit, channel.table, channel.address, words, device.wide_registers)
             .unit_answered();
}

/// The same test on the serial line that is already open.
bool ModbusScan::answers_within(double timeout_ms) {
  ModbusLine patient = config_.line;
  patient.timeout_ms = timeout_ms;
  connection_.time_as(patient);
  const ModbusDeviceConfig& device = config_.devices.front();
  const ModbusChannel& channel = device.channels.front();
  const bool answers =
      ask(device.unit, channel.table, channel.address, words_of(channel.table, channel.encoding))
          .exchange.unit_answered();
  connection_.time_as(config_.line);
  return answers;
}

/// The first change of the line with which a unit answers; empty: none.
std::string ModbusScan::working_line() {
  constexpr double patient_ms = 3000.0;
  const bool may_wait = config_.line.timeout_ms < patient_ms;
  const std::string patience = "timeout_ms = " + short_number(patient_ms);
  const auto* tcp = std::get_if<ModbusTcp>(&config_.line.link);
  if (tcp == nullptr) return may_wait && answers_within(patient_ms) ? patience : "";
  const auto with = [&](auto change) {
    ModbusLine line = config_.line;
    change(line, std::get<ModbusTcp>(line.link));
    return would_answer(line);
  };
  if (with([](auto& line, auto&) { line.ignore_transaction = true; }))
    return "ignore_transaction = true";
  if (config_.devices.front().unit > 0 && !tcp->rtu_frames &&
      with([](auto&, auto& link) { link.rtu_frames = true; }))
    return "kind = \"modbus_rtu_over_tcp\"";
  if (tcp->rtu_frames && with([](auto&, auto& link) { link.rtu_frames = false; }))
    return "kind = \"modbus_tcp\"";
  const bool waits = may_wait && with([](auto& line, auto&) { line.timeout_ms = patient_ms; });
  return waits ? patience : "";
}

/// Explains silence: a single silent unit has its own fault, silence of all has a common cause.
void ModbusScan::judge_silence(ScanBus& bus) {
  const auto silent = static_cast<std::size_t>(std::count_if(
      bus.devices.begin(), bus.devices.end(), [](const auto& device) { return !device.answers; }));
  if (silent == 0) return;
  const bool nothing_came = poller_->value_of(0, 0).exchange.outcome == ExchangeOutcome::timeout;
  if (silent == bus.devices.size()) {
    const std::string works = working_line();
    if (!works.empty())
      bus.note = "no unit answers as configured, but one does with " + works;
    else if (nothing_came)
      bus.note = is_serial()
                     ? "no unit answers: baud, parity, A and B swapped, termination, or the units' "
                       "numbers; --find tries other numbers"
                     : "connected, but no unit answers: the unit numbers; --find tries others";
    return;
  }
  for (ScanDevice& device : bus.devices) {
    if (device.answers) continue;
    device.note +=
        "; others on this bus do, so it is this unit's number, supply or wires "
        "(--find tries other numbers)";
  }
}

void ModbusScan::find(const UnitSearch& search, ScanBus& bus) {
  std::set<int> configured;
  for (const ModbusDeviceConfig& device : config_.devices) configured.insert(device.unit);
  const int count = search.last - search.first + 1;
  progress_("bus " + config_.name + ": asking units " + std::to_string(search.first) + " to " +
            std::to_string(search.last) +
            " for holding register 0 (function 3), one request each, " +
            short_number(count * config_.line.timeout_ms / 1e3) + " s; behind a gateway longer");
  std::string unknown;
  std::string numbers;
  bool may_hold = true;  // the gateway may block other requests while it waits for a silent unit
  bool was_silent = false;
  for (int unit = search.first; unit <= search.last; ++unit) {
    std::array<std::uint16_t, 1> word{};
    if (!connection_.connected() && !connection_.connect()) break;
    if (!may_hold) connection_.reset_silence();
    const Exchange exchange = connection_.read(unit, ModbusTable::holding, 0, word);
    if (was_silent && exchange.unit_answered()) may_hold = connection_.held() > nanoseconds{0};
    was_silent = exchange.outcome == ExchangeOutcome::timeout;
    if (!exchange.unit_answered()) continue;
    bus.found_numbers.push_back(unit);
    numbers.append(numbers.empty() ? "" : ", ").append(std::to_string(unit));
    if (configured.contains(unit)) continue;
    unknown.append(unknown.empty() ? "" : ", ").append(std::to_string(unit));
  }
  bus.found = "units " + std::to_string(search.first) + " to " + std::to_string(search.last) +
              " searched: " + (numbers.empty() ? "none answers" : numbers + " answer");
  if (static_cast<int>(bus.found_numbers.size()) == count && count > 2) {
    bus.found += "; the device ignores the unit number";
  } else if (!unknown.empty()) {
    bus.found += "; not in the configuration: " + unknown;
  }
}

}  // namespace

ScanBus scan_bus(const ModbusBusConfig& config, const ScanSensors& sensors, const ScanTask& task) {
  ScanBus bus;
  bus.name = config.name;
  const auto* rtu = std::get_if<ModbusRtu>(&config.line.link);
  bus.kind = config.outline().kind;
  bus.where = line_name(config.line);
  if (rtu != nullptr) {
    const SerialHolder holder = holder_of(rtu->device);
    if (holder.is_daemon) {
      bus.error = "is in use by " + holder.name +
                  ": two masters on one line disturb each other. Stop it first (systemctl stop "
                  "thermocompd), or use `thermocomp sensors`";
      for (const ModbusDeviceConfig& device : config.devices) {
        bus.devices.push_back(without_answer(device, sensors, ""));
      }
      return bus;
    }
    if (!holder.name.empty()) bus.note = "also open in " + holder.name;
  }
  try {
    ModbusScan scan(config, sensors, task.progress);
    scan.run(bus);
    if (task.search.wanted && bus.error.empty()) scan.find(task.search, bus);
  } catch (const DriverError& error) {
    bus.error = error.what();
  }
  return bus;
}

}  // namespace thermocomp::cli
