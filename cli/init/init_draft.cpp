#include "cli/init/init_draft.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "cli/common/modbus_names.hpp"
#include "config/text/printable_text.hpp"
#include "config/toml/toml_text.hpp"
#include "daemon/history/replay/replay.hpp"

namespace thermocomp::cli {
namespace {

std::string key_text(const char* key, const std::string& value) {
  return std::string(key) + " = " + toml_string(value) + "\n";
}

std::string key_number(const char* key, int value) {
  return std::string(key) + " = " + std::to_string(value) + "\n";
}

std::string parity_word(char parity) {
  return parity == 'E' ? "even" : parity == 'O' ? "odd" : "none";
}

std::string link_text(const std::variant<ModbusTcp, ModbusRtu>& link) {
  if (const auto* tcp = std::get_if<ModbusTcp>(&link)) {
    return key_text("kind", kind_of({link})) + key_text("host", tcp->host) +
           key_number("port", tcp->port);
  }
  const auto& rtu = std::get<ModbusRtu>(link);
  return key_text("kind", "modbus_rtu") + key_text("device", rtu.device) +
         key_number("baud", rtu.baud) + key_text("parity", parity_word(rtu.parity));
}

/// { table = "holding", address = 0, encoding = "int32", scale = 0.01 }
std::string place_text(const InitPlace& place, int address) {
  std::string text =
      "{ table = " + toml_string(place.table) + ", address = " + std::to_string(address);
  if (!place.encoding.empty()) text += ", encoding = " + toml_string(place.encoding);
  if (place.word_order != "ABCD") text += ", word_order = " + toml_string(place.word_order);
  if (place.scale != 1.0) text += ", scale = " + toml_number(place.scale);
  return text + " }";
}

int words_of(const InitPlace& place) {
  if (place.encoding == "float64") return 4;
  return place.encoding.ends_with("32") ? 2 : 1;
}

std::string buses_text(const InitDraft& draft) {
  std::string text =
      "# ---------------------------------------------------------------- sensors\n"
      "# One [[bus]] a line or gateway, one [[device]] a module on it, one [[sensor]] a "
      "thermocouple.\n";
  for (const InitBus& bus : draft.buses)
    text += "[[bus]]\n" + key_text("name", bus.name) + link_text(bus.link) + "\n";
  return text;
}

std::string codes_text(const std::vector<std::int64_t>& codes) {
  constexpr const char* what = "   # raw codes that are messages: see the module's manual\n";
  if (codes.empty()) return std::string("# open_circuit_codes = [32767]") + what;
  std::string text;
  for (const std::int64_t code : codes) text += (text.empty() ? "" : ", ") + std::to_string(code);
  return "open_circuit_codes = [" + text + "]" + what;
}

std::string module_text(const InitDraft& draft, const InitModule& module) {
  std::string text = "[[device]]\n" + key_text("name", module.name) +
                     key_text("bus", draft.buses.at(module.bus).name) +
                     key_number("unit", module.unit);
  if (!module.preset.empty()) {
    text += "preset = " + toml_string(module.preset) +
            "   # from the module's manual; the preset's file lists what is not confirmed\n";
    if (!module.thermocouple.empty()) text += key_text("thermocouple", module.thermocouple);
    if (module.base_address) text += key_number("base_address", *module.base_address);
  } else {
    const InitPlace& place = module.registers;
    text += key_text("table", place.table) + key_text("encoding", place.encoding);
    if (place.word_order != "ABCD") text += key_text("word_order", place.word_order);
    text += "scale = " + toml_number(place.scale) + "   # degC per count\n" +
            codes_text(module.open_circuit_codes);
  }
  for (const InitChannel& channel : module.channels) {
    text += "[[sensor]]\n" + key_text("name", channel.sensor) + key_text("device", module.name) +
            key_number(module.preset.empty() ? "address" : "channel", channel.number);
  }
  return text + "\n";
}

std::string blocks_text(const InitDraft& draft) {
  std::string text =
      "# ---------------------------------------------------------------- inputs of the model\n"
      "# Each block is one temperature of the model; several sensors in one block are averaged.\n";
  for (const InitModule& module : draft.modules) {
    for (const InitChannel& channel : module.channels) {
      const std::string input = input_name(channel.sensor);
      const auto& wanted = draft.model_inputs;
      const bool is_wanted =
          wanted.empty() || std::find(wanted.begin(), wanted.end(), input) != wanted.end();
      if (!is_wanted) {
        text += "# sensor " + channel.sensor +
                " is in no block: the model does not use it, it is "
                "recorded only\n";
        continue;
      }
      text += "[[block]]\n" + key_text("name", channel.sensor) + key_text("input", input) +
              "sensors = [" + toml_string(channel.sensor) + "]\n";
    }
  }
  return text + "\n";
}

std::string dry_run_text(const InitController& controller) {
  return controller.dry_run
             ? "dry_run = true        # reads all of it and writes nothing; false: writes offsets\n"
             : "# dry_run = true      # reads all of it and writes nothing\n";
}

std::string controller_text(const InitController& controller) {
  std::string text =
      "# ---------------------------------------------------------------- controller\n"
      "[controller]\nname = \"cnc\"\n";
  if (!controller.is_modbus()) {
    text += key_text("kind", controller.kind);
    if (controller.kind == "dry_run")
      text += "# No controller yet: offsets are computed and recorded, not sent.\n";
    else
      text += dry_run_text(controller);
    return text + "\n";
  }
  text +=
      link_text(controller.link) + key_number("unit", controller.unit) + dry_run_text(controller);
  if (!controller.reads_gaps)
    text +=
        "gap_registers_max = 0 # it refuses requests that include registers between its values\n";
  if (const auto& valid = controller.valid_bits)
    text += "valid_bits = " + place_text(*valid, valid->address) + "\n";
  if (const auto& count = controller.heartbeat)
    text += "heartbeat = " + place_text(*count, count->address) + "\n";
  for (const InitSignal& signal : controller.signals) {
    const InitPlace& place = signal.place;
    text += "[[controller.signal]]\n" + key_text("name", signal.name) +
            key_text("table", place.table) + key_number("address", place.address);
    if (!place.encoding.empty()) text += key_text("encoding", place.encoding);
    if (place.word_order != "ABCD") text += key_text("word_order", place.word_order);
    if (place.scale != 1.0) text += "scale = " + toml_number(place.scale) + "\n";
  }
  if (controller.signals.empty())
    text +=
        "# [[controller.signal]]   # positions and speeds that the model needs or that are to be\n"
        "# name = \"spindle_rpm\"    # recorded; the unit is the end of the name\n"
        "# table = \"input\"\n# address = 26\n# encoding = \"uint16\"\n";
  return text + "\n";
}

std::string axes_text(const InitDraft& draft) {
  std::string text;
  const InitController& controller = draft.controller;
  for (std::size_t i = 0; i < draft.axes.size(); ++i) {
    const std::string& axis = draft.axes[i];
    const auto index = static_cast<int>(i);
    text.append("[[axis]]\n")
        .append(key_text("name", axis))
        .append(key_text("output", output_name(draft, axis)))
        .append("sign = 1                 # prove it with an indicator: thermocomp prove ")
        .append(axis)
        .append(" 5; -1 where the tool moves the other way\noffset_um_max = ")
        .append(toml_number(draft.offset_um_max))
        .append("      # small to begin with; raise it when the model is trusted\n")
        .append("rate_um_per_s_max = ")
        .append(toml_number(draft.rate_um_per_s_max))
        .append("\n");
    if (!controller.is_modbus()) continue;
    const InitPlace& offset = controller.offset;
    text += "offset = " + place_text(offset, offset.address + index * words_of(offset)) + "\n";
    if (const auto& applied = controller.applied)
      text +=
          "applied = " + place_text(*applied, applied->address + index * words_of(*applied)) + "\n";
  }
  return text + "\n";
}

/// Signals named as in the documents have that meaning; others are recorded.
std::string compensation_text(const InitController& controller) {
  std::string text;
  const auto add = [&](const char* key, const char* name) {
    const auto has_name = [name](const InitSignal& signal) { return signal.name == name; };
    if (std::any_of(controller.signals.begin(), controller.signals.end(), has_name))
      text += key_text(key, name);
  };
  add("cutting_signal", "cutting_on");
  add("disable_signal", "compensation_off_on");
  return text.empty() ? text : "[compensation]\n" + text + "\n";
}

std::string files_text(const InitDraft& draft) {
  if (draft.own_folder.empty()) return "[history]\n# file = \"/var/lib/thermocomp/history.db\"\n";
  return "[history]\nfile = " + toml_string(draft.own_folder + "/history.db") +
         "\n[socket]\npath = " + toml_string(draft.own_folder + "/status.sock") + "\n";
}

}  // namespace

std::string output_name(const InitDraft& draft, const std::string& axis) {
  const auto small = [](std::string text) {
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
    return text;
  };
  for (const std::string& output : draft.model_outputs)
    if (small(output.substr(0, output.rfind('_'))) == small(axis)) return output;
  return small(axis) + "_um";
}

std::string bus_text(const InitBus& bus) {
  return bus.name + " (" + line_name({bus.link}) + ")";
}

std::string input_name(const std::string& sensor) {
  return sensor_column(sensor);
}

std::string configuration_text(const InitDraft& draft) {
  std::string text =
      "# Configuration of thermocompd, written by `thermocomp init`. It may be edited;\n"
      "# `thermocomp check` checks it. docs/configuration.md and\n"
      "# config/examples/small_machine.toml have every key.\n"
      "format = 1\n";
  if (!draft.own_folder.empty())
    text += "state_file = " + toml_string(draft.own_folder + "/state.json") + "\n";
  const bool is_relative = std::filesystem::path(draft.model_file).is_relative();
  text += "\n[model]\nfile = " + toml_string(draft.model_file) +
          (is_relative ? "                # relative to this file" : "") + "\n\n" +
          buses_text(draft);
  for (const InitModule& module : draft.modules) text += module_text(draft, module);
  return text + blocks_text(draft) + controller_text(draft.controller) + axes_text(draft) +
         compensation_text(draft.controller) + files_text(draft);
}

std::string first_model_text(const InitDraft& draft) {
  std::vector<std::string> inputs;
  for (const InitModule& module : draft.modules)
    for (const InitChannel& channel : module.channels) inputs.push_back(input_name(channel.sensor));
  std::vector<std::string> outputs;
  for (const std::string& axis : draft.axes) outputs.push_back(output_name(draft, axis));
  const std::vector<std::vector<double>> rows(outputs.size(),
                                              std::vector<double>(inputs.size(), 0.0));
  return "# Placeholder model without displacement, written by `thermocomp init`. Record and\n"
         "# measure, then replace it with the result of `thermocomp fit` or\n"
         "# `thermocomp structure` (docs/first_machine.md).\n"
         "format = 1\ninputs = " +
         toml_list(inputs, toml_string) + "\noutputs = " + toml_list(outputs, toml_string) +
         "\nreference = \"first_sample\"\nmatrix_um_per_K = " + toml_rows(rows);
}

}  // namespace thermocomp::cli
