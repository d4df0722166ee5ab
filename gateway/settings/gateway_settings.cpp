#include "gateway/settings/gateway_settings.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <unistd.h>
#include <utility>

#include "config/toml/toml_reader.hpp"
#include "gateway/settings/secret_files.hpp"

namespace thermocomp::gateway {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t name_bytes_max = 64;

/// Allowed as part of a topic, label or file name.
bool is_plain_name(const std::string& name) {
  return !name.empty() && name.size() <= name_bytes_max &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '_' || c == '-' || c == '.';
         });
}

bool is_numeric_address(const std::string& address) {
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  return inet_pton(AF_INET, address.c_str(), bytes.data()) == 1 ||
         inet_pton(AF_INET6, address.c_str(), bytes.data()) == 1;
}

/// Path relative to the folder of the file; empty if the key is absent.
fs::path path_in(const TomlTable& table, std::string_view key, const fs::path& folder) {
  if (!table.has(key)) return {};
  const fs::path named = table.text(key);
  if (named.empty()) return {};
  return named.is_absolute() ? named : (folder / named).lexically_normal();
}

using ReadFile = void (*)(const fs::path&);

void read_text(const fs::path& file) {
  static_cast<void>(read_text_file(file));
}

/// The same for a file that must exist and be accepted by `read`; otherwise start-up would fail.
fs::path existing_in(const TomlTable& table, std::string_view key, const fs::path& folder,
                     ReadFile read) {
  fs::path named = path_in(table, key, folder);
  std::error_code ignored;
  if (named.empty()) return named;
  if (!fs::is_regular_file(named, ignored)) {
    table.problem(key, "must name a file that exists");
    return named;
  }
  try {
    read(named);
  } catch (const ConfigurationError& error) {
    for (const Problem& problem : error.problems()) table.problem(key, to_string(problem));
  }
  return named;
}

/// Reads `certificate` and `key`: both or neither.
void read_pair(const TomlTable& table, const fs::path& folder, fs::path& certificate,
               fs::path& key) {
  certificate = existing_in(table, "certificate", folder, &read_certificate);
  key = existing_in(table, "key", folder, &read_key);
  if (certificate.empty() != key.empty())
    table.problem(key.empty() ? "key" : "certificate",
                  "certificate and key must be given together");
  try {
    if (!certificate.empty() && !key.empty() && !fit_each_other(certificate, key))
      table.problem("key", "must be the key of the certificate");
  } catch (const ConfigurationError&) {
    // Reported by existing_in().
  }
}

std::string address_in(const TomlTable& table, const std::string& otherwise) {
  std::string given = table.text("address", otherwise);
  if (!is_numeric_address(given))
    table.problem("address", "must be an IPv4 or IPv6 address in numbers");
  return given;
}

/// Reads the tables of one file; paths are relative to its folder.
class SettingsReader {
 public:
  SettingsReader(const TomlTable& root, fs::path folder)
      : root_(root), folder_(std::move(folder)) {}

  void read(GatewaySettings& settings) const {
    static_cast<void>(root_.integer("format", 1, 1));
    settings.machine = root_.text("machine");
    if (!settings.machine.empty() && !is_plain_name(settings.machine))
      root_.problem("machine", "must be at most 64 letters, digits, `_`, `-` or `.`");
    settings.log_level = root_.choice<std::string>(
        "log_level",
        {{"debug", "debug"}, {"info", "info"}, {"warning", "warning"}, {"error", "error"}},
        settings.log_level);
    read_daemon(root_.table_or_empty("daemon"), settings);
    const TomlTable http = root_.table_or_empty("http");
    settings.http = gateway::read_http(http, folder_);
    settings.http.enabled = http.flag("enabled", settings.http.enabled);
    settings.http.body = existing_in(http, "body", folder_, [](const fs::path& file) {
      static_cast<void>(read_text_file(file, HttpSettings::body_bytes_max));
    });
    settings.http.report = path(http, "report");  // may not exist yet
    settings.commands = read_commands(root_.table_or_empty("commands"), settings.http);
    settings.mqtt = read_mqtt(root_.table_or_empty("mqtt"));
    settings.shdr = read_shdr(root_.table_or_empty("shdr"));
    settings.alarm = read_alarm(root_.table_or_empty("alarm"));
  }

 private:
  [[nodiscard]] fs::path path(const TomlTable& table, std::string_view key) const {
    return path_in(table, key, folder_);
  }

  void read_daemon(const TomlTable& table, GatewaySettings& settings) const {
    if (const fs::path socket = path(table, "socket"); !socket.empty()) settings.socket = socket;
    constexpr std::size_t path_max = 107;  // sockaddr_un::sun_path without the terminator
    if (settings.socket.string().size() > path_max)
      table.problem("socket", "must have at most 107 characters");
    settings.history = path(table, "history");
  }

  [[nodiscard]] static CommandSettings read_commands(const TomlTable& table,
                                                     const HttpSettings& http) {
    CommandSettings commands;
    if (!table) return commands;
    commands.users = table.texts("users");
    commands.methods = table.texts("methods", {"enable", "disable"});
    const std::vector<std::string> known{"enable", "disable", "reference", "prove", "accept"};
    for (const std::string& method : commands.methods)
      if (std::find(known.begin(), known.end(), method) == known.end())
        table.problem("methods", method,
                      "must be one of enable, disable, reference, prove, accept");
    if (!http.has_tls() || http.passwords.empty())
      table.problem("users", "commands need TLS and a password file in [http]");
    return commands;
  }

