#include "drivers/sensors/modbus_plan.hpp"

#include <algorithm>
#include <tuple>

#include "drivers/modbus/register_codec.hpp"

namespace thermocomp {
namespace {

/// A value to read, and the destination of its place.
struct Item {
  ModbusTable table;
  std::size_t address;
  std::size_t count;  ///< registers or bits
  WordPlace* place;
  bool is_low_word{false};  ///< in its register

  [[nodiscard]] std::size_t end() const noexcept { return address + count; }
};

/// A plan with all its places, so that items can point to them.
ModbusPlan empty_plan(const ModbusDeviceConfig& device) {
  ModbusPlan plan;
  if (device.wide_registers) plan.words_a_register = 2;
  plan.channels.resize(device.channels.size());
  for (std::size_t i = 0; i < device.channels.size(); ++i) {
    if (device.channels[i].status) plan.channels[i].status.emplace();
  }
  if (device.renewal) plan.renewal.emplace();
  return plan;
}

std::vector<Item> items_of(const ModbusDeviceConfig& device, ModbusPlan& plan) {
  constexpr std::size_t one = 1;
  std::vector<Item> items;
  for (std::size_t i = 0; i < device.channels.size(); ++i) {
    const ModbusChannel& channel = device.channels[i];
    ChannelPlace& place = plan.channels[i];
    const std::size_t words = words_of(channel.table, channel.encoding);
    items.push_back({channel.table, channel.address, std::max(words / plan.words_a_register, one),
                     &place.value});
    if (channel.status) {
      items.push_back({channel.status->table, channel.status->address, one, &*place.status, true});
    }
  }
  if (device.renewal) {
    items.push_back({device.renewal->table, device.renewal->address, one, &*plan.renewal, true});
  }
  std::stable_sort(items.begin(), items.end(), [](const Item& a, const Item& b) {
    return std::tuple(a.table, a.address, a.count) < std::tuple(b.table, b.address, b.count);
  });
  return items;
}

struct Limits {
  std::size_t length;
  std::size_t gap;
};

Limits limits_of(const ModbusDeviceConfig& device, ModbusTable table, int line_registers_max) {
  const auto gap = static_cast<std::size_t>(std::max(device.gap_registers_max, 0));
  if (is_bit_table(table)) return {bits_per_request_limit, 16 * gap};
  const int length =
      std::min({device.registers_per_request_max, line_registers_max, registers_per_request_limit});
  const int registers = device.wide_registers ? length / 2 : length;
  return {static_cast<std::size_t>(std::max(registers, 1)), gap};
}

bool joins(const PlannedRequest& request, const Item& item, const Limits& limits,
           bool one_register_a_request) {
  if (request.table != item.table) return false;
  const std::size_t end = std::size_t{request.address} + request.count;
  if (item.end() <= end && item.address == request.address && item.count == request.count) {
    return true;  // same words
  }
  if (one_register_a_request) return false;
  return item.end() - request.address <= limits.length && item.address <= end + limits.gap;
}

/// Moves the request with the renewal counter to the front.
void counter_first(ModbusPlan& plan) {
  const std::size_t chosen = plan.renewal->request;
  std::swap(plan.requests[0], plan.requests[chosen]);
  const auto exchange = [chosen](WordPlace& place) {
    if (place.request == chosen) {
      place.request = 0;
    } else if (place.request == 0) {
      place.request = chosen;
    }
  };
  for (ChannelPlace& channel : plan.channels) {
    exchange(channel.value);
    if (channel.status) exchange(*channel.status);
  }
  exchange(*plan.renewal);
}

}  // namespace

ModbusPlan plan_requests(const ModbusDeviceConfig& device, int line_registers_max) {
  ModbusPlan plan = empty_plan(device);
  for (const Item& item : items_of(device, plan)) {
    const Limits limits = limits_of(device, item.table, line_registers_max);
    const bool joined = !plan.requests.empty() &&
                        joins(plan.requests.back(), item, limits, device.one_register_a_request);
    if (!joined) {
      plan.requests.push_back({item.table, static_cast<std::uint16_t>(item.address), 0});
    }
    PlannedRequest& request = plan.requests.back();
    const std::size_t count = std::max<std::size_t>(request.count, item.end() - request.address);
    request.count = static_cast<std::uint16_t>(count);
    const std::size_t each = is_bit_table(item.table) ? 1 : plan.words_a_register;
    *item.place = {plan.requests.size() - 1,
                   (item.address - request.address) * each + (item.is_low_word ? each - 1 : 0)};
  }
  if (plan.renewal) counter_first(plan);
  return plan;
}

}  // namespace thermocomp
