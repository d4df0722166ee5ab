#include "cli/init/init_probe.hpp"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <set>
#include <unistd.h>
#include <utility>

#include <system_error>

#include "cli/scan/scan_bus.hpp"
#include "cli/scan/scan_controller.hpp"
#include "config/buses/presets.hpp"
#include "config/daemon/daemon_config.hpp"
#include "config/text/problems.hpp"
#include "config/toml/toml_text.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

namespace fs = std::filesystem;

void progress(const std::string& line) {
  std::fprintf(stderr, "%s\n", line.c_str());
}

/// Temporary files in the target's folder, where presets are found; removed by the destructor.
class TrialFiles {
 public:
  TrialFiles(InitDraft draft, const fs::path& folder) {
    const std::string name = ".thermocomp-init-" + std::to_string(::getpid());
    config_ = folder / (name + ".toml");
    model_ = folder / (name + "-model.toml");
    if (draft.model_inputs.empty()) draft.model_file = model_.filename().string();
    write(model_, first_model_text(draft));
    write(config_, configuration_text(draft));
  }
  ~TrialFiles() {
    std::error_code ignored;
    fs::remove(config_, ignored);
    fs::remove(model_, ignored);
  }
  TrialFiles(const TrialFiles&) = delete;
  TrialFiles& operator=(const TrialFiles&) = delete;
  [[nodiscard]] const fs::path& config() const noexcept { return config_; }

 private:
  static void write(const fs::path& path, const std::string& text) {
    std::ofstream file(path);
    file << text;
    if (!file.flush()) throw Failure(path.string() + ": cannot be written");
  }
  fs::path config_;
  fs::path model_;
};

/// Channels of a preset. @throws Failure if it does not exist or is not for Modbus
std::vector<int> channels_of_preset(const std::string& name, const fs::path& folder) {
  sections::Presets presets(sections::preset_folders(folder));
  const TomlDocument asked =
      TomlDocument::from_text("preset = " + toml_string(name) + "\n", "the answer");
  const sections::Preset* preset = presets.of_device(asked.root());
  if (preset == nullptr) {
    const std::vector<Problem> problems = asked.all_problems();
    throw Failure(name + " " + (problems.empty() ? "cannot be read" : problems.front().rule));
  }
  if (preset->protocol != "modbus")
    throw Failure(name + ": is a preset for " + preset->protocol +
                  "; init describes Modbus modules, for others begin with an example");
  std::vector<int> numbers;
  for (const auto& [number, table] : preset->channels) numbers.push_back(number);
  return numbers;
}

/// Empty for a preset that is not for Modbus or cannot be read.
std::string preset_line(const fs::path& path) {
  try {
    const TomlDocument preset = TomlDocument::from_file(path);
    if (preset.root().text("protocol", "") != "modbus") return "";
    return path.stem().string() + ": " + preset.root().text("maker", "") + ", " +
           preset.root().text("model", "");
  } catch (const ConfigurationError&) {
    return "";
  }
}

std::string lower(std::string text) {
  for (char& letter : text)
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  return text;
}

ModbusLine line_of(const InitBus& bus) {
  ModbusLine line;
  line.link = bus.link;
  return line;
}

/// "channel 3: 21.50 degC", "channel 4: open_circuit, the device's code for it".
std::string line_of(int number, const ScanChannel& channel, bool has_preset) {
  std::string text = (has_preset ? "channel " : "address ") + std::to_string(number) + ": ";
  if (channel.good()) return text + fixed(channel.temp_degC, 2) + " degC";
  text += std::string(to_string(channel.fault)) + (channel.why.empty() ? "" : ", " + channel.why);
  for (const std::string& hint : channel.hints) text += "; " + hint;
  return text;
}

/// Takes over the open-circuit codes that channels show now. Such a value is out of range anyway;
/// with the code, the fault has the right name.
void take_codes(const ScanDevice& device, InitModule& module, std::vector<std::string>& lines) {
  std::set<std::int64_t> codes;
  for (const ScanChannel& channel : device.channels)
    if (channel.likely_open_code) codes.insert(*channel.likely_open_code);
  for (const std::int64_t code : codes) {
    module.open_circuit_codes.push_back(code);
    lines.push_back("open_circuit_codes: " + std::to_string(code) + " is written down as one");
  }
}

/// Loads the temporary files; problems omit file and line, since the files are deleted.
DaemonConfig load_trial(const fs::path& file) {
  try {
    return load_daemon_config(file);
  } catch (const ConfigurationError& error) {
    std::vector<Problem> problems = error.problems();
    for (Problem& problem : problems) {
      if (problem.file.find("/.thermocomp-init-") == std::string::npos) continue;
      problem.file = "init";
      problem.line = 0;
    }
    throw ConfigurationError(std::move(problems));
  }
}

}  // namespace

