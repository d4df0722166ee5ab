#include "fleet/uplink/uplink_settings.hpp"

#include <stdexcept>

#include "config/toml/toml_reader.hpp"
#include "fleet/store/store.hpp"

namespace thermocomp::fleet {

namespace fs = std::filesystem;

UplinkSettings load_uplink_settings(const fs::path& file) {
  const TomlDocument document = TomlDocument::from_file(file);
  const TomlTable root = document.root();
  const auto path = [&](const std::string& name) {
    return fs::path(name).is_absolute() ? fs::path(name) : file.parent_path() / name;
  };
  UplinkSettings settings;
  static_cast<void>(root.integer("format", 1, 1));
  const std::string machine = root.text("machine");
  const std::string store = root.text("store");
  std::map<std::string, std::string> more{{"user", "machine_" + machine},
                                          {"application_name", "thermocomp-uplink"}};
  if (root.has("password_file")) {
    try {
      const std::string text = read_text_file(path(root.text("password_file")));
      more["password"] = text.substr(0, text.find('\n'));
    } catch (const std::exception& error) {
      root.problem("password_file", error.what());
    }
  }
  try {
    settings.store = complete_conninfo(store, std::move(more));
  } catch (const std::invalid_argument& error) {
    root.problem("store", error.what());
  }
  for (const std::string& name : root.texts("history", {"/var/lib/thermocomp/history.db"}))
    settings.history.push_back(path(name));
  settings.period_s = root.number("period_s", Range::between(1, 3600), settings.period_s);
  settings.cpu_percent_max =
      root.number("cpu_percent_max", Range::between(0.1, 100), settings.cpu_percent_max);
  settings.releases = {path(root.text("offer", "/var/lib/thermocomp-uplink/offer.json")),
                       path(root.text("steps", "/var/lib/thermocomp-admit/steps.json"))};
  document.finish();
  return settings;
}

}  // namespace thermocomp::fleet
