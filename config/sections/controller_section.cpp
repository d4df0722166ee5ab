#include "config/sections/controller_section.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "config/sections/can_signals.hpp"
#include "config/sections/common.hpp"
#include "config/sections/modbus_values.hpp"
#include "config/sections/travel_section.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::sections {
namespace {

enum class Kind {
  dry_run,
  modbus_tcp,
  modbus_rtu,
  modbus_rtu_over_tcp,
  modbus_udp,
  s7,
  piezo_tcp,
  piezo_rtu,
  can,
  linuxcnc,
  unknown
};

/// Refuses a travel if the controller cannot interpolate along it.
void refuse_travel(const TomlTable& axis) {
  refuse_all(axis, {"line", "table"},
             "needs a controller that takes a set of values as a whole (kind = \"modbus_tcp\", "
             "\"modbus_rtu\" or \"can\"); with `offset` the daemon follows the position");
}

template <class Place>
void check_place(const TomlTable& table, std::string_view key, const Place& place,
                 const AxisConfig& axis) {
  check_offset_place(table, key, {reach(place), count_of(place)}, axis.limiter);
}

void check_bits(const TomlTable& table, double greatest, std::size_t axes) {
  if (greatest + 1.0 >= std::exp2(static_cast<double>(axes))) return;
  table.problem("valid_bits", "must have a bit for each of the " + std::to_string(axes) + " axes");
}

class ControllerReader {
 public:
  ControllerReader(const TomlTable& table, const std::vector<TomlTable>& axis_tables,
                   const std::vector<AxisConfig>& axes)
      : table_(table), axis_tables_(axis_tables), offsets_(axes.size()) {
    for (const AxisSpan& span : axis_spans(axes)) axes_.push_back(axes[span.first]);
  }

  ControllerReading read(const std::map<std::string, ModbusRtu>& serial_lines) {
    name_ = table_.text("name");
    const Kind kind = table_.choice<Kind>("kind",
                                          {{"dry_run", Kind::dry_run},
                                           {"modbus_tcp", Kind::modbus_tcp},
                                           {"modbus_rtu", Kind::modbus_rtu},
                                           {"modbus_rtu_over_tcp", Kind::modbus_rtu_over_tcp},
                                           {"modbus_udp", Kind::modbus_udp},
                                           {"s7", Kind::s7},
                                           {"piezo_tcp", Kind::piezo_tcp},
                                           {"piezo_rtu", Kind::piezo_rtu},
                                           {"can", Kind::can},
                                           {"linuxcnc", Kind::linuxcnc}},
                                          Kind::unknown);
    result_.dry_run = kind == Kind::dry_run || table_.flag("dry_run", false);
    switch (kind) {
      case Kind::dry_run:
        read_dry_run();
        break;
      case Kind::modbus_tcp:
      case Kind::modbus_rtu:
      case Kind::modbus_rtu_over_tcp:
      case Kind::modbus_udp:
        read_modbus(table_.text("kind"), false, serial_lines);
        break;
      case Kind::s7:
        read_s7();
        break;
      case Kind::piezo_tcp:
        read_modbus("modbus_tcp", true, serial_lines);
        break;
      case Kind::piezo_rtu:
        read_modbus("modbus_rtu", true, serial_lines);
        break;
      case Kind::can:
        read_can();
        break;
      case Kind::linuxcnc:
        read_linuxcnc();
        break;
      case Kind::unknown:
        if (!table_.has("kind")) table_.problem("kind", "must be given");
        ignore_places();
        break;
    }
    return std::move(result_);
  }

 private:
  void ignore_places() {
    table_.ignore_rest();
    for (const TomlTable& signal : table_.tables("signal")) {
      result_.signals.push_back(signal.text("name"));
      signal.ignore_rest();
    }
    for (const TomlTable& axis : axis_tables_) axis.ignore_rest();
  }

  void read_dry_run() {
    constexpr std::string_view rule =
        "does not apply to kind = \"dry_run\", which has no controller; to read a real one without "
        "writing, give its kind and dry_run = true";
    for (const std::string& key : table_.keys()) {
      if (key != "name" && key != "kind") table_.refuse(key, rule);
    }
    for (const TomlTable& axis : axis_tables_) {
      refuse_all(axis, {"offset", "applied", "piezo"}, rule);
      refuse_travel(axis);
    }
    result_.config = DryRunControllerConfig{name_, offsets_};
  }

