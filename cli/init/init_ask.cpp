#include "cli/init/init_ask.hpp"

#include <algorithm>
#include <istream>
#include <ostream>
#include <set>

#include "cli/init/init_specs.hpp"

namespace thermocomp::cli {
namespace {

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

void ask_for_buses(InitDraft& draft, Questions& questions) {
  while (true) {
    const bool is_first = draft.buses.empty();
    std::string answer;
    questions.ask_until(
        is_first ? std::string("Bus of the sensors' modules: ") + link_forms
                 : "Another bus? Enter: none",
        is_first ? "rtu:/dev/ttyUSB0:19200:even" : "", [&](const std::string& text) {
          answer = text;
          if (text.empty()) return;
          draft.buses.push_back({"bus" + std::to_string(draft.buses.size() + 1), parse_link(text)});
        });
    if (answer.empty()) return;
  }
}

bool is_used(const InitDraft& draft, const std::string& sensor) {
  for (const InitModule& module : draft.modules)
    for (const InitChannel& channel : module.channels)
      if (channel.sensor == sensor) return true;
  return false;
}

/// The model's inputs without a sensor, in its order; then names from unit and channel.
std::vector<std::string> proposed_names(const InitDraft& draft, const InitModule& module) {
  std::vector<std::string> wanted;
  for (const std::string& input : draft.model_inputs) {
    const std::string sensor = input.substr(0, input.rfind("_degC"));
    if (!is_used(draft, sensor)) wanted.push_back(sensor);
  }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < module.channels.size(); ++i)
    names.push_back(i < wanted.size() ? wanted[i]
                                      : sensor_name(draft, module, module.channels[i].number));
  return names;
}

/// Offers another word order if all channels give a temperature only with that one.
void offer_word_order(const InitDraft& draft, const InitModule& form, InitModule& asked,
                      Questions& questions, const MachineQueries& eyes) {
  if (!form.preset.empty() || asked.channels.size() == form.channels.size() ||
      form.registers.encoding.ends_with("16"))
    return;
  for (const char* order : {"CDAB", "BADC", "DCBA", "ABCD"}) {
    InitModule other = form;
    other.registers.word_order = order;
    const std::vector<std::string> lines = eyes.try_module(draft, other);
    if (other.channels.size() != form.channels.size()) continue;
    for (const std::string& line : lines) questions.print("    " + line);
    questions.ask_until(std::string("In word order ") + order + " all give a temperature; take it?",
                        "yes", [&](const std::string& text) {
                          if (text.starts_with("y")) asked = other;
                        });
    return;
  }
}

/// @throws Failure with the presets as its text, so that the question is repeated
[[noreturn]] void show_presets(const std::string& word, const MachineQueries& eyes) {
  std::string text;
  for (const std::string& line : eyes.preset_lines(word)) text += "\n    " + line;
  throw Failure(text.empty() ? word + ": no preset has this word" : "presets:" + text);
}

void ask_for_module(InitDraft& draft, std::size_t bus, int unit, Questions& questions,
                    const MachineQueries& eyes) {
  const std::string where = "unit " + std::to_string(unit) + " on " + bus_text(draft.buses.at(bus));
  InitModule module;
  module.bus = bus;
  module.unit = unit;
  module.name = "module" + std::to_string(draft.modules.size() + 1);
  bool is_wanted = false;
  questions.ask_until(
      "Module of " + where +
          ": its preset, or TABLE:TYPE:DEGC_A_COUNT:ADDRESSES[:OPEN_CIRCUIT_CODES] such as "
          "input:int16:0.1:0-7; ? lists the presets, ?WORD those with the word, Enter: none",
      "", [&](const std::string& text) {
        is_wanted = !text.empty();
        if (!is_wanted) return;
        if (text.starts_with("?")) show_presets(text.substr(1), eyes);
        InitModule form = module;
        parse_form(text, form);
        InitModule asked = form;
        if (eyes.try_module) {
          for (const std::string& line : eyes.try_module(draft, asked))
            questions.print("    " + line);
          offer_word_order(draft, form, asked, questions, eyes);
        } else {
          refuse_unnamed_channels(asked);
        }
        if (asked.channels.empty()) throw Failure("no channel gives a temperature");
        module = asked;
      });
  if (!is_wanted) return;
  const std::vector<std::string> proposed = proposed_names(draft, module);
  const std::string names_of = "Names of the sensors of " + where;
  questions.ask_until(names_of, joined(proposed), [&](const std::string& text) {
    const std::vector<std::string> names = parse_words(text);
    if (names.size() != module.channels.size())
      throw Failure(std::to_string(module.channels.size()) + " names, please: " + joined(proposed));
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (is_used(draft, names[i]) || std::count(names.begin(), names.end(), names[i]) > 1)
        throw Failure(names[i] + ": the names of sensors must be unique");
      module.channels[i].sensor = names[i];
    }
  });
  draft.modules.push_back(module);
}

void ask_for_modules(InitDraft& draft, Questions& questions, const MachineQueries& eyes) {
  for (std::size_t bus = 0; bus < draft.buses.size();) {
    const std::string name = bus_text(draft.buses[bus]);
    std::vector<int> units;
    if (eyes.find_units) units = eyes.find_units(draft.buses[bus]);
    if (units.empty())
      questions.ask_until(eyes.find_units
                              ? "No unit answers on " + name + ". Units to use nevertheless"
                              : "Units of the modules on " + name,
                          "1", [&](const std::string& text) { units = parse_numbers(text); });
    const std::size_t before = draft.modules.size();
    for (const int unit : units) ask_for_module(draft, bus, unit, questions, eyes);
    if (draft.modules.size() > before) {
      ++bus;
      continue;
    }
    if (draft.buses.size() == 1) throw Failure("a machine needs a module with a sensor");
    questions.print(name + " is left out: it has no module");
    draft.buses.erase(draft.buses.begin() + static_cast<std::ptrdiff_t>(bus));
  }
}

