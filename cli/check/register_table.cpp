#include "cli/check/register_table.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <vector>

#include "cli/common/modbus_names.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"
#include "estimator/estimator_config.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

/// Place, type, value, and unit with the size of one count.
using Row = std::array<std::string, 4>;

constexpr const char* registers = "register";
constexpr const char* bits = "bits (DBC numbering)";

/// @param places  title of the first column
std::string table_text(const char* places, std::vector<Row> rows) {
  rows.insert(rows.begin(), Row{places, "type", "value", "unit"});
  std::array<std::size_t, 4> widths{};
  for (const Row& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  std::string text;
  for (const Row& row : rows) {
    std::string line = "  ";
    for (std::size_t i = 0; i < row.size(); ++i)
      line += padded(row[i], static_cast<int>(widths[i])) + "  ";
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

std::string scaled(const std::string& unit, double scale, double offset = 0.0) {
  std::string text = unit.empty() ? "-" : unit;
  if (scale != 1.0) text += ", count x " + number_text(scale);
  if (offset != 0.0) text += ", + " + number_text(offset);
  return text;
}

std::string unit_of_axis(const AxisConfig& axis) {
  return std::string(unit_of(axis.output).symbol);
}

/// "valid bits; bit 0: x, bit 1: z; 1: take the offset"
std::string valid_text(const std::vector<AxisConfig>& axes) {
  std::string text("valid bits; ");
  const std::vector<AxisSpan> spans = axis_spans(axes);
  for (std::size_t i = 0; i < spans.size(); ++i)
    text +=
        (i == 0 ? "bit " : ", bit ") + std::to_string(i) + ": " + axis_name(axes[spans[i].first]);
  return text + "; 1: take the offset";
}

std::string line_of(const ModbusControllerConfig& config) {
  const std::string line = std::string(kind_of(config.line)) + " " + line_name(config.line);
  return s7_of(config.line) != nullptr ? line : line + ", unit " + std::to_string(config.unit);
}

Row axis_row(const ModbusAxis& place, const ModbusValue& value, const AxisConfig& axis,
             const std::string& what) {
  const std::string meant = place.piezo ? "voltage of axis " : "offset of axis ";
  const std::string unit = place.piezo ? "V" : unit_of_axis(axis);
  return {place_name(value), type_name(value), what + meant + axis.name, scaled(unit, value.scale)};
}

/// Adds the registers of a set, which the controller takes over together.
void add_set(const ModbusTravel& travel, const AxisConfig& axis, std::vector<Row>& written,
             std::vector<Row>& read) {
  const std::string of_axis = " of axis " + axis_name(axis);
  const auto number = [&](const ModbusValue& value, const std::string& what) {
    written.push_back({place_name(value), type_name(value), what + of_axis, "-"});
  };
  const auto add = [&](const std::vector<ModbusValue>& values, const std::string& before,
                       std::vector<Row>& rows) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      const TravelValueText text = travel_value_text(travel, unit_of_axis(axis), i);
      rows.push_back({place_name(values[i]), type_name(values[i]),
                      std::string(before).append(text.what).append(of_axis),
                      scaled(text.unit, values[i].scale)});
    }
  };
  number(travel.begin, "begin: number of the set");
  add(travel.values, "", written);
  number(travel.end, "end: number of the set");
  add(travel.applied, "applied ", read);
}

/// Describes how the controller interpolates and when it takes over a set.
template <class Controller>
std::string set_text(const DaemonConfig& config, const Controller& controller,
                     const std::string& taken_over) {
  std::string text;
  const std::vector<AxisSpan> spans = axis_spans(config.estimator.axes);
  for (std::size_t i = 0; i < controller.axes.size(); ++i) {
    const auto& travel = controller.axes[i].travel;
    if (!travel) continue;
    const AxisConfig& axis = config.estimator.axes[spans[i].first];
    text += "  axis " + axis_name(axis) + ": ";
    if (travel->p0_mm)
      text += "offset = K0 + slope (" + axis.node->position + " - " + number_text(*travel->p0_mm) +
              " mm)";
    else
      text += "offset straight from node to node by " + axis.node->position;
    text += ", for " + axis.node->position + " from " + number_text(travel->nodes_mm.front()) +
            " to " + number_text(travel->nodes_mm.back()) + " mm\n";
  }
  if (text.empty()) return text;
  return "\nInterpolated by the controller, by its own position (a set is taken over where " +
         taken_over + "):\n" + text;
}

/// Lists registers between values that a request also reads, and which must therefore exist.
std::string gaps_text(const ModbusControllerConfig& controller,
                      const std::vector<ModbusValue>& values) {
  std::string text;
  if (s7_of(controller.line) != nullptr) return text;  // a data block has no gaps
  const auto add = [&](const ReadRequest& request, std::size_t from, std::size_t to) {
    if (from >= to) return;
    text += (text.empty() ? "" : ", ") + table_name(request.table) + " " + std::to_string(from);
    if (to - from > 1) text += ".." + std::to_string(to - 1);
  };
  const ReadPlan plan = plan_reads(values, controller);
  for (std::size_t r = 0; r < plan.requests.size(); ++r) {
    const ReadRequest& request = plan.requests[r];
    std::map<std::size_t, std::size_t> used;  // first register of each value, and the one after it
    for (std::size_t i = 0; i < values.size(); ++i)
      if (plan.places[i].request == r)
        used[values[i].address] = values[i].address + words_of(values[i].table, values[i].encoding);
    std::size_t reached = request.address;
    for (const auto& [begin, end] : used) {
      add(request, reached, begin);
      reached = std::max(reached, end);
    }
  }
  return text.empty()
             ? text
             : "  also read, so they must exist (gap_registers_max = 0: none): " + text + "\n";
}

std::string modbus_table(const DaemonConfig& config, const ModbusControllerConfig& controller) {
  const std::vector<AxisConfig>& axes = config.estimator.axes;
  std::vector<Row> written;
  std::vector<Row> read;
  std::vector<ModbusValue> values;  // read by the daemon
  const std::vector<AxisSpan> spans = axis_spans(axes);
  for (std::size_t i = 0; i < spans.size(); ++i) {
    const ModbusAxis& place = controller.axes[i];
    const AxisConfig& axis = axes[spans[i].first];
    if (place.travel) {
      add_set(*place.travel, axis, written, read);
      values.insert(values.end(), place.travel->applied.begin(), place.travel->applied.end());
      continue;
    }
    if (place.applied) values.push_back(*place.applied);
    written.push_back(axis_row(place, place.offset, axis, ""));
    if (place.applied) read.push_back(axis_row(place, *place.applied, axis, "applied "));
  }
  if (const auto& valid = controller.valid_bits)
    written.push_back({place_name(*valid), type_name(without_sign(*valid)), valid_text(axes), "-"});
  if (const auto& count = controller.heartbeat)
    written.push_back({place_name(*count), type_name(without_sign(*count)),
                       "heartbeat; counts up with every write, restarts when full", "-"});
  for (const ModbusSignal& signal : controller.signals) {
    const std::string& name = config.estimator.signals[signal.signal];
    values.push_back(signal.value);
    read.push_back({place_name(signal.value), type_name(signal.value), name,
                    scaled(std::string(unit_of(name).symbol), signal.value.scale)});
  }
  const bool is_s7 = s7_of(controller.line) != nullptr;
  const char* places = is_s7 ? "address" : registers;
  std::string text = line_of(controller) + ", every " + number_text(controller.period_s) + " s; " +
                     (is_s7 ? "bytes of the data block, optimized block access off"
                            : "addresses from 0, as on the wire") +
                     "\n\nWritten by the daemon (" +
                     (is_s7 ? "" : "function " + std::to_string(controller.write_function) + "; ") +
                     "offsets, then valid bits, then heartbeat):\n" +
                     table_text(places, std::move(written));
  if (read.empty()) return text + "\nWritten by the controller: nothing\n";
  return text + "\nWritten by the controller, read by the daemon" +
         (is_s7 ? "" : " (functions 1 to 4)") + ":\n" + table_text(places, std::move(read)) +
         gaps_text(controller, values);
}

std::string place_of(const CanSignal& signal) {
  return std::to_string(signal.start_bit) + ", " + std::to_string(signal.length_bits) +
         (signal.length_bits == 1 ? " bit" : " bits");
}

std::string type_of(const CanSignal& signal, bool raw = false) {
  const bool is_signed = signal.is_signed && !raw;
  const std::string type = signal.is_float ? "float" : is_signed ? "signed" : "unsigned";
  return type + (signal.byte_order == ByteOrder::big_endian ? ", big endian" : ", little endian");
}

/// Rows by frame.
using Frames = std::map<std::pair<std::uint32_t, bool>, std::vector<Row>>;

void add(Frames& frames, const CanSignal& signal, const std::string& what, const std::string& unit,
         bool raw = false) {
  frames[{signal.id, signal.extended_id}].push_back(
      {place_of(signal), type_of(signal, raw), what, unit});
}

std::string frames_text(const Frames& frames) {
  std::string text;
  for (const auto& [id, rows] : frames) {
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "0x%X (%d bits)", static_cast<unsigned>(id.first),
                  id.second ? 29 : 11);
    text.append(" frame ").append(name.data()).append("\n").append(table_text(bits, rows));
  }
  return text;
}

