/// The whole configuration of thermocomp-gateway, as loaded and validated from one TOML file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::gateway {

struct HttpSettings {
  static constexpr std::uintmax_t body_bytes_max = 64 * bytes_per_MB;  ///< of many faces
  bool enabled{true};
  std::string address{"127.0.0.1"};
  std::uint16_t port{8420};           ///< 0: any that is free
  std::vector<std::string> names;     ///< by which browsers reach it, besides address and localhost
  std::filesystem::path certificate;  ///< PEM; empty: no TLS
  std::filesystem::path key;          ///< PEM
  std::filesystem::path passwords;    ///< lines `user:hash`; empty: everybody may read
  std::filesystem::path body;         ///< page of `structure --page`; empty: none
  std::filesystem::path report;       ///< page of `thermocomp report`; empty: none
  unsigned connections_max{100};
  bool operator==(const HttpSettings&) const = default;
  [[nodiscard]] bool has_tls() const { return !certificate.empty(); }
};

/// Commands that change something, over the page. None without TLS and a password file.
struct CommandSettings {
  std::vector<std::string> users;    ///< of the password file
  std::vector<std::string> methods;  ///< enable, disable, reference, prove
  bool operator==(const CommandSettings&) const = default;
};

struct MqttSettings {
  bool enabled{false};
  std::string host;
  std::uint16_t port{1883};
  std::string client_id;  ///< empty: thermocomp-<machine>
  std::string user;
  std::filesystem::path password_file;  ///< its first line
  std::filesystem::path authority;      ///< PEM of who signed the broker's; empty: no TLS
  std::filesystem::path certificate;    ///< of our own, where the broker wants one
  std::filesystem::path key;
  double period_s{1.0};               ///< values that change are sent this often at most
  std::size_t buffer_messages{5000};  ///< kept while the broker is away; the newest
  bool operator==(const MqttSettings&) const = default;
};

struct ShdrSettings {
  bool enabled{false};
  std::string address{"127.0.0.1"};
  std::uint16_t port{7878};
  double heartbeat_s{10.0};
  unsigned agents_max{8};
  bool operator==(const ShdrSettings&) const = default;
};

struct AlarmSettings {
  std::vector<std::string> command;  ///< program and arguments; empty: none
  double raise_after_s{10.0};        ///< wrong for so long
  double clear_after_s{60.0};        ///< right for so long
  unsigned per_hour_max{20};
  double command_s_max{30.0};  ///< ended then
  bool operator==(const AlarmSettings&) const = default;
};

struct GatewaySettings {
  std::filesystem::path file;  ///< where it was read from
  std::string machine;         ///< its name in topics and titles
  std::string log_level{"info"};
  std::filesystem::path socket{"/run/thermocomp/status.sock"};
  std::filesystem::path history;  ///< empty: the file that the daemon names
  HttpSettings http;
  CommandSettings commands;
  MqttSettings mqtt;
  ShdrSettings shdr;
  AlarmSettings alarm;
};

/// Looks into the files it names too.
/// @throws ConfigurationError with every problem: file, line, key, value, rule
[[nodiscard]] GatewaySettings load_gateway_settings(const std::filesystem::path& file);

/// What every program that serves a page has in its table [http]: not `enabled`, `body`, `report`.
/// @param folder  of the file, for paths that do not begin with a slash
[[nodiscard]] HttpSettings read_http(const TomlTable& table, const std::filesystem::path& folder);

/// Whether a file is meant for the gateway and not for the daemon: it names a `machine` and has no
/// sensor, axis or controller. A file that cannot be read is not.
[[nodiscard]] bool is_gateway_file(const std::filesystem::path& file);

/// An address that only this computer reaches.
[[nodiscard]] bool is_loopback(const std::string& address);

}  // namespace thermocomp::gateway