  void read_linuxcnc() {
    constexpr std::string_view rule = "does not apply to kind = \"linuxcnc\": the bridge has it";
    BridgeControllerConfig config;
    config.name = name_;
    config.silent_after_s =
        table_.number("silent_after_s", Range::between(0.2, 60), config.silent_after_s);
    for (const std::string& key : table_.keys())
      if (key != "name" && key != "kind" && key != "silent_after_s" && key != "signal" &&
          key != "dry_run")
        table_.refuse(key, rule);
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      refuse_all(axis_tables_[i], {"offset", "applied", "piezo"}, rule);
      refuse_travel(axis_tables_[i]);
      if (axes_[i].output.ends_with("_urad"))
        axis_tables_[i].problem("output", "must be in um: LinuxCNC takes offsets of linear axes");
      config.axes.push_back(axes_[i].name);
    }
    read_signals([](const TomlTable&, std::size_t) {});
    config.signals = result_.signals;
    result_.config = std::move(config);  // the bridge determines the period
  }

  /// Calls read_value(table, index) for every signal with a valid name.
  template <class ReadValue>
  void read_signals(ReadValue read_value) {
    std::set<std::string> names;
    for (const TomlTable& table : table_.tables("signal")) {
      const std::string name = unique_name(table, names);
      if (!name.empty() && !is_operating(name)) {
        table.problem("name", "must be a position or an operating signal by its unit");
      } else if (!name.empty() && !is_column_name(name)) {
        table.problem("name", column_name_rule);
      }
      if (result_.signals.size() == signals_max) {
        table.problem("name", "there must be at most " + std::to_string(signals_max) + " signals");
      }
      read_value(table, result_.signals.size());
      result_.signals.push_back(name);
    }
  }

  /// Either every axis is read back, or none.
  void check_read_back() {
    const auto shows = [](const TomlTable& axis) {
      return axis.has("applied") || travel_table(axis).has("applied");
    };
    const auto count = std::count_if(axis_tables_.begin(), axis_tables_.end(), shows);
    result_.reads_back = count > 0;
    if (count == 0) return;
    for (const TomlTable& axis : axis_tables_) {
      if (shows(axis)) continue;
      const TomlTable travel = travel_table(axis);
      (travel ? travel : axis).problem("applied", "must be given for all axes or for none");
    }
  }

  /// @param volts  offsets are sent as voltages of piezo amplifiers
  void read_modbus(std::string_view kind, bool volts,
                   const std::map<std::string, ModbusRtu>& serial_lines) {
    ModbusControllerConfig config;
    config.name = name_;
    config.line = read_modbus_line(table_, kind);
    if (const auto* rtu = std::get_if<ModbusRtu>(&config.line.link)) {
      const auto of_bus = serial_lines.find(rtu->device);
      if (of_bus != serial_lines.end() && of_bus->second != *rtu)
        table_.problem("device",
                       "is also the line of a bus: baud, parity, data_bits, stop_bits and "
                       "rs485 must be the same in both");
    }
    config.unit = read_unit(table_, config.line);
    config.registers_per_request_max =
        table_.integer("registers_per_request_max", 1, 125, config.registers_per_request_max);
    config.gap_registers_max =
        table_.integer("gap_registers_max", 0, 124, config.gap_registers_max);
    config.write_function = read_write_function(config.write_function);
    config.period_s = table_.number("period_s", Range::between(0.005, 60), config.period_s);
    refuse_all(table_, {"interface", "silent_after_s"}, "does not apply to a Modbus controller");
    read_places(std::move(config), volts);
  }

  /// A data block can be read with the gaps between its values.
  void read_s7() {
    ModbusControllerConfig config;
    config.name = name_;
    config.line = read_modbus_line(table_, "s7");
    config.registers_per_request_max = config.gap_registers_max = S7Block::registers_per_request;
    config.period_s = table_.number("period_s", Range::between(0.005, 60), config.period_s);
    refuse_all(table_,
               {"interface", "silent_after_s", "unit", "write_function",
                "registers_per_request_max", "gap_registers_max", "ignore_transaction"},
               "does not apply to kind = \"s7\"");
    for (const TomlTable& axis : axis_tables_) refuse_travel(axis);
    read_value_ = read_s7_value;
    read_places(std::move(config), false);
  }

  void read_places(ModbusControllerConfig config, bool volts) {
    WrittenRegisters written;
    for (std::size_t i = 0; i < axes_.size(); ++i)
      config.axes.push_back(read_axis(axis_tables_[i], axes_[i], volts, written));
    check_read_back();
    config.valid_bits = read_written_bits("valid_bits", written);
    if (config.valid_bits) check_bits(table_, reach(*config.valid_bits).max, axes_.size());
    config.heartbeat = read_written_bits("heartbeat", written);
    if (config.write_function == ModbusControllerConfig::one_register) check_single(config);
    read_signals([&](const TomlTable& table, std::size_t index) {
      config.signals.push_back({index, read_value_(table, RegisterUse::signal)});
    });
    result_.period_s = config.period_s;
    result_.config = std::move(config);
  }

