// SPDX-License-Identifier: GPL-2.0-or-later
#include "linuxcnc/messages.hpp"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

namespace thermocomp_linuxcnc {
namespace {

using nlohmann::json;

constexpr double um_per_mm = 1000.0;

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

/// Refuses deep nesting, since JSON is destroyed recursively; ignores brackets in strings.
bool is_flat(std::string_view line) {
  constexpr int depth_max = 16;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '"') in_string = !in_string;
    if (in_string && c == '\\') ++i;
    if (in_string) continue;
    if (c == '{' || c == '[') ++depth;
    if (c == '}' || c == ']') --depth;
    if (depth > depth_max) return false;
  }
  return true;
}

/// Replaces control characters by blanks, since the daemon's text is shown on a terminal.
std::string plain(std::string text) {
  for (char& c : text)
    if (c < ' ' || c > '~') c = ' ';
  return text;
}

const json& member(const json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) throw BadAnswer(std::string("the answer has no ").append(key));
  return *found;
}

std::optional<double> read_offset(const json& offsets, const std::string& axis,
                                  double offset_mm_max) {
  const auto found = offsets.find(axis);
  // The axis is not in the daemon's configuration.
  if (found == offsets.end() || found->is_null()) return std::nullopt;
  const double offset_mm = found->is_number() ? found->get<double>() / um_per_mm : NAN;
  // Negated, so that NaN is refused too.
  if (!(std::abs(offset_mm) <= offset_mm_max))
    throw BadAnswer("the offset of axis " + axis + " is no number within the bound");
  return offset_mm;
}

}  // namespace

std::string request_line(std::uint64_t session, std::uint64_t id, std::string_view axes,
                         const MachineView& view) {
  json applied = json::object();
  json signals = {{"spindle_rpm", number(view.spindle_rpm)},
                  {"coolant_on", view.flood || view.mist ? 1 : 0},
                  {"cutting_on", in_cut(view) ? 1 : 0},
                  {"enabled_on", view.enabled ? 1 : 0},
                  {"homed_on", view.homed ? 1 : 0}};
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const std::string name(1, axes[i]);
    applied[name] = number(um_per_mm * view.axes[i].applied_mm);
    signals[name + "_mm"] = number(view.axes[i].position_mm);
  }
  const json request = {{"jsonrpc", "2.0"},
                        {"id", id},
                        {"method", "controller_state"},
                        {"params",
                         {{"session", session},
                          {"taking", view.taking},
                          {"applied_um", applied},
                          {"signals", signals}}}};
  return request.dump() + "\n";
}

Answer read_answer(std::string_view line, std::uint64_t id, std::string_view axes,
                   double offset_mm_max) {
  const json message = is_flat(line) ? json::parse(line, nullptr, false) : json();
  if (!message.is_object()) throw BadAnswer("the daemon's answer is no JSON object");
  if (const auto error = message.find("error"); error != message.end() && error->is_object()) {
    const auto text = error->find("message");
    throw BadAnswer("the daemon refuses: " + (text != error->end() && text->is_string()
                                                  ? plain(text->get<std::string>())
                                                  : std::string("no reason given")));
  }
  if (member(message, "id") != id) throw BadAnswer("the answer is of another request");
  const json& result = member(message, "result");
  if (!result.is_object()) throw BadAnswer("the result is no object");
  const json& anew = member(result, "anew");
  const json& mode = member(result, "mode");
  const json& offsets = member(result, "offsets_um");
  if (!anew.is_boolean() || !mode.is_string() || !offsets.is_object())
    throw BadAnswer("the result has values of the wrong kind");
  Answer answer{anew.get<bool>(), mode.get<std::string>(), {}};
  answer.all_driven = std::none_of(offsets.begin(), offsets.end(),
                                   [](const json& offset) { return offset.is_null(); });
  for (const char axis : axes)
    answer.offset_mm.push_back(read_offset(offsets, std::string(1, axis), offset_mm_max));
  return answer;
}

}  // namespace thermocomp_linuxcnc
