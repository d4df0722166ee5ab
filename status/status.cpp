#include "status/status.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>
#include <type_traits>

#include <nlohmann/json.hpp>

#include "status/codes.hpp"

namespace thermocomp {

namespace {

using nlohmann::json;

json value_of(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}
template <class T>
requires std::integral<T> json value_of(const T& value) {
  return value;
}
json value_of(const std::string& value) {
  return value;
}
json value_of(Fault fault) {
  return to_string(fault);
}
json value_of(const Event& event);
json value_of(const RecordedEvent& event);
template <class T>
json value_of(const std::vector<T>& values);
template <class T>
json value_of(const std::map<std::string, T>& values);
template <class T>
json value_of(const std::optional<T>& value);
template <class T>
json value_of(const T& part);

/// Writes each field into an object.
struct Writer {
  json& object;

  template <class T>
  void operator()(const char* key, const T& value) {
    object[key] = value_of(value);
  }
  /// Omitted if nullopt.
  template <class T>
  void if_any(const char* key, const std::optional<T>& value) {
    if (value) object[key] = value_of(*value);
  }
  /// Writes axis names as keys of the object itself.
  void members(const char* /*but*/, const std::map<std::string, bool>& values) {
    for (const auto& [name, value] : values) object[name] = value;
  }
  void mode(const char* key, Mode value, bool dry_run) {
    object[key] = code_text(value, dry_run).name;
  }
  void reasons(const char* key, std::uint32_t set, const std::vector<std::string>& /*warnings*/) {
    json& names = object[key] = json::array();
    for (const Reason reason : members_of(set)) names.push_back(to_string(reason));
  }
};

template <class T>
json value_of(const std::vector<T>& values) {
  json list = json::array();
  for (const T& value : values) list.push_back(value_of(value));
  return list;
}
template <class T>
json value_of(const std::map<std::string, T>& values) {
  json object = json::object();
  for (const auto& [name, value] : values) object[name] = value_of(value);
  return object;
}
template <class T>
json value_of(const std::optional<T>& value) {
  return value ? value_of(*value) : json(nullptr);
}
template <class T>
json value_of(const T& part) {
  json object = json::object();
  Writer writer{object};
  T::fields(part, writer);
  return object;
}

json value_of(const Event& event) {
  json value = {{"number", event.number},
                {"wall_s", value_of(event.wall_s)},
                {"kind", to_string(event.kind)},
                {"about", to_string(event.subject.kind)},
                {"name", event.subject.name},
                {"code", event.code},
                {"detail", event.detail},
                {"value", value_of(event.value)},
                {"comes_and_goes", event.comes_and_goes},
                {"duration_s", value_of(event.duration_s)},
                {"user", event.user < 0 ? json(nullptr) : json(event.user)},
                // Text:
                {"subject", subject_text(event.subject)},
                {"what", what_text(event)}};
  if (!event.asked_for.empty()) value["for"] = event.asked_for;
  if (event.candidate) value["candidate"] = value_of(*event.candidate);
  return value;
}
json value_of(const RecordedEvent& event) {
  json value = value_of(static_cast<const Event&>(event));
  value["run"] = event.run;
  return value;
}

void take(const json& value, double& out) {
  out = value.is_number() ? value.get<double>() : not_a_number;
}
void take(const json& value, bool& out) {
  if (value.is_boolean()) out = value.get<bool>();
}
template <class T>
requires std::integral<T>
void take(const json& value, T& out) {
  const double number = value.is_number() ? value.get<double>() : -1.0;
  // Below the largest value, which rounds up as a double.
  if (!(number >= 0.0 && number < 9.2e18)) return;
  out = value.is_number_float() ? static_cast<T>(number) : value.get<T>();
}
void take(const json& value, std::string& out) {
  if (!value.is_string()) return;
  out = value.get<std::string>();
  std::replace_if(
      out.begin(), out.end(), [](unsigned char c) { return c < ' '; }, ' ');
}
void take(const json& value, Fault& out) {
  if (value.is_string())
    out = fault_named(value.get_ref<const std::string&>()).value_or(Fault::never_read);
}
template <class T>
void take(const json& value, std::vector<T>& out);
template <class T>
void take(const json& value, std::map<std::string, T>& out);
template <class T>
void take(const json& value, std::optional<T>& out);
void take(const json& value, Event& event);
template <class T>
void take(const json& value, T& part);

/// Reads each field of an object.
struct Reader {
  const json& object;

