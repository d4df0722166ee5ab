#include "config/daemon/daemon_config.hpp"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <sys/stat.h>
#include <system_error>

#include "config/buses/buses.hpp"
#include "config/model/model_file.hpp"
#include "config/sections/controller_section.hpp"
#include "config/sections/estimator_sections.hpp"
#include "config/sections/model_binding.hpp"
#include "config/toml/toml_reader.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "estimator/sensing/sensor.hpp"

namespace thermocomp {
namespace {

/// The files named by a configuration: a file that the daemon writes must differ from all others,
/// whatever the path or link.
enum class FileUse {
  read,
  written,  ///< a regular file, or missing
  socket    ///< a socket, or missing
};

struct NamedFile {
  TomlTable table;
  std::string key;  ///< key in `table` of the file's name; empty: the configuration itself
  std::filesystem::path path;
  FileUse use{FileUse::read};
  /// Suffixes of further files created next to it.
  std::vector<std::string> endings{};
};

/// Adds a problem for each loop of links, each path that is not a regular file, and each pair of
/// names of the same file if one of them is written. Paths are compared with links resolved,
/// existing files also by device and inode.
void check_named_files(const std::vector<NamedFile>& files);

namespace fs = std::filesystem;

constexpr int links_max = 40;  // the kernel's limit

/// The path with links resolved, also that to a missing file.
/// @return empty, with `why`, on failure
fs::path followed(fs::path path, std::string& why) {
  std::error_code error;
  for (int links = 0; fs::is_symlink(fs::symlink_status(path, error)); ++links) {
    if (links == links_max) {
      why = "must not be a loop of links";
      return {};
    }
    const fs::path target = fs::read_symlink(path, error);
    path = target.is_absolute() ? target : path.parent_path() / target;
  }
  fs::path result = fs::weakly_canonical(path, error);
  if (!error) return result;
  why = error == std::errc::too_many_symbolic_link_levels ? "must not lead through a loop of links"
                                                          : "cannot be reached: " + error.message();
  return {};
}

/// A file on disk, by one of its names.
struct Place {
  const NamedFile* named;
  fs::path path;  ///< links resolved
  std::optional<std::pair<dev_t, ino_t>> inode;
};

bool is_same(const Place& a, const Place& b) {
  return a.path == b.path || (a.inode && a.inode == b.inode);
}

std::string name_of(const NamedFile& file) {
  if (file.key.empty()) return "this configuration";
  const std::string& table = file.table.path();
  return table.empty() ? file.key : table + "." + file.key;
}

void check_kind(const NamedFile& file, const struct stat& status) {
  // The daemon moves an unusable state file aside, of any type.
  if (file.use == FileUse::written && file.key != "state_file" && !S_ISREG(status.st_mode)) {
    file.table.problem(file.key, file.path.string(), "must be a regular file, or not be there");
  }
  if (file.use == FileUse::socket && !S_ISSOCK(status.st_mode)) {
    file.table.problem(file.key, file.path.string(), "must be a socket, or not be there");
  }
}

void add_places(const NamedFile& file, std::vector<Place>& places) {
  if (file.path.empty()) return;  // reported already
  std::string why;
  const fs::path path = followed(file.path, why);
  if (!why.empty()) {
    if (!file.key.empty()) file.table.problem(file.key, file.path.string(), why);
    return;
  }
  const auto add = [&](const fs::path& place, bool is_itself) {
    struct stat status {};
    Place added{&file, place, std::nullopt};
    if (::stat(place.c_str(), &status) == 0) {
      added.inode = {status.st_dev, status.st_ino};
      if (is_itself) check_kind(file, status);
    }
    places.push_back(std::move(added));
  };
  add(path, true);
  for (const std::string& ending : file.endings) add(path.string() + ending, false);
}

void check_named_files(const std::vector<NamedFile>& files) {
  std::vector<Place> places;
  for (const NamedFile& file : files) add_places(file, places);
  for (const Place& place : places) {
    if (place.named->use == FileUse::read) continue;
    for (const Place& other : places) {
      // A pair of written files is reported once, at the later name.
      const bool is_reported = other.named->use != FileUse::read && other.named >= place.named;
      if (other.named == place.named || is_reported || !is_same(place, other)) continue;
      place.named->table.problem(place.named->key, place.named->path.string(),
                                 "must not be the same file as " + name_of(*other.named));
      break;
    }
  }
}

/// A path in the file; relative to the file's folder.
fs::path read_path(const TomlTable& table, std::string_view key, const fs::path& otherwise,
                   const fs::path& folder) {
  const fs::path path = table.text(key, otherwise.string());
  if (!path.has_filename()) table.problem(key, "must name a file");
  return path.is_absolute() ? path : (folder / path).lexically_normal();
}

LoopConfig read_loop(const TomlTable& table) {
  LoopConfig loop;
  loop.rate_hz = table.number("rate_hz", Range::between(1, 1000), loop.rate_hz);
  loop.priority = table.integer("priority", 1, 98, loop.priority);
  loop.cpu = table.integer("cpu", -1, 1023, loop.cpu);
  loop.real_time = table.choice<RealTimeRule>(
      "real_time", {{"warn", RealTimeRule::warn}, {"require", RealTimeRule::require}},
      loop.real_time);
  return loop;
}

HistoryConfig read_history(const TomlTable& table, const fs::path& folder) {
  HistoryConfig history;
  history.enabled = table.flag("enabled", history.enabled);
  history.file = read_path(table, "file", history.file, folder);
  history.size_MB_max = table.number("size_MB_max", Range::between(1, 1e6), history.size_MB_max);
  history.age_days_max = table.number("age_days_max", Range::above(0, 36500), history.age_days_max);
  history.commit_s = table.number("commit_s", Range::between(0.1, 10), history.commit_s);
  history.offsets_period_s =
      table.number("offsets_period_s", Range::between(0.01, 3600), history.offsets_period_s);
  history.segment_h = table.number("segment_h", Range::between(0.01, 168), history.segment_h);
  return history;
}

SocketConfig read_socket(const TomlTable& table, const fs::path& folder) {
  constexpr std::size_t path_max = 107;  // sockaddr_un::sun_path less the end
  SocketConfig socket;
  socket.path = read_path(table, "path", socket.path, folder);
  if (socket.path.string().size() > path_max) {
    table.problem("path", "must have at most " + std::to_string(path_max) + " characters");
  }
  socket.read_group = table.text("read_group", socket.read_group);
  socket.operator_group = table.text("operator_group", socket.operator_group);
  socket.bridge_group = table.text("bridge_group", socket.bridge_group);
  socket.model_group = table.text("model_group", socket.model_group);
  return socket;
}

/// The temperatures that modules show for a raw 0, which they send while they are not ready.
void note_raw_zeros(DaemonConfig& config) {
  for (const BusConfig& bus : config.buses) {
    const auto* const modbus = std::get_if<ModbusBusConfig>(&bus);
    if (modbus == nullptr) continue;
    for (const ModbusDeviceConfig& device : modbus->devices)
      for (const ModbusChannel& channel : device.channels)
        config.estimator.sensors[channel.sensor].screening.raw_0_degC = channel.offset_degC;
  }
}

/// Sensors and frames of buses on this interface.
std::vector<std::pair<std::size_t, CanSignal>> received_on(const std::string& interface,
                                                           const std::vector<BusConfig>& buses) {
  std::vector<std::pair<std::size_t, CanSignal>> received;
  for (const BusConfig& bus : buses) {
    if (const auto* can = std::get_if<CanBusConfig>(&bus); can && can->interface == interface)
      for (const CanDeviceConfig& device : can->devices)
        for (const CanChannel& channel : device.channels)
          received.emplace_back(channel.sensor, channel.signal);
    if (const auto* open = std::get_if<CanopenBusConfig>(&bus);
        open && open->interface == interface)
      for (const CanopenNodeConfig& node : open->nodes)
        for (const CanopenChannel& channel : node.channels)
          if (channel.way == CanopenWay::pdo_bits)
            received.emplace_back(channel.sensor, channel.signal);
  }
  return received;
}

/// Refuses sensors in a frame that the daemon sends: it would measure its own offset.
void check_own_frames(const std::vector<TomlTable>& sensors, const std::vector<BusConfig>& buses,
                      const sections::ControllerReading& controller) {
  const auto* const can = std::get_if<CanControllerConfig>(&controller.config);
  if (can == nullptr) return;
  for (const auto& [sensor, signal] : received_on(can->interface, buses))
    if (controller.can_sent.has_frame_of(signal))
      sensors[sensor].problem("name",
                              "is in a frame that the daemon itself sends to the controller: give "
                              "the identifier of the module's frame");
}

void check_controller_period(const TomlTable& compensation, const DaemonConfig& config,
                             double period_s) {
  if (config.estimator.compensation.controller_stale_after_s > period_s) return;
  compensation.problem("controller_stale_after_s",
                       std::to_string(config.estimator.compensation.controller_stale_after_s),
                       "must be more than the controller's period_s");
}

/// Reads everything except the model file's content.
/// @return the tables to be checked against the model
sections::BindingTables read_daemon(const TomlTable& root, const fs::path& folder,
                                    sections::Presets& presets, sections::BusFiles& bus_files,
                                    DaemonConfig& config) {
  static_cast<void>(root.integer("format", 1, 1));
  config.log_level = root.choice<std::string>("log_level",
                                              {{"trace", "trace"},
                                               {"debug", "debug"},
                                               {"info", "info"},
                                               {"warning", "warning"},
                                               {"error", "error"}},
                                              config.log_level);
  config.state_file = read_path(root, "state_file", config.state_file, folder);
  config.loop = read_loop(root.table_or_empty("loop"));
  config.history = read_history(root.table_or_empty("history"), folder);
  config.socket = read_socket(root.table_or_empty("socket"), folder);

  const std::vector<TomlTable> sensors = root.tables_required("sensor");
  sections::BindingTables tables{root, root.tables_required("block"), root.tables_required("axis")};
  config.estimator.sensors = sections::read_sensors(root, sensors);
  config.estimator.blocks = sections::read_blocks(tables.blocks, config.estimator.sensors);
  config.estimator.axes = sections::read_axes(tables.axes);
  for (AxisConfig& axis : config.estimator.axes)
    axis.limiter.step_s_max = std::min(axis.limiter.step_s_max, 2.0 / config.loop.rate_hz);
  config.buses =
      sections::read_buses(root, {sensors, config.estimator.sensors}, presets, bus_files);
  note_raw_zeros(config);

  sections::ControllerReading controller = sections::read_controller(
      root.table("controller"), tables.axes, config.estimator.axes, bus_files.serial_lines);
  check_own_frames(sensors, config.buses, controller);
  config.controller = std::move(controller.config);
  config.estimator.signals = std::move(controller.signals);
  config.dry_run = controller.dry_run;
  // A dry run simulates the applied offsets (drivers/controllers/kinds/make_controller.hpp).
  config.estimator.controller_reads_back = controller.reads_back || controller.dry_run;
  const TomlTable compensation = root.table_or_empty("compensation");
  config.estimator.compensation =
      sections::read_compensation(compensation, config.estimator.signals);
  check_controller_period(compensation, config, controller.period_s);
  config.estimator.correction = sections::read_correction(root.table_or_empty("correction"));
  // Without an offset at the machine, a measured remainder is the total displacement.
  if (config.dry_run) config.estimator.correction.measured = MeasuredMeaning::total;
  return tables;
}

void check_files(const TomlTable& root, const DaemonConfig& config, const fs::path& folder) {
  std::vector<NamedFile> files{{root, "", config.file},
                               {root.table("model"), "file", config.model_file},
                               {root, "state_file", config.state_file, FileUse::written, {".new"}}};
  if (config.history.enabled) {
    files.push_back({root.table_or_empty("history"),
                     "file",
                     config.history.file,
                     FileUse::written,
                     {"-wal", "-shm", "-journal"}});
  }
  files.push_back({root.table_or_empty("socket"), "path", config.socket.path, FileUse::socket, {}});
  const auto add_read = [&](const TomlTable& table, const char* key) {
    if (table.is_text(key)) files.push_back({table, key, folder / table.text(key)});
  };
  for (const TomlTable& bus : root.tables("bus")) add_read(bus, "dbc");
  for (const TomlTable& device : root.tables("device")) add_read(device, "eds");
  check_named_files(files);
}

struct ModelSource {
  std::string name;
  std::optional<std::string> text;  ///< none: reported already
};

enum class Files { opened, only_named };

/// The line of a key of the file's top table; 0: not found.
int line_of(const std::string& text, const std::string& key) {
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number)
    if (line.starts_with(key) && line.find('=') != std::string::npos) return number;
  return 0;
}

/// Reports reference values that this machine's configured sensors cannot measure.
void add_reference_problems(const ModelSource& source, const DaemonConfig& config,
                            std::vector<Problem>& problems) {
  const std::vector<double>& reference_degC = config.model.reference_degC;
  for (std::size_t i = 0; i < std::min(reference_degC.size(), config.model.inputs.size()); ++i) {
    const TemperatureRange range(config.estimator, config.model.inputs[i]);
    if (range.holds(reference_degC[i])) continue;
    std::string key("reference[");
    key.append(std::to_string(i)).append("]");
    std::ostringstream value;
    value << reference_degC[i];
    const auto line = line_of(*source.text, "reference");
    problems.push_back({source.name, line, key, value.str(), range.rule()});
  }
}

/// Warnings about a valid configuration, and flaws of bus files in entries that it does not use.
std::vector<std::string> remarks_of(const sections::BusFiles& files, const std::string& name) {
  constexpr std::size_t shown_max = 20;
  std::vector<Problem> all = files.remarks;
  for (Problem& each : all) each.file = name;
  for (const auto& flaws : {files.dbc.flaws(false), files.eds.flaws(false)}) {
    all.insert(all.end(), flaws.begin(), flaws.end());
  }
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < all.size() && i < shown_max; ++i) lines.push_back(to_string(all[i]));
  if (all.size() > shown_max) {
    lines.push_back("and " + std::to_string(all.size() - shown_max) + " more such remarks");
  }
  return lines;
}

