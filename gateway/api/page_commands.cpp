#include "gateway/api/page_commands.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>
#include <sys/random.h>

#include "config/text/outer_json.hpp"
#include "daemon/socket/status_client.hpp"
#include "gateway/feed/page_state.hpp"
#include "status/figures.hpp"

namespace thermocomp::gateway {
namespace {

using nlohmann::json;

JsonAnswer answer(unsigned status, const json& value) {
  return {status, dumped(value)};
}

JsonAnswer error(unsigned status, const std::string& text) {
  return answer(status, {{"error", text}});
}

std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw std::runtime_error("the kernel provides no random numbers");
  std::string text;
  constexpr std::string_view digits = "0123456789abcdef";
  for (const unsigned char byte : bytes) {
    text += digits[byte >> 4U];
    text += digits[byte & 0xFU];
  }
  return text;
}

std::string word(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

CommandRequest request_from(const json& object) {
  const json value = object.value("value_um", json(nullptr));
  return {word(object, "method"), word(object, "axis"), word(object, "sensor"),
          value.is_number() ? value.get<double>() : not_a_number};
}

const AxisStatus& axis_named(const Status& status, const std::string& name) {
  for (const AxisStatus& axis : status.axes)
    if (axis.name == name) return axis;
  throw std::invalid_argument("unknown axis " + name);
}

void require_waiting(const SensorsAnswer& sensors, const std::string& name) {
  for (const SensorStatus& sensor : sensors.sensors)
    if (sensor.name == name && sensor.fault == Fault::unconfirmed) return;
  throw std::invalid_argument("there is no sensor " + name + " with an unconfirmed reading");
}

/// "z from +1.2 um to 0 um, y ..."
std::string moves_text(const Status& status, const std::string& to) {
  std::string text;
  for (const AxisStatus& axis : status.axes) {
    const std::string unit = " " + axis.unit;
    text.append(text.empty() ? "" : ", ").append(axis.name).append(" from ");
    text.append(fixed_signed(axis.offset, 1)).append(unit);
    text.append(axis.driven ? " to " + to + (to == "0" ? unit : "")
                            : " (not driven: nothing is sent)");
  }
  return text;
}

}  // namespace

std::string confirmation_text(const CommandRequest& asked, const Status& status) {
  const std::string& method = asked.method;
  if (method == "enable")
    return "Switch the compensation on. The axes will move, no faster than their slew rates: " +
           moves_text(status, "the model's offset") + ", and then follow it.";
  if (method == "disable")
    return "Switch the compensation off. The axes will move, no faster than their slew rates: " +
           moves_text(status, "0") + ".";
  if (method == "reference")
    return "Take the present state of the machine as the reference: displacement counts from here "
           "on. Only with the machine cold and even and the offsets at zero.";
  if (method == "accept")
    return "Take the reading of sensor " + asked.sensor +
           " as correct in spite of its jump. The axes will follow it, no faster than their slew "
           "rates. Compare it with a hand-held thermometer first.";
  if (!std::isfinite(asked.value_um)) throw std::invalid_argument("value_um must be a number");
  return "Axis " + asked.axis + " will move by " + fixed_signed(asked.value_um, 1) + " " +
         axis_named(status, asked.axis).unit +
         " and back, to show its sign. Make sure that nobody is in the machine.";
}

PageCommands::PageCommands(const GatewaySettings& settings) : settings_(settings) {}

bool PageCommands::may(const std::string& user, const std::string& method) const {
  const CommandSettings& commands = settings_.commands;
  const auto has = [](const std::vector<std::string>& list, const std::string& word) {
    return std::find(list.begin(), list.end(), word) != list.end();
  };
  return !user.empty() && has(commands.users, user) && has(commands.methods, method);
}

json PageCommands::offered(const std::string& user) const {
  json methods = json::array();
  for (const std::string& method : settings_.commands.methods)
    if (may(user, method)) methods.push_back(method);
  json names = json::object();
  for (const std::string method : methods) names[method] = command_name(method);
  return {{"user", user}, {"commands", std::move(methods)}, {"names", std::move(names)}};
}

JsonAnswer PageCommands::take(const std::string& user, const std::string& body,
                              const Snapshot& snapshot) {
  try {
    const json asked = parse_outer_json(body);
    if (!asked.is_object()) return error(400, "the body must be a JSON object");
    if (asked.contains("token")) return carry_out(user, word(asked, "token"));
    return confirm(user, request_from(asked), snapshot);
  } catch (const JsonError& problem) {
    return error(400, std::string("the body ") + problem.what());
  } catch (const std::invalid_argument& problem) {
    return error(400, problem.what());
  } catch (const std::exception& problem) {
    return error(503, problem.what());
  }
}

JsonAnswer PageCommands::confirm(const std::string& user, const CommandRequest& asked,
                                 const Snapshot& snapshot) {
  const std::string& method = asked.method;
  if (!may(user, method)) return error(403, "this user may not give this command");
  if (!snapshot.is_here) return error(503, "the daemon does not answer");
  if (method == "accept") require_waiting(snapshot.sensors, asked.sensor);
  const std::string text = confirmation_text(asked, snapshot.status);
  json params = {{"for", user}};
  if (method == "accept") params["sensor"] = asked.sensor;
  if (method == "prove") params.update({{"axis", asked.axis}, {"value_um", asked.value_um}});
  const auto now = std::chrono::steady_clock::now();
  const std::string token = random_token();
  const std::lock_guard lock(mutex_);
  std::erase_if(waiting_, [now](const auto& entry) { return entry.second.until < now; });
  make_room(user);
  waiting_[token] = {user, method, params.dump(), now + confirmation_max};
  return answer(200, {{"token", token}, {"text", text}});
}

/// Drops the oldest unconfirmed command of this user, so that users do not displace each other.
void PageCommands::make_room(const std::string& user) {
  std::size_t count = 0;
  auto oldest = waiting_.end();
  for (auto each = waiting_.begin(); each != waiting_.end(); ++each) {
    if (each->second.user != user) continue;
    ++count;
    if (oldest == waiting_.end() || each->second.until < oldest->second.until) oldest = each;
  }
  if (count >= confirmations_max) waiting_.erase(oldest);
}

JsonAnswer PageCommands::carry_out(const std::string& user, const std::string& token) {
  Asked asked;
  {
    const std::lock_guard lock(mutex_);
    const auto found = waiting_.find(token);
    if (found == waiting_.end() || found->second.user != user ||
        found->second.until < std::chrono::steady_clock::now())
      return error(410, "not confirmed in time, or already executed: request it again");
    asked = found->second;
    waiting_.erase(found);
  }
  spdlog::info("command {} {} by {}", asked.method, asked.params, asked.user);
  try {
    StatusClient client(settings_.socket);
    return answer(200, client.call(asked.method, json::parse(asked.params)));
  } catch (const RemoteError& refused) {
    spdlog::warn("command {}: {}", asked.method, refused.what());
    return error(409, refused.what());
  }
}

}  // namespace thermocomp::gateway
