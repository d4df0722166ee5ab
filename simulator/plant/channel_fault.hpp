/// What a simulated device shows of a channel in place of its temperature.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

namespace thermocomp {

/// What a device can say of a channel instead of its temperature.
enum class ChannelFault { open_circuit, short_circuit, over_range, under_range, error };
/// Raw codes for it; the first of a list is shown unless an event names another.
using FaultCodes = std::map<ChannelFault, std::vector<std::int64_t>>;

/// The code that is shown for the fault: `named` if it is listed, else the first listed; nullopt:
/// no fault, or no code for it.
[[nodiscard]] inline std::optional<std::int64_t> code_for(const FaultCodes& codes,
                                                          std::optional<ChannelFault> fault,
                                                          std::optional<std::int64_t> named) {
  if (!fault) return std::nullopt;
  const auto found = codes.find(*fault);
  if (found == codes.end()) return std::nullopt;
  const auto& listed = found->second;
  const bool is_listed = named && std::find(listed.begin(), listed.end(), *named) != listed.end();
  return is_listed ? *named : listed.front();
}

/// Numbers of a status beside a value of a CAN device.
struct CanStatusCodes {
  std::int64_t good{0};
  FaultCodes codes;
};

}  // namespace thermocomp