void ask_for_places(InitController& controller, Questions& questions) {
  const auto optional_place = [&](const char* what, const char* otherwise,
                                  std::optional<InitPlace>& place) {
    questions.ask_until(what, otherwise, [&](const std::string& text) {
      place.reset();
      if (text != "none") place = parse_place(text);
    });
  };
  questions.ask_until(
      "Offset of the first axis, followed by the others: TABLE:ADDRESS:TYPE:UM_A_COUNT (TYPE "
      "int32/CDAB "
      "for low word first)",
      "holding:0:int32:0.01",
      [&](const std::string& text) { controller.offset = parse_place(text); });
  optional_place("Read-back of the applied offset, or none", "input:0:int32:0.01",
                 controller.applied);
  optional_place("Valid bits, or none", "holding:10:uint16", controller.valid_bits);
  optional_place("Heartbeat, or none", "holding:11:uint16", controller.heartbeat);
}

void ask_for_controller(InitDraft& draft, Questions& questions) {
  questions.ask_until(
      "Controller: tcp:HOST[:PORT][@UNIT], udp:..., rtu_over_tcp:..., rtu:..., "
      "linuxcnc, or none",
      "none", [&](const std::string& text) {
        const bool dry_run = draft.controller.dry_run;
        draft.controller = parse_controller(text);
        draft.controller.dry_run = dry_run;
      });
  if (!draft.controller.is_modbus()) return;
  questions.ask_until(
      "Registers as in docs/controllers/plc.md? Offsets from holding 0 on, applied from input 0 on "
      "(int32, 0.01 um per count), valid bits holding 10, heartbeat holding 11; yes or no",
      "yes", [&](const std::string& text) {
        if (text == "no" || text == "n") return ask_for_places(draft.controller, questions);
        if (text != "yes" && text != "y") throw Failure("yes or no");
      });
  const std::vector<std::string> needed = missing_signals(draft);
  questions.ask_until(
      "Further values to read from it, NAME=TABLE:ADDRESS[:TYPE[:SCALE]], such as "
      "spindle_rpm=input:26:uint16, or none" +
          (needed.empty() ? "" : " (the model needs " + joined(needed) + ")"),
      "none", [&](const std::string& text) {
        std::vector<InitSignal> signals;
        for (const std::string& word : parse_words(text))
          if (word != "none") signals.push_back(parse_signal(word));
        draft.controller.signals = signals;
        if (const std::vector<std::string> missing = missing_signals(draft); !missing.empty())
          throw Failure("the model needs " + joined(missing));
      });
}

}  // namespace

std::string Questions::ask(const std::string& question, const std::string& otherwise) {
  if (next_ < answers_.size()) return answers_[next_++];
  ++count_;
  out_ << question << (otherwise.empty() ? "" : " [" + otherwise + "]") << ": " << std::flush;
  std::string line;
  if (!std::getline(in_, line))
    throw InputEnded("init: the input ended before all questions were answered");
  const std::size_t first = line.find_first_not_of(" \t\r");
  if (first == std::string::npos)
    line = otherwise;
  else
    line = line.substr(first, line.find_last_not_of(" \t\r") - first + 1);
  if (line == "<") throw GoBack{};
  answers_.push_back(line);
  ++next_;
  return line;
}

void Questions::ask_until(const std::string& question, const std::string& otherwise,
                          const std::function<void(const std::string&)>& take) {
  while (true) {
    const std::size_t before = next_;
    const std::string answer = ask(question, otherwise);
    try {
      return take(answer);
    } catch (const InputEnded&) {
      throw;
    } catch (const Failure& failure) {
      answers_.resize(next_ = before);
      print(failure.what());
    }
  }
}

void Questions::interview(const std::function<void()>& body) {
  while (true) {
    next_ = 0;
    try {
      return body();
    } catch (const GoBack&) {
    } catch (const InputEnded&) {
      throw;
    } catch (const Failure& failure) {
      if (answers_.empty()) throw;
      print(failure.what());
    }
    if (!answers_.empty()) answers_.pop_back();
  }
}

void Questions::print(const std::string& text) {
  if (next_ == answers_.size()) out_ << text << '\n';
}

std::vector<std::string> missing_signals(const InitDraft& draft) {
  std::vector<std::string> missing;
  for (const std::string& name : draft.model_signals)
    if (std::none_of(draft.controller.signals.begin(), draft.controller.signals.end(),
                     [&](const InitSignal& signal) { return signal.name == name; }))
      missing.push_back(name);
  return missing;
}

std::string sensor_name(const InitDraft& draft, const InitModule& module, int number) {
  std::string name;
  if (draft.buses.size() > 1) name.append("b").append(std::to_string(module.bus + 1));
  name.append("m").append(std::to_string(module.unit));
  return name.append("_").append(std::to_string(number));
}

void refuse_unnamed_channels(const InitModule& module) {
  if (module.channels.empty())
    throw Failure(module.preset + ": with --no-scan the channels must be named, such as " +
                  module.preset + ":1-4");
}

void ask_for_rest(InitDraft& draft, bool has_controller, Questions& questions,
                  const MachineQueries& eyes) {
  if (draft.buses.empty()) ask_for_buses(draft, questions);
  if (draft.modules.empty()) ask_for_modules(draft, questions, eyes);
  if (!has_controller) ask_for_controller(draft, questions);
  if (draft.axes.empty())
    questions.ask_until("Axes that get an offset", "z",
                        [&](const std::string& text) { draft.axes = parse_axes(text); });
}

}  // namespace thermocomp::cli