/// The candidate's configuration: blocks that its model uses, and a correction that is never
/// updated and only keeps history for parts measured later.
EstimatorConfig beside(EstimatorConfig config, const ThermalModel& model) {
  const std::vector<std::string> columns = model.temperature_columns();
  std::erase_if(config.blocks, [&](const BlockConfig& block) {
    return std::find(columns.begin(), columns.end(), block.input) == columns.end();
  });
  if (config.correction.form == CorrectionForm::off) return config;
  config.correction.form = CorrectionForm::recursive;
  config.correction.groups = {{model.inputs.front()}};
  return config;
}

CandidateModel read_candidate(const fs::path& file, const EstimatorConfig& estimator) {
  CandidateModel candidate;
  candidate.file = file;
  try {
    const std::string text = read_text_file(file, model_bytes_max);
    ModelReading reading = read_model_text(text, file.string());
    if (!reading.problems.empty()) throw ConfigurationError(std::move(reading.problems));
    candidate.checksum = sha256_hex(text);
    candidate.model = std::move(reading.model);
    candidate.model.course.reset();
    candidate.estimator = beside(estimator, candidate.model);
    static_cast<void>(Estimator(candidate.estimator, candidate.model));
  } catch (const std::exception& error) {
    candidate.problem = error.what();
  }
  return candidate;
}

