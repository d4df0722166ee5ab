#include "daemon/controller_lock.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fmt/format.h>
#include <set>

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

std::string line_name(const ModbusRtu& rtu, int) {
  struct stat device {};
  if (stat(rtu.device.c_str(), &device) == 0 && S_ISCHR(device.st_mode))
    return fmt::format("controller at serial device {}:{}", major(device.st_rdev),
                       minor(device.st_rdev));
  // The device is not plugged in yet.
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
  std::vector<NameLock> locks;
  for (const std::string& name : controller_names(config, dry_run)) locks.emplace_back(name);
  return locks;
}

}  // namespace thermocomp