/// Adds the frames of a set, which the controller takes over together.
void add_set(Frames& frames, const CanTravel& travel, const CanSet& set, const AxisConfig& axis,
             const std::string& before) {
  const std::string of_axis = " of axis " + axis_name(axis);
  for (std::size_t i = 0; i < set.values.size(); ++i) {
    const TravelValueText text = travel_value_text(travel, unit_of_axis(axis), i);
    add(frames, set.values[i], std::string(before).append(text.what).append(of_axis),
        scaled(text.unit, set.values[i].scale, set.values[i].offset));
  }
  for (const CanSignal& number : set.numbers)
    add(frames, number, std::string(before).append("number of the set").append(of_axis), "-", true);
}

void add_axis(const CanAxis& place, const AxisConfig& axis, Frames& written, Frames& read) {
  if (place.travel) {
    add_set(written, *place.travel, place.travel->sent, axis, "");
    add_set(read, *place.travel, place.travel->applied, axis, "applied ");
    return;
  }
  const std::string unit = unit_of_axis(axis);
  add(written, place.offset, "offset of axis " + axis.name,
      scaled(unit, place.offset.scale, place.offset.offset));
  if (place.applied)
    add(read, *place.applied, "applied offset of axis " + axis.name,
        scaled(unit, place.applied->scale, place.applied->offset));
}