  [[nodiscard]] int read_write_function(int otherwise) const {
    const int function = table_.integer("write_function", 6, 16, otherwise);
    if (function != ModbusControllerConfig::one_register && function != otherwise)
      table_.problem("write_function", "must be 6 (one register per request) or 16");
    return function;
  }

  /// A value of several registers would be written in parts.
  void check_single(const ModbusControllerConfig& config) const {
    constexpr std::string_view rule = "must fit in one register with write_function = 6";
    for (std::size_t i = 0; i < config.axes.size(); ++i) {
      if (config.axes[i].travel)
        travel_table(axis_tables_[i]).problem("values", rule);
      else if (registers_of(config.axes[i].offset.encoding) != 1)
        axis_tables_[i].problem("offset", rule);
    }
    for (const auto& [key, value] :
         {std::pair("valid_bits", config.valid_bits), std::pair("heartbeat", config.heartbeat)})
      if (value && registers_of(value->encoding) != 1) table_.problem(key, rule);
  }

  [[nodiscard]] std::optional<ModbusValue> read_written_bits(std::string_view key,
                                                             WrittenRegisters& written) const {
    const TomlTable place = table_.table_or_empty(key);
    if (!place) return std::nullopt;
    const ModbusValue value = read_value_(place, RegisterUse::written_bits);
    written.add(table_, key, value);
    return value;
  }

  ModbusAxis read_axis(const TomlTable& table, const AxisConfig& axis, bool volts,
                       WrittenRegisters& written) const {
    if (volts) {
      refuse_travel(table);
      return read_piezo_axis(table, axis, written);
    }
    if (!travel_table(table)) return read_plain_axis(table, axis, written);
    refuse_plain_places(table);
    ModbusAxis place;
    place.travel = read_modbus_travel(table, axis.limiter, written);
    return place;
  }

  /// Refuses the plain places for an axis with a travel.
  static void refuse_plain_places(const TomlTable& axis) {
    refuse_all(axis, {"offset", "applied", "piezo"},
               "cannot be combined with `line` or `table`, which has its own registers");
  }

  static ModbusAxis read_piezo_axis(const TomlTable& table, const AxisConfig& axis,
                                    WrittenRegisters& written) {
    ModbusAxis place;
    const TomlTable offset = table.table("offset");
    place.offset = read_modbus_value(offset, RegisterUse::written);
    if (offset) written.add(table, "offset", place.offset);
    const TomlTable own = table.table("piezo");
    PiezoConfig piezo;
    piezo.curve_V = own.numbers("curve_V");
    piezo.curve_um = own.numbers("curve_um");
    piezo.return_to_zero = own.flag("return_to_zero", piezo.return_to_zero);
    piezo.settle_s = own.number("settle_s", Range::any(), piezo.settle_s);
    piezo.steady_s = own.number("steady_s", Range::any(), piezo.steady_s);
    piezo.step_um = own.number("step_um", Range::any(), piezo.step_um);
    piezo.tolerance_V = own.number("tolerance_V", Range::any(), piezo.tolerance_V);
    if (table.has("applied"))
      place.applied = read_modbus_value(table.table("applied"), RegisterUse::number);
    place.piezo = piezo;
    if (!own) return place;
    try {
      piezo.validate();
    } catch (const InvalidValue& error) {
      own.problem(error.key(), error.value(), error.rule());
      return place;
    }
    check_offset_place(table, "piezo",
                       {Range::between(piezo.curve_um.front(), piezo.curve_um.back()), 0.0},
                       axis.limiter);
    if (offset) check_volts(table, "offset", place.offset, piezo);
    if (place.applied) check_volts(table, "applied", *place.applied, piezo);
    return place;
  }

  static void check_volts(const TomlTable& table, std::string_view key, const ModbusValue& value,
                          const PiezoConfig& piezo) {
    const Range volts = reach(value);
    if (!volts.contains(piezo.curve_V.back()))
      table.problem(key, "must be able to hold the curve's voltages, but reaches from " +
                             number_text(volts.min) + " to " + number_text(volts.max));
    if (count_of(value) <= piezo.tolerance_V) return;
    table.problem(key, "one count of " + number_text(count_of(value)) + " V",
                  "must be at most tolerance_V = " + number_text(piezo.tolerance_V));
  }

  ModbusAxis read_plain_axis(const TomlTable& table, const AxisConfig& axis,
                             WrittenRegisters& written) const {
    ModbusAxis place;
    const TomlTable offset = table.table("offset");
    place.offset = read_value_(offset, RegisterUse::written);
    if (offset) {
      written.add(table, "offset", place.offset);
      check_place(table, "offset", place.offset, axis);
    }
    if (table.has("applied")) {
      place.applied = read_value_(table.table("applied"), RegisterUse::number);
      check_place(table, "applied", *place.applied, axis);
    }
    return place;
  }

