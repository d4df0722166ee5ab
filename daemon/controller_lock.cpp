#include "daemon/controller_lock.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <fmt/format.h>
#include <set>

#include <netdb.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <system_error>

namespace thermocomp {
namespace {

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::string line_name(const ModbusTcp& tcp, int unit) {
  if (tcp.s7)
    return fmt::format("controller at S7 {}:{} DB{}", lower_case(tcp.host), tcp.port, tcp.s7->db);
  return fmt::format("controller at Modbus TCP {}:{} unit {}", lower_case(tcp.host), tcp.port,
                     unit);
}

/// Addresses of a host, so that "plc" and "10.0.0.5" are one controller; empty if unknown.
std::vector<std::string> addresses_of(const std::string& host) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* first = nullptr;
  if (getaddrinfo(host.c_str(), nullptr, &hints, &first) != 0) return {};
  std::vector<std::string> addresses;
  for (const addrinfo* each = first; each != nullptr; each = each->ai_next) {
    std::array<char, NI_MAXHOST> text{};
    if (getnameinfo(each->ai_addr, each->ai_addrlen, text.data(), text.size(), nullptr, 0,
                    NI_NUMERICHOST) == 0)
      addresses.emplace_back(text.data());
  }
  freeaddrinfo(first);
  return addresses;
}

std::string line_name(const ModbusRtu& rtu, int) {
  struct stat device {};
  if (stat(rtu.device.c_str(), &device) == 0 && S_ISCHR(device.st_mode))
    return fmt::format("controller at serial device {}:{}", major(device.st_rdev),
                       minor(device.st_rdev));
  // The device may not be plugged in yet.
  std::error_code error;
  const auto path = std::filesystem::weakly_canonical(rtu.device, error);
  return "controller at serial device " + (error ? rtu.device : path.string());
}

struct Names {
  std::vector<std::string> operator()(const DryRunControllerConfig&) const { return {}; }
  std::vector<std::string> operator()(const BridgeControllerConfig&) const { return {}; }
  std::vector<std::string> operator()(const ModbusControllerConfig& config) const {
    return {std::visit([&](const auto& link) { return line_name(link, config.unit); },
                       config.line.link)};
  }
  std::vector<std::string> operator()(const CanControllerConfig& config) const {
    std::set<std::string> names;
    const auto add = [&](const CanSignal& signal) {
      names.insert(fmt::format("controller at CAN {} frame {:#x}{}", config.interface, signal.id,
                               signal.extended_id ? " (29 bits)" : ""));
    };
    for (const CanAxis& axis : config.axes) add(axis.offset);
    if (config.valid_bits) add(*config.valid_bits);
    if (config.heartbeat) add(*config.heartbeat);
    return {names.begin(), names.end()};
  }
};

}  // namespace

std::vector<std::string> controller_names(const ControllerConfig& config, bool dry_run) {
  const auto* modbus = std::get_if<ModbusControllerConfig>(&config);
  const bool is_serial = modbus != nullptr && std::holds_alternative<ModbusRtu>(modbus->line.link);
  if (dry_run && !is_serial) return {};
  return std::visit(Names{}, config);
}

std::string controller_identity(const ControllerConfig& config) {
  if (const auto* bridge = std::get_if<BridgeControllerConfig>(&config))
    return "bridge " + bridge->name;
  return fmt::format("{}", fmt::join(controller_names(config), ", "));
}

std::vector<NameLock> lock_controller(const ControllerConfig& config, bool dry_run) {
  const std::vector<std::string> spelled = controller_names(config, dry_run);
  std::set<std::string> names(spelled.begin(), spelled.end());
  const auto* modbus = std::get_if<ModbusControllerConfig>(&config);
  const auto* tcp = modbus == nullptr ? nullptr : std::get_if<ModbusTcp>(&modbus->line.link);
  if (!names.empty() && tcp != nullptr) {
    ModbusTcp same = *tcp;
    for (const std::string& address : addresses_of(tcp->host)) {
      same.host = address;
      names.insert(line_name(same, modbus->unit));
    }
  }
  std::vector<NameLock> locks;
  for (const std::string& name : names) locks.emplace_back(name);
  return locks;
}

}  // namespace thermocomp