std::vector<std::string> preset_lines(const fs::path& folder, const std::string& word) {
  std::map<std::string, std::string> lines;  // key: name
  for (const fs::path& each : sections::preset_folders(folder)) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(each, error)) {
      const std::string name = entry.path().stem().string();
      if (entry.path().extension() == ".toml" && !lines.contains(name))
        lines[name] = preset_line(entry.path());
    }
  }
  // Manufacturers' terms for platinum sensors.
  const std::vector<std::string> platinum{"pt100", "pt1000", "rtd"};
  std::vector<std::string> wanted{lower(word)};
  if (std::find(platinum.begin(), platinum.end(), wanted.front()) != platinum.end())
    wanted = platinum;
  std::vector<std::string> found;
  for (const auto& [name, line] : lines) {
    const std::string text = lower(line);
    if (std::any_of(wanted.begin(), wanted.end(), [&](const std::string& each) {
          return !text.empty() && text.find(each) != std::string::npos;
        }))
      found.push_back(line);
  }
  return found;
}

ScanReport probe(const InitDraft& draft, const fs::path& folder) {
  const TrialFiles files(draft, folder);
  const DaemonConfig config = load_trial(files.config());
  const ScanSensors sensors = scan_sensors(config.estimator.sensors);
  constexpr double listen_s = 1.0;
  const ScanTask task{listen_s, {}, progress};
  ScanReport report{"", {}, {}};
  for (const BusConfig& bus : config.buses)
    report.buses.push_back(scan_bus(std::get<ModbusBusConfig>(bus), sensors, task));
  constexpr bool writes_back = false;
  report.controller = scan_controller(config, listen_s, writes_back, progress);
  return report;
}

void check_draft(const InitDraft& draft, const fs::path& folder) {
  const TrialFiles files(draft, folder);
  try {
    static_cast<void>(load_trial(files.config()));
  } catch (const ConfigurationError& error) {
    std::string text;
    for (const Problem& problem : error.problems())
      text += (text.empty() ? "" : "\n") + to_string(problem);
    throw Failure(text);
  }
}

std::vector<std::string> try_module(const InitDraft& draft, InitModule& module,
                                    const fs::path& folder) {
  const bool has_preset = !module.preset.empty();
  if (has_preset && module.channels.empty())
    for (const int number : channels_of_preset(module.preset, folder))
      module.channels.push_back({"", number});
  InitDraft alone;
  alone.buses = {draft.buses.at(module.bus)};
  alone.axes = {"z"};
  alone.modules = {module};
  alone.modules[0].bus = 0;
  for (InitChannel& channel : alone.modules[0].channels)
    channel.sensor = "channel" + std::to_string(channel.number);
  std::vector<std::string> lines;
  try {
    const ScanReport report = probe(alone, folder);
    const ScanBus& bus = report.buses.at(0);
    if (!bus.error.empty()) throw Failure(bus.error);
    const ScanDevice& device = bus.devices.at(0);
    std::vector<InitChannel> good;
    for (std::size_t i = 0; i < device.channels.size(); ++i) {
      lines.push_back(line_of(module.channels[i].number, device.channels[i], has_preset));
      if (device.channels[i].good()) good.push_back(module.channels[i]);
    }
    module.channels = good;
    if (!has_preset) take_codes(device, module, lines);
  } catch (const ConfigurationError& error) {
    if (error.problems().empty()) throw Failure(error.what());
    const Problem& first = error.problems().front();
    throw Failure((first.key.empty() ? "" : first.key + ": ") + first.rule);
  }
  return lines;
}

MachineQueries eyes_of(const fs::path& folder) {
  MachineQueries eyes;
  // Cached, so that an interview that goes back does not search again.
  eyes.find_units = [known =
                         std::map<std::string, std::vector<int>>{}](const InitBus& bus) mutable {
    const std::string name = bus_text(bus);
    if (const auto found = known.find(name); found != known.end()) return found->second;
    ModbusBusConfig config;
    config.name = bus.name;
    config.line = line_of(bus);
    constexpr int last = 32;
    const ScanBus found = scan_bus(config, {}, {0.0, {true, 1, last}, progress});
    if (!found.error.empty()) progress("bus " + bus.name + ": " + found.error);
    if (!found.found.empty()) progress("bus " + bus.name + ": " + found.found);
    // A device that answers on every unit number counts once.
    return known[name] =
               found.found_numbers.size() == last ? std::vector<int>{1} : found.found_numbers;
  };
  eyes.preset_lines = [folder](const std::string& word) { return preset_lines(folder, word); };
  eyes.try_module = [folder](const InitDraft& draft, InitModule& module) {
    return try_module(draft, module, folder);
  };
  return eyes;
}

}  // namespace thermocomp::cli
