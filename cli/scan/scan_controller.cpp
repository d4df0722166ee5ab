#include "cli/scan/scan_controller.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "cli/common/modbus_names.hpp"
#include "cli/scan/scan_bus.hpp"
#include "cli/scan/scan_can.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "daemon/socket/status_client.hpp"
#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"
#include "drivers/modbus/connection.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "estimator/estimator_config.hpp"
#include "status/status.hpp"

namespace thermocomp::cli {
namespace {

struct RegisterPlace {
  ModbusValue value;
  ScanValue shown;
  std::vector<std::uint16_t> words;
  WriteStage stage{WriteStage::offset};
  std::size_t axis{axes_max};  ///< axis whose single offset, sent or applied, this is
  double most{std::numeric_limits<double>::infinity()};  ///< larger is no offset
};

RegisterPlace place_of(const ModbusValue& value, const std::string& what, const std::string& unit,
                       bool is_written = false) {
  RegisterPlace place{value, {}, std::vector<std::uint16_t>(words_of(value.table, value.encoding))};
  place.shown.what = what;
  place.shown.unit = unit;
  place.shown.is_written = is_written;
  place.shown.is_needed = !is_written;
  place.shown.place = place_name(value) + " " + type_name(value);
  if (value.scale != 1.0) place.shown.place += " x " + number_text(value.scale);
  return place;
}

/// Registers of a set with their meanings: "begin", "offset at 400 mm", ...
std::vector<RegisterPlace> places_of_set(const ModbusTravel& travel, const AxisConfig& axis,
                                         const std::vector<ModbusValue>& values,
                                         const std::string& before, bool is_written) {
  std::vector<RegisterPlace> places;
  const std::string unit(unit_of(axis.output).symbol);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const TravelValueText text = travel_value_text(travel, unit, i);
    places.push_back(place_of(values[i], before + text.what + " of axis " + axis_name(axis),
                              text.unit, is_written));
  }
  return places;
}

/// Values that the daemon reads, in its order, so that the requests are the same.
std::vector<RegisterPlace> read_places(const DaemonConfig& config,
                                       const ModbusControllerConfig& modbus) {
  std::vector<RegisterPlace> places;
  const std::vector<AxisSpan> spans = axis_spans(config.estimator.axes);
  for (std::size_t i = 0; i < modbus.axes.size(); ++i) {
    const AxisConfig& axis = config.estimator.axes[spans[i].first];
    if (const auto& travel = modbus.axes[i].travel) {
      for (RegisterPlace& place : places_of_set(*travel, axis, travel->applied, "applied ", false))
        places.push_back(std::move(place));
    }
    if (!modbus.axes[i].applied) continue;
    const std::string unit = modbus.axes[i].piezo ? "V" : std::string(unit_of(axis.output).symbol);
    places.push_back(place_of(*modbus.axes[i].applied, "applied of axis " + axis.name, unit));
    places.back().axis = i;
    places.back().most = offset_um_max_of_any_axis;
  }
  for (const ModbusSignal& signal : modbus.signals) {
    const std::string& name = config.estimator.signals[signal.signal];
    places.push_back(place_of(signal.value, name, std::string(unit_of(name).symbol)));
  }
  return places;
}

std::vector<RegisterPlace> written_places(const DaemonConfig& config,
                                          const ModbusControllerConfig& modbus) {
  std::vector<RegisterPlace> places;
  const std::vector<AxisSpan> spans = axis_spans(config.estimator.axes);
  for (std::size_t i = 0; i < modbus.axes.size(); ++i) {
    const AxisConfig& axis = config.estimator.axes[spans[i].first];
    if (const auto& travel = modbus.axes[i].travel) {
      const std::string of_axis = " of axis " + axis_name(axis);
      places.push_back(place_of(travel->begin, "begin" + of_axis, "", true));
      for (RegisterPlace& place : places_of_set(*travel, axis, travel->values, "", true))
        places.push_back(std::move(place));
      places.push_back(place_of(travel->end, "end" + of_axis, "", true));
      places.back().shown.is_needed = true;  // the next set's number depends on it
      continue;
    }
    const std::string unit = modbus.axes[i].piezo ? "V" : std::string(unit_of(axis.output).symbol);
    places.push_back(place_of(modbus.axes[i].offset, "offset of axis " + axis.name, unit, true));
    places.back().axis = i;
  }
  const auto add = [&](const std::optional<ModbusValue>& value, const char* what,
                       WriteStage stage) {
    if (!value) return;
    places.push_back(place_of(without_sign(*value), what, "", true));
    places.back().stage = stage;
  };
  add(modbus.valid_bits, "valid_bits", WriteStage::valid_bits);
  add(modbus.heartbeat, "heartbeat", WriteStage::heartbeat);
  return places;
}

const RegisterPlace* of_axis(const std::vector<RegisterPlace>& places, std::size_t axis) {
  const auto found = std::find_if(places.begin(), places.end(),
                                  [&](const RegisterPlace& place) { return place.axis == axis; });
  return found == places.end() ? nullptr : &*found;
}

/// Reason why writing the registers' present values might move an axis; empty: all are in effect.
std::string why_it_may_move(const ModbusControllerConfig& modbus,
                            const std::vector<RegisterPlace>& read,
                            const std::vector<RegisterPlace>& written) {
  const RegisterPlace* valid_bits = nullptr;
  for (const RegisterPlace& place : written) {
    if (!place.shown.is_there()) return place.shown.what + " cannot be read";
    if (place.stage == WriteStage::valid_bits) valid_bits = &place;
  }
  for (std::size_t axis = 0; axis < modbus.axes.size(); ++axis) {
    const RegisterPlace* applied = of_axis(read, axis);
    const RegisterPlace* offset = of_axis(written, axis);
    if (offset == nullptr) return "each set along a travel has its own number";
    if (applied == nullptr) return offset->shown.what + " is not read back";
    const double step = std::abs(applied->value.scale) + std::abs(offset->value.scale);
    if (!(std::abs(applied->shown.value - offset->shown.value) <= step))
      return offset->shown.what + " differs from the applied offset";
    const bool is_valid =
        valid_bits == nullptr ||
        (bits_of(valid_bits->words, valid_bits->value.encoding, valid_bits->value.word_order) >>
             axis &
         1U) != 0;
    if (!is_valid && std::abs(applied->shown.value) > step)
      return "valid_bits contradicts the applied offset";
  }
  return "";
}

/// Asks the daemon running with this configuration for its state. @return false: none runs
bool ask_running_daemon(const DaemonConfig& config, ScanController& result) {
  try {
    constexpr std::chrono::milliseconds patience{500};
    StatusClient client(config.socket.path, patience);
    const auto status = part_from<Status>(client.call("status", nlohmann::json::object()));
    if (has_reason(status.reasons, Reason::not_written))
      result.refused = "the running daemon: " + status.controller.last_error;
    result.writes = "writes were not tried: a daemon is running, thermocomp status shows its own";
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

class ControllerScan {
 public:
  explicit ControllerScan(const ModbusControllerConfig& config)
      : config_(config), connection_(config.line) {}

  /// @param read  read together, as the daemon does
  /// @param written  read one by one
  /// @param writes_back  writes the present values back
  void run(std::vector<RegisterPlace>& read, std::vector<RegisterPlace>& written, bool writes_back,
           ScanController& result) {
    if (!connection_.connect()) {
      result.error = "cannot be opened: " + connection_.last_error();
      mark_all(read, written, "was not requested");
      return;
    }
    if (!ask_together(read, result)) {
      mark_all(read, written, "no answer");
      return;
    }
    for (RegisterPlace& place : written) ask_alone(place);
    if (!writes_back) return;
    const bool is_read = std::all_of(read.begin(), read.end(), [](const RegisterPlace& place) {
      return place.shown.is_there();
    });
    if (!is_read || !result.refused.empty()) return;
    const std::string why_not_tried = why_it_may_move(config_, read, written);
    if (why_not_tried.empty())
      write_back(written, result);
    else
      result.writes = "writes were not tried: " + why_not_tried;
  }

 private:
  static void mark_all(std::vector<RegisterPlace>& read, std::vector<RegisterPlace>& written,
                       const std::string& why) {
    for (std::vector<RegisterPlace>* places : {&read, &written})
      for (RegisterPlace& place : *places) {
        place.shown.why = why;
        place.shown.is_needed = true;  // only an answer makes a written value optional
      }
  }

  Exchange ask(ModbusTable table, std::uint16_t address, std::span<std::uint16_t> words) {
    Exchange exchange;
    constexpr int tries_max = 2;
    for (int tried = 0; tried < tries_max; ++tried) {
      // A single-client gateway may still be connected to the sensors' bus.
      if (!connection_.connected() && tried > 0)
        connection_.pause_until(connection_.now() + from_seconds(config_.line.reconnect_s));
      if (!connection_.connected() && !connection_.connect()) return exchange;
      exchange = connection_.read(config_.unit, table, address, words);
      if (exchange.ok() || exchange.outcome == ExchangeOutcome::exception) break;
    }
    return exchange;
  }

  /// @return false: the unit does not answer; result.error gives the reason
  bool ask_together(std::vector<RegisterPlace>& places, ScanController& result) {
    std::vector<ModbusValue> values;
    values.reserve(places.size());
    for (const RegisterPlace& place : places) values.push_back(place.value);
    const ReadPlan plan = plan_reads(values, config_);
    for (std::size_t r = 0; r < plan.requests.size(); ++r) {
      const ReadRequest& request = plan.requests[r];
      std::vector<std::uint16_t> words(request.count);
      const Exchange exchange = ask(request.table, request.address, words);
      if (!exchange.unit_answered() && r == 0) {
        result.error = why_not(exchange);
        return false;
      }
      bool any_refused = false;
      bool any_there = false;
      for (std::size_t i = 0; i < places.size(); ++i) {
        if (plan.places[i].request != r) continue;
        if (exchange.ok()) {
          const auto from = words.begin() + static_cast<std::ptrdiff_t>(plan.places[i].word);
          std::copy_n(from, places[i].words.size(), places[i].words.begin());
          take(exchange, places[i]);
        } else {
          ask_alone(places[i]);
          any_refused = true;
          any_there = any_there || places[i].shown.is_there();
        }
      }
      if (any_refused && any_there) note_refused(request, exchange, result);
    }
    return true;
  }

  void note_refused(const ReadRequest& request, const Exchange& exchange, ScanController& result) {
    result.refused = "the daemon reads " + table_name(request.table) + " " +
                     std::to_string(request.address) + ".." +
                     std::to_string(request.address + request.count - 1) +
                     " in one request, which the controller refuses (" + why_not(exchange) +
                     "): gap_registers_max = 0 in [controller] reads no registers between";
  }

  void write_back(const std::vector<RegisterPlace>& written, ScanController& result) {
    std::vector<WriteField> fields;
    for (const RegisterPlace& place : written)
      fields.push_back({place.value.address, place.stage, place.words});
    for (const WriteField& request : join_writes(fields, config_.registers_per_write())) {
      if (!connection_.connected()) connection_.connect();
      const Exchange exchange = write_field(connection_, config_, request);
      if (exchange.ok()) continue;
      result.refused = write_error(config_, request, exchange);
      return;
    }
    result.writes =
        "writes are answered: the registers' present values were written back (thermocomp status "
        "shows whether a new offset is applied)";
  }

  void ask_alone(RegisterPlace& place) {
    const Exchange exchange = ask(place.value.table, place.value.address, place.words);
    if (exchange.ok())
      take(exchange, place);
    else
      place.shown.why = why_not(exchange) + elsewhere(place, exchange);
    if (!exchange.ok() && exchange.outcome != ExchangeOutcome::exception)
      place.shown.is_needed = true;
  }

  /// Hint at another table that answers where this one is refused.
  std::string elsewhere(const RegisterPlace& place, const Exchange& refused) {
    const ModbusTable table = place.value.table;
    const bool may_move =
        table == ModbusTable::input || (table == ModbusTable::holding && !place.shown.is_written);
    if (refused.outcome != ExchangeOutcome::exception || s7_of(config_.line) != nullptr ||
        !may_move)
      return "";
    const ModbusTable other =
        table == ModbusTable::input ? ModbusTable::holding : ModbusTable::input;
    std::vector<std::uint16_t> words(place.words.size());
    return ask(other, place.value.address, words).ok()
               ? "; table = \"" + table_name(other) + "\" has a value there"
               : "";
  }

  static void take(const Exchange& exchange, RegisterPlace& place) {
    ScanValue& shown = place.shown;
    const ModbusValue& value = place.value;
    shown.raw = hex_words(place.words);
    shown.round_trip_ms =
        1e-6 * static_cast<double>((exchange.arrived_at - exchange.sent_at).count());
    const Decoded decoded =
        decode(place.words,
               format_in(value.table, {value.encoding, value.word_order, value.scale, 0.0}), {});
    shown.value = decoded.value;
    if (decoded.fault != Fault::none)
      shown.why =
          "is not a finite number: compare encoding and word_order with the controller's side";
    else if (std::abs(decoded.value) > place.most)
      shown.why =
          "is no offset of an axis: compare address, encoding, word_order and scale with the "
          "controller's side";
  }

  [[nodiscard]] std::string why_not(const Exchange& exchange) const {
    if (exchange.outcome == ExchangeOutcome::exception)
      return "the controller answers with " + exchange.detail;
    if (s7_of(config_.line) == nullptr && exchange.outcome == ExchangeOutcome::timeout)
      return "unit " + std::to_string(config_.unit) + ": " + exchange.detail;
    if (exchange.outcome == ExchangeOutcome::disconnected && !connection_.last_error().empty())
      return connection_.last_error();
    return exchange.detail;
  }

  const ModbusControllerConfig& config_;
  ModbusConnection connection_;
};

ScanController scan_modbus_controller(const DaemonConfig& config,
                                      const ModbusControllerConfig& modbus, bool writes_back,
                                      const std::function<void(const std::string&)>& progress) {
  ScanController result;
  result.name = modbus.name;
  const auto* rtu = std::get_if<ModbusRtu>(&modbus.line.link);
  result.kind = kind_of(modbus.line);
  result.where = line_name(modbus.line);
  const S7Block* s7 = s7_of(modbus.line);
  result.address =
      s7 != nullptr ? "DB" + std::to_string(s7->db) : "unit " + std::to_string(modbus.unit);
  std::vector<RegisterPlace> read = read_places(config, modbus);
  std::vector<RegisterPlace> written = written_places(config, modbus);
  const SerialHolder holder = rtu != nullptr ? holder_of(rtu->device) : SerialHolder{};
  if (holder.is_daemon) {
    result.error = "is in use by " + holder.name +
                   ": two masters on one line garble each other. Stop it first (systemctl stop "
                   "thermocompd)";
    for (std::vector<RegisterPlace>* places : {&read, &written})
      for (RegisterPlace& place : *places) place.shown.why = "was not requested";
  } else {
    progress("controller " + modbus.name + ": reading its registers");
    const bool may_write = writes_back && !config.dry_run && !ask_running_daemon(config, result);
    try {
      ControllerScan(modbus).run(read, written, may_write, result);
    } catch (const DriverError& error) {
      result.error = error.what();
    }
  }
  for (std::vector<RegisterPlace>* places : {&read, &written})
    for (RegisterPlace& place : *places) result.values.push_back(std::move(place.shown));
  return result;
}

}  // namespace

std::optional<ScanController> scan_controller(
    const DaemonConfig& config, double listen_s, bool writes_back,
    const std::function<void(const std::string&)>& progress) {
  if (const auto* modbus = std::get_if<ModbusControllerConfig>(&config.controller))
    return scan_modbus_controller(config, *modbus, writes_back, progress);
  if (const auto* can = std::get_if<CanControllerConfig>(&config.controller))
    return scan_can_controller(config, *can, listen_s, progress);
  if (const auto* bridge = std::get_if<BridgeControllerConfig>(&config.controller))
    progress("controller " + bridge->name + ": not scanned; its bridge calls the daemon");
  return std::nullopt;
}

}  // namespace thermocomp::cli