std::string can_table(const DaemonConfig& config, const CanControllerConfig& controller) {
  const std::vector<AxisConfig>& axes = config.estimator.axes;
  Frames written;
  Frames read;
  const std::vector<AxisSpan> spans = axis_spans(axes);
  for (std::size_t i = 0; i < spans.size(); ++i)
    add_axis(controller.axes[i], axes[spans[i].first], written, read);
  if (controller.valid_bits) add(written, *controller.valid_bits, valid_text(axes), "-", true);
  if (controller.heartbeat)
    add(written, *controller.heartbeat, "heartbeat; counts up with every frame, restarts when full",
        "-", true);
  for (const CanControllerSignal& signal : controller.signals) {
    const std::string& name = config.estimator.signals[signal.signal];
    add(read, signal.value, name,
        scaled(std::string(unit_of(name).symbol), signal.value.scale, signal.value.offset));
  }
  std::string text = "CAN " + controller.interface + ", every " + number_text(controller.period_s) +
                     " s\n\nSent by the daemon:\n" + frames_text(written);
  if (read.empty()) return text + "\nSent by the controller: nothing\n";
  return text + "\nSent by the controller, each frame at least every " +
         number_text(controller.silent_after_s) + " s:\n" + frames_text(read);
}

/// Condition for taking over a set from frames.
std::string taken_over_text(const CanControllerConfig& controller) {
  return "its newest frames carry the same number, none older than " +
         number_text(CanTravel::forgotten_after_s(controller.period_s)) + " s";
}

