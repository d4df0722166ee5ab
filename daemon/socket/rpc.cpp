#include "daemon/socket/rpc.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

#include "config/text/outer_json.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

using nlohmann::json;

constexpr std::size_t subscribed_methods_max = 16;

/// NaN becomes null; bytes that are not UTF-8 (a device's answer in an error text) are replaced.
std::string to_line(const json& message) {
  return message.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
}

json error_message(const json& id, int code, const std::string& text) {
  return {{"jsonrpc", "2.0"}, {"id", id}, {"error", {{"code", code}, {"message", text}}}};
}

bool is_allowed(const PeerAccess& access, AccessClass needed) {
  switch (needed) {
    case AccessClass::read:
      return access.read;
    case AccessClass::operate:
      return access.operate;
    case AccessClass::model:
      return access.model;
    case AccessClass::bridge:
      return access.bridge;
  }
  return false;
}

std::string groups_of(const SocketConfig& config, AccessClass needed) {
  switch (needed) {
    case AccessClass::read:
      return config.read_group;
    case AccessClass::operate:
      return config.operator_group;
    case AccessClass::model:
      return config.operator_group + " or " + config.model_group;
    case AccessClass::bridge:
      return config.bridge_group;
  }
  return "";
}

/// A valid request.
struct Request {
  json id;  ///< null if missing
  bool is_notification{false};
  std::string method;
  json params = json::object();
};

void take_id(const json& id, Request& out) {
  const bool is_text = id.is_string();
  if (!is_text && !id.is_number() && !id.is_null()) {
    throw RpcError(rpc::invalid_request, "id must be a string, a number or null");
  }
  // The id is echoed: its length limits the size of answers.
  if (is_text && id.get_ref<const std::string&>().size() > RpcDispatcher::id_bytes_max) {
    throw RpcError(rpc::invalid_request,
                   "id has at most " + std::to_string(RpcDispatcher::id_bytes_max) + " bytes");
  }
  out.id = id;
}

/// @throws RpcError; `out.id` is set as soon as it is parsed
void parse_request(std::string_view line, Request& out) {
  json message;
  try {
    message = parse_outer_json(line);
  } catch (const JsonError& error) {
    throw RpcError(rpc::parse_error, std::string("a line ") + error.what());
  }
  if (message.is_array()) {
    throw RpcError(rpc::invalid_request, "batches are not supported: send one object a line");
  }
  if (!message.is_object()) throw RpcError(rpc::invalid_request, "a request must be an object");
  const auto id = message.find("id");
  if (id != message.end()) take_id(*id, out);
  const auto version = message.find("jsonrpc");
  if (version == message.end() || *version != "2.0") {
    throw RpcError(rpc::invalid_request, "jsonrpc must be \"2.0\"");
  }
  const auto method = message.find("method");
  if (method == message.end() || !method->is_string()) {
    throw RpcError(rpc::invalid_request, "method must be a string");
  }
  out.method = method->get<std::string>();
  // Set last: invalid requests are answered even without an id.
  out.is_notification = id == message.end();
  const auto params = message.find("params");
  if (params == message.end()) return;
  if (!params->is_object()) throw RpcError(rpc::invalid_params, "params must be an object");
  out.params = std::move(*params);
}

/// @param result  called once; none: not complete yet
/// @return true if `answer` now holds the result or the error
bool reply(const Request& request, const RpcPending& result, Answer& answer) {
  json message;
  try {
    std::optional<json> found = result();
    if (!found) return false;
    message = {{"jsonrpc", "2.0"}, {"id", request.id}, {"result", std::move(*found)}};
  } catch (const RpcError& error) {
    message = error_message(request.id, error.code(), error.what());
  } catch (const json::exception& error) {
    message = error_message(request.id, rpc::invalid_params, error.what());
  } catch (const std::exception& error) {
    message = error_message(request.id, rpc::internal_error, error.what());
  }
  answer.is_error = message.contains("error");
  if (!request.is_notification) answer.text = to_line(message);
  return true;
}

}  // namespace

