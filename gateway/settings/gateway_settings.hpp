/// Configuration of thermocomp-gateway, read and validated from one TOML file.
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
  static constexpr std::uintmax_t body_bytes_max = 64 * bytes_per_MB;  ///< a body may have many
                                                                       ///< faces
  bool enabled{true};
  std::string address{"127.0.0.1"};
  std::uint16_t port{8420};           ///< 0: any free port
  std::vector<std::string> names;     ///< host names for browsers, besides address and localhost
  std::filesystem::path certificate;  ///< PEM; empty: no TLS
  std::filesystem::path key;          ///< PEM
  std::filesystem::path passwords;    ///< lines `user:hash`; empty: everyone may read
  std::filesystem::path body;         ///< page of `structure --page`; empty: none
  std::filesystem::path report;       ///< page of `thermocomp report`; empty: none
  unsigned connections_max{100};
  bool operator==(const HttpSettings&) const = default;
  [[nodiscard]] bool has_tls() const { return !certificate.empty(); }
};

/// Commands that change something, given on the page. Require TLS and a password file.
struct CommandSettings {
  std::vector<std::string> users;    ///< names in the password file
  std::vector<std::string> methods;  ///< enable, disable, reference, prove, accept
  bool operator==(const CommandSettings&) const = default;
};

struct MqttSettings {
  bool enabled{false};
  std::string host;
  std::uint16_t port{1883};
  std::string client_id;  ///< empty: thermocomp-<machine>
  std::string user;
  std::filesystem::path password_file;  ///< first line: the password
  std::filesystem::path authority;      ///< PEM of the broker's certificate authority; empty: no
                                        ///< TLS
  std::filesystem::path certificate;    ///< client certificate, if the broker requires one
  std::filesystem::path key;
  double period_s{1.0};               ///< minimum interval between changed values
  std::size_t buffer_messages{5000};  ///< newest messages kept while the broker is away
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
  double raise_after_s{10.0};        ///< duration before an alarm is raised
  double clear_after_s{60.0};        ///< duration before it is cleared
  unsigned per_hour_max{20};
  double command_s_max{30.0};  ///< timeout of the command
  bool operator==(const AlarmSettings&) const = default;
};

struct GatewaySettings {
  std::filesystem::path file;  ///< source of these settings
  std::string machine;         ///< name in topics and titles
  std::string log_level{"info"};
  std::filesystem::path socket{"/run/thermocomp/status.sock"};
  std::filesystem::path history;  ///< empty: the daemon's file
  HttpSettings http;
  CommandSettings commands;
  MqttSettings mqtt;
  ShdrSettings shdr;
  AlarmSettings alarm;
};

/// Also reads the files that it names.
/// @throws ConfigurationError with all problems: file, line, key, value, rule
[[nodiscard]] GatewaySettings load_gateway_settings(const std::filesystem::path& file);

/// Keys of table [http] common to all programs with a page: not `enabled`, `body`, `report`.
/// @param folder  base of relative paths
[[nodiscard]] HttpSettings read_http(const TomlTable& table, const std::filesystem::path& folder);

/// True if the file names a `machine` and has no sensor, axis or controller: it configures the
/// gateway, not the daemon. False if it cannot be read.
[[nodiscard]] bool is_gateway_file(const std::filesystem::path& file);

/// Loopback address, reachable only from this computer.
[[nodiscard]] bool is_loopback(const std::string& address);

}  // namespace thermocomp::gateway