  void read_can() {
    CanControllerConfig config;
    config.name = name_;
    config.interface = read_interface(table_);
    config.period_s = table_.number("period_s", Range::between(0.005, 60), config.period_s);
    config.silent_after_s =
        table_.number("silent_after_s", Range::between(0.01, 3600), config.silent_after_s);
    config.reconnect_s = table_.number("reconnect_s", Range::between(0.01, 1), config.reconnect_s);
    refuse_all(table_,
               {"host", "port", "unit", "device", "baud", "parity", "data_bits", "stop_bits",
                "rs485", "timeout_ms", "inter_frame_delay_ms", "backoff_s_max", "retries"},
               "does not apply to kind = \"can\"");
    TakenBits sent;
    std::vector<std::optional<CanTravelSection>> travels;
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      travels.push_back(read_can_travel(i, sent));
      config.axes.emplace_back().name = axes_[i].name;
      if (!travels[i]) config.axes[i].offset = read_can_offset(i, sent);
    }
    for (const auto& [key, place] :
         {std::pair("valid_bits", &config.valid_bits), std::pair("heartbeat", &config.heartbeat)}) {
      const TomlTable value = table_.table_or_empty(key);
      if (!value) continue;
      *place = read_can_signal(value, value, CanUse::bits);
      sent.add(table_, key, **place);
    }
    if (config.valid_bits) check_bits(table_, reach(*config.valid_bits).max, axes_.size());
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      if (travels[i]) {
        travels[i]->read_applied(sent);
        travels[i]->check_round(config.period_s, config.silent_after_s);
        config.axes[i].travel = travels[i]->travel();
      } else {
        config.axes[i].applied = read_can_applied(i, sent);
      }
    }
    check_read_back();
    read_signals([&](const TomlTable& table, std::size_t index) {
      config.signals.push_back(
          {index, read_can_signal(table, table, CanUse::signal), table.text("name", "")});
      refuse_sent(table, "id", config.signals.back().value, sent);
      const bool is_switch = unit_of(table.text("name", "")).suffix == "_on";
      if (is_switch && !reach(config.signals.back().value).contains(1.0)) {
        table.problem("signed", "must be false: one bit with a sign is 0 or -1, not 0 or 1");
      }
    });
    result_.can_sent = std::move(sent);
    result_.period_s = config.period_s;
    result_.config = std::move(config);
  }

  [[nodiscard]] std::optional<CanTravelSection> read_can_travel(std::size_t index,
                                                                TakenBits& sent) const {
    const TomlTable& axis = axis_tables_[index];
    if (!travel_table(axis)) return std::nullopt;
    refuse_plain_places(axis);
    return CanTravelSection(axis, axes_[index].limiter, sent);
  }

  [[nodiscard]] CanSignal read_can_offset(std::size_t index, TakenBits& sent) const {
    const TomlTable& table = axis_tables_[index];
    const TomlTable offset = table.table("offset");
    CanSignal signal = read_can_signal(offset, offset, CanUse::offset);
    if (!offset) return signal;
    sent.add(table, "offset", signal);
    check_place(table, "offset", signal, axes_[index]);
    return signal;
  }

  [[nodiscard]] std::optional<CanSignal> read_can_applied(std::size_t index,
                                                          const TakenBits& sent) const {
    const TomlTable& table = axis_tables_[index];
    const TomlTable applied = table.table_or_empty("applied");
    if (!applied) return std::nullopt;
    CanSignal signal = read_can_signal(applied, applied, CanUse::offset);
    refuse_sent(table, "applied", signal, sent);
    check_place(table, "applied", signal, axes_[index]);
    return signal;
  }

  static void refuse_sent(const TomlTable& table, std::string_view key, const CanSignal& signal,
                          const TakenBits& sent) {
    if (sent.has_frame_of(signal)) table.problem(key, "is in a frame that is sent, not received");
  }

  TomlTable table_;
  const std::vector<TomlTable>& axis_tables_;
  std::vector<AxisConfig> axes_;  ///< one per table; of a travel its first node
  std::size_t offsets_;           ///< including nodes of travels
  std::string name_;
  ModbusValue (*read_value_)(const TomlTable&, RegisterUse){read_modbus_value};
  ControllerReading result_;
};

}  // namespace

ControllerReading read_controller(const TomlTable& table, const std::vector<TomlTable>& axis_tables,
                                  const std::vector<AxisConfig>& axes,
                                  const std::map<std::string, ModbusRtu>& serial_lines) {
  return ControllerReader(table, axis_tables, axes).read(serial_lines);
}

}  // namespace thermocomp::sections