std::string bounds_text(const DaemonConfig& config) {
  std::string text = "\nWhat the daemon keeps to, and the controller should refuse beyond:\n";
  for (const AxisSpan& span : axis_spans(config.estimator.axes)) {
    const AxisConfig& axis = config.estimator.axes[span.first];
    const std::string unit = unit_of_axis(axis);
    text.append("  axis ").append(axis_name(axis)).append(": offset ");
    text.append(axis.node ? "everywhere on the travel " : "").append("within +-");
    text.append(number_text(axis.limiter.offset_um_max)).append(" ").append(unit);
    text.append(", changing by at most ").append(number_text(axis.limiter.rate_um_per_s_max));
    text.append(" ").append(unit).append("/s\n");
  }
  return text;
}

/// Lists optional signals that this configuration does not use, for the PLC programmer.
std::string missing_text(bool valid_bits, bool heartbeat, bool reads_back) {
  std::vector<std::string> lacks;
  if (!valid_bits)
    lacks.emplace_back("valid_bits: the controller cannot detect an axis that it must not move");
  if (!heartbeat)
    lacks.emplace_back("heartbeat: the controller cannot detect that the daemon has stopped");
  if (!reads_back)
    lacks.emplace_back("applied: the daemon cannot check what the controller applies");
  std::string text;
  for (const std::string& lack : lacks)
    text.append(text.empty() ? "\nMissing:\n" : "").append("  no ").append(lack).append("\n");
  return text;
}

template <class Controller>
std::string gaps_of(const Controller& controller) {
  const bool reads_back = std::all_of(controller.axes.begin(), controller.axes.end(),
                                      [](const auto& axis) { return axis.reads_back(); });
  return missing_text(controller.valid_bits.has_value(), controller.heartbeat.has_value(),
                      reads_back);
}

struct TableText {
  const DaemonConfig& config;
  std::string operator()(const ModbusControllerConfig& controller) const {
    return modbus_table(config, controller) +
           set_text(config, controller, "`end`, read first, equals `begin`, read last") +
           bounds_text(config) + gaps_of(controller);
  }
  std::string operator()(const CanControllerConfig& controller) const {
    return can_table(config, controller) +
           set_text(config, controller, taken_over_text(controller)) + bounds_text(config) +
           gaps_of(controller);
  }
  std::string operator()(const BridgeControllerConfig&) const {
    return "LinuxCNC: no registers; its bridge calls the daemon (docs/linuxcnc.md)\n" +
           bounds_text(config);
  }
  std::string operator()(const DryRunControllerConfig&) const {
    return "kind = \"dry_run\": no controller and no registers\n" + bounds_text(config);
  }
};

}  // namespace

std::string register_table(const DaemonConfig& config) {
  const std::string name =
      std::visit([](const auto& each) { return each.name; }, config.controller);
  std::string halves;
  for (const AxisSpan& span : axis_spans(config.estimator.axes)) {
    const AxisConfig& axis = config.estimator.axes[span.first];
    if (const DiameterSpec* diameter = diameter_of(config.model, axis.output))
      halves += "\naxis " + axis_name(axis) + " corrects " + half_of(*diameter) + ", a diameter\n";
  }
  return "controller " + name + ": " + std::visit(TableText{config}, config.controller) + halves +
         (config.dry_run ? "\nDRY RUN: the daemon reads but writes none of these\n" : "");
}

}  // namespace thermocomp::cli