void RpcDispatcher::add_method(const std::string& name, AccessClass access, RpcHandler handler) {
  methods_[name] = {access, std::move(handler), {}};
}

void RpcDispatcher::add_slow_method(const std::string& name, AccessClass access,
                                    RpcSlowHandler handler) {
  methods_[name] = {access, {}, std::move(handler)};
}

Answer RpcDispatcher::answer(const PeerAccess& access, std::string_view line) const {
  Answer answer;
  Request request;
  const auto result = [&]() -> std::optional<json> {
    parse_request(line, request);
    if (request.method == "subscribe") {
      answer.subscription = subscribe(access, request.params);
      return json{{"methods", answer.subscription->methods},
                  {"period_s", std::chrono::duration<double>(answer.subscription->period).count()}};
    }
    const Method& method = find(access, request.method);
    if (!method.slow) return method.handler(request.params);
    answer.later = [pending = method.slow(request.params), request](Answer& out) {
      return reply(request, pending, out);
    };
    return std::nullopt;
  };
  reply(request, result, answer);
  return answer;
}

const RpcDispatcher::Method& RpcDispatcher::find(const PeerAccess& access,
                                                 const std::string& name) const {
  const auto method = methods_.find(name);
  if (method == methods_.end()) {
    // A client without any permission must not learn which methods exist.
    if (!access.any()) throw RpcError(rpc::not_permitted, "not permitted");
    throw RpcError(rpc::method_not_found, "there is no method of this name");
  }
  const AccessClass needed = method->second.access;
  if (!is_allowed(access, needed)) {
    throw RpcError(rpc::not_permitted,
                   name + ": only for root and members of " + groups_of(config_, needed));
  }
  return method->second;
}

Subscription RpcDispatcher::subscribe(const PeerAccess& access, const json& params) const {
  if (!access.read) {
    throw RpcError(rpc::not_permitted,
                   "subscribe: only for root and members of " + config_.read_group);
  }
  for (const auto& [key, value] : params.items()) {
    if (key != "methods" && key != "period_s") {
      throw RpcError(rpc::invalid_params, "subscribe takes methods and period_s");
    }
  }
  const json period = params.value("period_s", json(1.0));
  const double period_s = period.is_number() ? period.get<double>() : not_a_number;
  if (!(period_s >= period_s_min && period_s <= period_s_max)) {
    throw RpcError(rpc::invalid_params, "period_s must be a number in [0.1, 60]");
  }
  const json names = params.value("methods", json::array({"status"}));
  if (!names.is_array() || names.empty() || names.size() > subscribed_methods_max) {
    throw RpcError(rpc::invalid_params, "methods must be a list of 1 to 16 names");
  }
  Subscription wanted;
  for (const json& name : names) {
    const auto method = name.is_string() ? methods_.find(name.get<std::string>()) : methods_.end();
    if (method == methods_.end() || method->second.access != AccessClass::read) {
      throw RpcError(rpc::invalid_params, "methods may name reading methods only");
    }
    if (std::find(wanted.methods.begin(), wanted.methods.end(), method->first) !=
        wanted.methods.end()) {
      throw RpcError(rpc::invalid_params, "methods names " + method->first + " twice");
    }
    wanted.methods.push_back(method->first);
  }
  wanted.period = std::chrono::nanoseconds(std::llround(1e9 * period_s));
  return wanted;
}

std::string RpcDispatcher::notification(const std::string& method) const {
  json message = {{"jsonrpc", "2.0"}, {"method", method}};
  try {
    message["params"] = methods_.at(method).handler(json::object());
  } catch (const std::exception& error) {
    message["params"] = {{"error", error.what()}};
  }
  return to_line(message);
}

std::string error_line(int code, const std::string& message) {
  return to_line(error_message(nullptr, code, message));
}

std::string missed_line(std::uint64_t count) {
  return to_line(
      {{"jsonrpc", "2.0"}, {"method", "missed"}, {"params", {{"notifications", count}}}});
}

}  // namespace thermocomp
