#include "gateway/http/command_desk.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>
#include <sys/random.h>

#include "cli/common/json_fields.hpp"
#include "config/text/outer_json.hpp"
#include "daemon/socket/status_client.hpp"

namespace thermocomp::gateway {
namespace {

using cli::fixed;
using cli::fixed_signed;
using cli::number_of;
using cli::text_of;
using nlohmann::json;

JsonAnswer answer(unsigned status, const json& value) {
  return {status, value.dump(-1, ' ', false, json::error_handler_t::replace)};
}

JsonAnswer error(unsigned status, const std::string& text) {
  return answer(status, {{"error", text}});
}

std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw std::runtime_error("the kernel gives no random numbers");
  std::string text;
  constexpr std::string_view digits = "0123456789abcdef";
  for (const unsigned char byte : bytes) {
    text += digits[byte >> 4U];
    text += digits[byte & 0xFU];
  }
  return text;
}

const json& axis_named(const json& status, const std::string& name) {
  for (const json& axis : cli::list_of(status, "axes"))
    if (text_of(axis, "name") == name) return axis;
  throw std::invalid_argument("there is no axis " + name);
}

/// "z from +1.2 um to -3.4 um, y ..."
std::string moves_to(const json& status, bool to_target) {
  std::string text;
  for (const json& axis : cli::list_of(status, "axes")) {
    std::string unit(" ");
    unit.append(text_of(axis, "unit"));
    text.append(text.empty() ? "" : ", ").append(text_of(axis, "name")).append(" from ");
    text.append(fixed_signed(number_of(axis, "offset"), 1)).append(unit).append(" to ");
    text.append(to_target ? fixed_signed(number_of(axis, "target"), 1) : "0").append(unit);
  }
  return text;
}

}  // namespace

std::string confirmation_text(const std::string& method, const json& asked, const json& status) {
  if (method == "enable")
    return "Switch the compensation on. The axes will move, no faster than their slew rates: " +
           moves_to(status, true) + ", and go on following the model.";
  if (method == "disable")
    return "Switch the compensation off. The axes will move, no faster than their slew rates: " +
           moves_to(status, false) + ".";
  if (method == "reference")
    return "Take the machine as it is now for straight. Displacement is counted from here on; "
           "right "
           "only with the machine cold and even and the offsets at zero.";
  const std::string axis = text_of(asked, "axis");
  const double value_um = number_of(asked, "value_um");
  if (!std::isfinite(value_um)) throw std::invalid_argument("value_um must be a number");
  return "Axis " + axis + " will move by " + fixed_signed(value_um, 1) + " " +
         text_of(axis_named(status, axis), "unit") +
         " and back, to show its sign. Nobody must be in the machine.";
}

CommandDesk::CommandDesk(const GatewaySettings& settings) : settings_(settings) {}

bool CommandDesk::may(const std::string& user, const std::string& method) const {
  const CommandSettings& commands = settings_.commands;
  const auto has = [](const std::vector<std::string>& list, const std::string& word) {
    return std::find(list.begin(), list.end(), word) != list.end();
  };
  return !user.empty() && has(commands.users, user) && has(commands.methods, method);
}

json CommandDesk::offered(const std::string& user) const {
  json methods = json::array();
  for (const std::string& method : settings_.commands.methods)
    if (may(user, method)) methods.push_back(method);
  return {{"user", user}, {"commands", std::move(methods)}};
}

JsonAnswer CommandDesk::take(const std::string& user, const std::string& body,
                             const Snapshot& snapshot) {
  try {
    const json asked = parse_outer_json(body);
    if (!asked.is_object()) return error(400, "the body must be a JSON object");
    if (asked.contains("token")) return carry_out(user, text_of(asked, "token"));
    return confirm(user, asked, snapshot);
  } catch (const JsonError& problem) {
    return error(400, std::string("the body ") + problem.what());
  } catch (const std::invalid_argument& problem) {
    return error(400, problem.what());
  } catch (const std::exception& problem) {
    return error(503, problem.what());
  }
}

JsonAnswer CommandDesk::confirm(const std::string& user, const json& asked,
                                const Snapshot& snapshot) {
  const std::string method = text_of(asked, "method");
  if (!may(user, method)) return error(403, "this command is not for this user");
  if (!snapshot.is_here) return error(503, "the daemon does not answer");
  const std::string text = confirmation_text(method, asked, snapshot.status);
  json params = json::object();
  if (method == "prove")
    params = {{"axis", text_of(asked, "axis")}, {"value_um", number_of(asked, "value_um")}};
  const auto now = std::chrono::steady_clock::now();
  const std::string token = random_token();
  const std::lock_guard lock(mutex_);
  std::erase_if(waiting_, [now](const auto& entry) { return entry.second.until < now; });
  make_room(user);
  waiting_[token] = {user, method, params.dump(), now + confirmation_max};
  return answer(200, {{"token", token}, {"text", text}});
}

/// Only in the places of this user: nobody's unconfirmed commands are in another's way.
void CommandDesk::make_room(const std::string& user) {
  std::size_t count = 0;
  auto oldest = waiting_.end();
  for (auto each = waiting_.begin(); each != waiting_.end(); ++each) {
    if (each->second.user != user) continue;
    ++count;
    if (oldest == waiting_.end() || each->second.until < oldest->second.until) oldest = each;
  }
  if (count >= confirmations_max) waiting_.erase(oldest);
}

JsonAnswer CommandDesk::carry_out(const std::string& user, const std::string& token) {
  Asked asked;
  {
    const std::lock_guard lock(mutex_);
    const auto found = waiting_.find(token);
    if (found == waiting_.end() || found->second.user != user ||
        found->second.until < std::chrono::steady_clock::now())
      return error(410, "not confirmed in time, or done already: ask again");
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