template <class FindModel>
DaemonConfig build(const TomlDocument& document, const fs::path& folder, Files files,
                   sections::Presets presets, sections::DbcFiles dbc_files,
                   sections::EdsFiles eds_files, FindModel find_model) {
  DaemonConfig config;
  config.file = document.name();
  config.text = document.text();
  const TomlTable root = document.root();
  const TomlTable model_table = root.table("model");
  config.model_file = read_path(model_table, "file", "model.toml", folder);
  if (!model_table.has("file")) model_table.problem("file", "must be given");
  sections::BusFiles bus_files{dbc_files, eds_files, {}, {}, {}, {}};
  const sections::BindingTables tables = read_daemon(root, folder, presets, bus_files, config);
  if (files == Files::opened) {
    check_files(root, config, folder);
  } else if (config.history.file == config.state_file) {
    root.problem("state_file", "must not be the history's file");
  }

  const ModelSource source = find_model(model_table, config.model_file);
  std::vector<Problem> model_problems;
  if (source.text) {
    ModelReading reading = read_model_text(*source.text, source.name);
    model_problems = std::move(reading.problems);
    config.model = std::move(reading.model);
    config.model_text = *source.text;
    config.model_checksum = sha256_hex(*source.text);
    if (reading.names_known) {
      sections::check_binding(tables, config.estimator, config.model, source.name);
      sections::check_correction(root.table_or_empty("correction"), config.estimator.correction,
                                 config.model);
      add_reference_problems(source, config, model_problems);
    }
  }
  const fs::path candidate =
      model_table.has("candidate") ? read_path(model_table, "candidate", "", folder) : fs::path();
  std::vector<Problem> problems = document.all_problems();
  const auto add = [&problems](const std::vector<Problem>& more) {
    problems.insert(problems.end(), more.begin(), more.end());
  };
  add(presets.problems());
  add(dbc_files.flaws(true));
  add(eds_files.flaws(true));
  add(model_problems);
  if (!problems.empty()) throw ConfigurationError(std::move(problems));
  config.remarks = remarks_of(bus_files, document.name());
  if (files == Files::opened) set_candidate(config, candidate);
  return config;
}