  [[nodiscard]] MqttSettings read_mqtt(const TomlTable& table) const {
    MqttSettings mqtt;
    if (!table) return mqtt;
    mqtt.enabled = table.flag("enabled", true);
    mqtt.host = table.text("host");
    mqtt.authority = existing_in(table, "authority", folder_, &read_certificate);
    mqtt.port =
        table.integer<std::uint16_t>("port", 1, 65535, mqtt.authority.empty() ? 1883 : 8883);
    mqtt.client_id = table.text("client_id", "");
    mqtt.user = table.text("user", "");
    mqtt.password_file = existing_in(table, "password_file", folder_, &read_text);
    read_pair(table, folder_, mqtt.certificate, mqtt.key);
    mqtt.period_s = table.number("period_s", Range::between(0.5, 60), mqtt.period_s);
    mqtt.buffer_messages =
        table.integer<std::size_t>("buffer_messages", 100, 100000, mqtt.buffer_messages);
    if (!mqtt.password_file.empty() && mqtt.user.empty())
      table.problem("password_file", "needs user");
    if (!mqtt.certificate.empty() && mqtt.authority.empty())
      table.problem("certificate", "needs authority, which enables TLS");
    return mqtt;
  }

  [[nodiscard]] static ShdrSettings read_shdr(const TomlTable& table) {
    ShdrSettings shdr;
    if (!table) return shdr;
    shdr.enabled = table.flag("enabled", true);
    shdr.address = address_in(table, shdr.address);
    shdr.port = table.integer<std::uint16_t>("port", 0, 65535, shdr.port);
    shdr.heartbeat_s = table.number("heartbeat_s", Range::between(1, 60), shdr.heartbeat_s);
    shdr.agents_max = table.integer<unsigned>("agents_max", 1, 64, shdr.agents_max);
    return shdr;
  }

  [[nodiscard]] static AlarmSettings read_alarm(const TomlTable& table) {
    AlarmSettings alarm;
    alarm.command = table.texts("command", {});
    alarm.raise_after_s =
        table.number("raise_after_s", Range::between(0, 3600), alarm.raise_after_s);
    alarm.clear_after_s =
        table.number("clear_after_s", Range::between(0, 86400), alarm.clear_after_s);
    alarm.per_hour_max = table.integer<unsigned>("per_hour_max", 1, 1000, alarm.per_hour_max);
    alarm.command_s_max =
        table.number("command_s_max", Range::between(1, 600), alarm.command_s_max);
    if (alarm.command.empty()) return alarm;
    if (!fs::path(alarm.command.front()).is_absolute())
      table.problem("command", alarm.command.front(), "must begin with a program's absolute path");
    else if (access(alarm.command.front().c_str(), X_OK) != 0)
      table.problem("command", alarm.command.front(), "must be a program that can be run");
    return alarm;
  }

  const TomlTable& root_;
  fs::path folder_;
};

}  // namespace

GatewaySettings load_gateway_settings(const fs::path& file) {
  const TomlDocument document = TomlDocument::from_file(file);
  GatewaySettings settings;
  settings.file = file;
  const TomlTable root = document.root();
  SettingsReader(root, file.parent_path()).read(settings);
  document.finish();
  if (settings.mqtt.client_id.empty()) settings.mqtt.client_id = "thermocomp-" + settings.machine;
  return settings;
}

bool is_loopback(const std::string& address) {
  in_addr four{};
  if (inet_pton(AF_INET, address.c_str(), &four) == 1) return (ntohl(four.s_addr) >> 24) == 127;
  in6_addr six{};
  return inet_pton(AF_INET6, address.c_str(), &six) == 1 && IN6_IS_ADDR_LOOPBACK(&six) != 0;
}

HttpSettings read_http(const TomlTable& table, const fs::path& folder) {
  HttpSettings http;
  http.address = address_in(table, http.address);
  http.port = table.integer<std::uint16_t>("port", 0, 65535, http.port);
  http.names = table.texts("names", {});
  read_pair(table, folder, http.certificate, http.key);
  http.passwords = existing_in(table, "passwords", folder, [](const fs::path& file) {
    static_cast<void>(read_passwords(file));
  });
  http.connections_max = table.integer<unsigned>("connections_max", 4, 2000, http.connections_max);
  if (!http.passwords.empty() && !http.has_tls())
    table.problem("passwords",
                  "needs certificate and key: passwords never go over the network "
                  "in the clear");
  if (!is_loopback(http.address) && is_numeric_address(http.address) &&
      (!http.has_tls() || http.passwords.empty()))
    table.problem("address",
                  "other computers reach this one: needs certificate, key and "
                  "passwords");
  return http;
}

bool is_gateway_file(const fs::path& file) {
  try {
    const TomlDocument document = TomlDocument::from_file(file);
    const TomlTable root = document.root();
    return root.is_text("machine") && !root.has("sensor") && !root.has("axis") &&
           !root.has("controller");
  } catch (const ConfigurationError&) {
    return false;
  }
}

}  // namespace thermocomp::gateway