  [[nodiscard]] const json& at(const char* key) const {
    static const json nothing;
    if (!object.is_object()) return nothing;
    const auto found = object.find(key);
    return found == object.end() ? nothing : *found;
  }
  template <class T>
  void operator()(const char* key, T& value) {
    take(at(key), value);
  }
  template <class T>
  void if_any(const char* key, std::optional<T>& value) {
    take(at(key), value);
  }
  void members(const char* but, std::map<std::string, bool>& values) {
    if (!object.is_object()) return;
    for (const auto& [name, value] : object.items())
      if (name != but) take(value, values[name]);
  }
  void mode(const char* key, Mode& value, bool /*dry_run*/) {
    std::string name;
    take(at(key), name);
    value = mode_named(name).value_or(Mode::starting);
  }
  void reasons(const char* key, std::uint32_t& set, std::vector<std::string>& warnings) {
    std::vector<std::string> names;
    take(at(key), names);
    for (const std::string& name : names) {
      if (const auto reason = reason_named(name))
        set |= static_cast<std::uint32_t>(*reason);
      else
        warnings.push_back(name + ": a reason that this program does not know");
    }
  }
};

void take(const json& value, Event& event) {
  Reader read{value};
  read("number", event.number);
  read("wall_s", event.wall_s);
  std::string name;
  read("kind", name);
  event.kind = event_kind_named(name);
  name.clear();
  read("about", name);
  event.subject.kind = subject_kind_named(name);
  read("name", event.subject.name);
  read("code", event.code);
  read("detail", event.detail);
  read("value", event.value);
  read("comes_and_goes", event.comes_and_goes);
  read("duration_s", event.duration_s);
  read("user", event.user);
  read("for", event.asked_for);
  read("candidate", event.candidate);
}
template <class T>
void take(const json& value, std::vector<T>& out) {
  if (!value.is_array()) return;
  out.clear();
  for (const json& element : value) take(element, out.emplace_back());
}
template <class T>
void take(const json& value, std::map<std::string, T>& out) {
  if (!value.is_object()) return;
  out.clear();
  for (const auto& [name, element] : value.items()) take(element, out[name]);
}
template <class T>
void take(const json& value, std::optional<T>& out) {
  out.reset();
  if (!value.is_null()) take(value, out.emplace());
}
template <class T>
void take(const json& value, T& part) {
  Reader reader{value};
  T::fields(part, reader);
}

}  // namespace

template <class Part>
json json_of(const Part& part) {
  return value_of(part);
}

template <class Part>
Part part_from(const json& value) {
  Part part;
  take(value, part);
  return part;
}

template json json_of(const Status&);
template json json_of(const SensorsAnswer&);
template json json_of(const OffsetsAnswer&);
template json json_of(const EventsAnswer&);
template json json_of(const CycleStatus&);
// Parts shown by the gateway's page:
template json json_of(const std::vector<AxisStatus>&);
template json json_of(const std::vector<InputStatus>&);
template json json_of(const std::vector<BusStatus>&);
template json json_of(const SensorStatus&);
template json json_of(const ControllerStatus&);
template json json_of(const HistoryStatus&);
template json json_of(const ModelStatus&);
template json json_of(const ReferenceStatus&);
// For a history:
template json json_of(const Event&);
template json json_of(const std::vector<RecordedEvent>&);

template Status part_from(const json&);
template SensorsAnswer part_from(const json&);
template EventsAnswer part_from(const json&);
template Event part_from(const json&);

}  // namespace thermocomp