ModelSource read_model_file(const TomlTable& model_table, const fs::path& path) {
  ModelSource source{path.string(), std::nullopt};
  if (!model_table.is_text("file")) return source;
  try {
    source.text = read_text_file(path, model_bytes_max);
  } catch (const ConfigurationError& error) {
    model_table.problem("file", error.problems().front().rule + " (" + path.string() + ")");
  }
  return source;
}

}  // namespace

DaemonConfig load_daemon_config(const fs::path& path) {
  const TomlDocument document = TomlDocument::from_file(path);
  const fs::path folder = fs::absolute(path).parent_path();
  return build(document, folder, Files::opened, sections::Presets(sections::preset_folders(folder)),
               sections::DbcFiles(folder), sections::EdsFiles(folder), read_model_file);
}

DaemonConfig parse_daemon_config(const std::string& config_text, const std::string& config_name,
                                 const std::string& model_text, const std::string& model_name) {
  const TomlDocument document = TomlDocument::from_text(config_text, config_name);
  const fs::path folder = fs::path(config_name).parent_path();
  return build(document, folder, Files::only_named, sections::Presets({}),
               sections::DbcFiles(std::nullopt), sections::EdsFiles(std::nullopt),
               [&](const TomlTable&, const fs::path&) {
                 return ModelSource{model_name, model_text};
               });
}

void set_candidate(DaemonConfig& config, const std::filesystem::path& file) {
  config.candidate.reset();
  if (file.empty()) return;
  config.candidate = read_candidate(file, config.estimator);
  if (!config.candidate->problem.empty())
    config.remarks.push_back("the candidate " + file.string() +
                             " does not run: " + config.candidate->problem);
}

}  // namespace thermocomp
