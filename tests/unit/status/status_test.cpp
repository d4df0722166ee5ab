// The status to JSON and back: random values and invalid JSON.
#include "status/status.hpp"

#include <random>
#include <set>
#include <type_traits>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "status/codes.hpp"

using namespace thermocomp;
using nlohmann::json;

namespace {

/// Gives every field of a structure a random value.
class Filler {
 public:
  explicit Filler(std::uint32_t seed) : random_(seed) {}

  template <class T>
  void operator()(const char* /*key*/, T& value) {
    fill(value);
  }
  template <class T>
  void if_any(const char* /*key*/, std::optional<T>& value) {
    fill(value);
  }
  void members(const char* /*but*/, std::map<std::string, bool>& values) { fill(values); }
  void mode(const char* /*key*/, Mode& value, bool /*dry_run*/) {
    value = static_cast<Mode>(below(5));
  }
  void reasons(const char* /*key*/, std::uint32_t& set, std::vector<std::string>& /*warnings*/) {
    set = below(1u << reasons_count);
  }

 private:
  std::uint32_t below(std::uint32_t end) { return static_cast<std::uint32_t>(random_() % end); }
  void fill(double& value) {
    value = below(5) == 0 ? not_a_number : std::ldexp(static_cast<double>(below(1000000)), -7);
  }
  void fill(bool& value) { value = below(2) == 0; }
  void fill(std::uint64_t& value) { value = below(1000000); }
  void fill(std::string& value) {
    value = std::string("t\"\u00e4\\").append(std::to_string(below(1000)));
  }
  void fill(Fault& value) { value = static_cast<Fault>(below(faults_count)); }
  void fill(Event& event) {
    fill(event.number);
    fill(event.wall_s);
    event.kind = static_cast<EventKind>(below(5));
    event.subject.kind = static_cast<SubjectKind>(below(14));
    for (std::string* text : {&event.subject.name, &event.code, &event.detail}) fill(*text);
    fill(event.value);
    fill(event.duration_s);
    fill(event.comes_and_goes);
    event.user = static_cast<std::int64_t>(below(3)) - 1;
    fill(event.candidate);
  }
  template <class T>
  void fill(std::vector<T>& values) {
    values.resize(below(4));
    for (T& value : values) fill(value);
  }
  template <class T>
  void fill(std::map<std::string, T>& values) {
    for (std::uint32_t i = below(4); i > 0; --i)
      fill(values[std::string("n").append(std::to_string(i))]);
  }
  template <class T>
  void fill(std::optional<T>& value) {
    if (below(3) == 0) return;
    fill(value.emplace());
    // NaN becomes null, and null is read as missing.
    if constexpr (std::is_same_v<T, double>)
      if (std::isnan(*value)) value = 1.0;
  }
  template <class T>
  void fill(T& part) {
    T::fields(part, *this);
  }

  std::mt19937 random_;
};

template <class Part>
Part filled(std::uint32_t seed) {
  Part part;
  Filler filler(seed);
  Part::fields(part, filler);
  return part;
}

template <class Part>
void check_round_trip() {
  for (std::uint32_t seed = 0; seed < 300; ++seed) {
    INFO(seed);
    const json first = json_of(filled<Part>(seed));
    const json second = json_of(part_from<Part>(json::parse(first.dump())));
    REQUIRE(first == second);
  }
}

/// Converts to any type.
struct Anything {
  template <class T>
  operator T() const;  // NOLINT: only named, never called
};
template <class T, std::size_t... I>
constexpr bool takes(std::index_sequence<I...> /*count*/) {
  return requires {
    T{(static_cast<void>(I), Anything{})...};
  };
}
/// Number of members of an aggregate.
template <class T, std::size_t count = 0>
constexpr std::size_t members() {
  if constexpr (takes<T>(std::make_index_sequence<count + 1>()))
    return members<T, count + 1>();
  else
    return count;
}

struct Counter {
  std::set<std::string> keys;
  template <class T>
  void operator()(const char* key, T& /*value*/) {
    keys.insert(key);
  }
  template <class T>
  void if_any(const char* key, T& /*value*/) {
    keys.insert(key);
  }
  template <class T>
  void members(const char* /*but*/, T& /*values*/) {
    keys.insert("names");
  }
  template <class... Rest>
  void mode(const char* key, Rest&... /*rest*/) {
    keys.insert(key);
  }
  template <class... Rest>
  void reasons(const char* key, Rest&... /*rest*/) {
    keys.insert(key);
  }
};

template <class Part>
std::size_t keys_of() {
  Part part;
  Counter counter;
  Part::fields(part, counter);
  return counter.keys.size();
}

}  // namespace

TEST_CASE("every answer survives the conversion to JSON and back", "[status][json]") {
  check_round_trip<Status>();
  check_round_trip<SensorsAnswer>();
  check_round_trip<EventsAnswer>();
}

TEST_CASE("every member of a structure has a unique key", "[status][json]") {
  CHECK(members<LatchedMismatch>() == keys_of<LatchedMismatch>());
  CHECK(members<GainStatus>() == keys_of<GainStatus>());
  CHECK(members<CorrectionStatus>() == keys_of<CorrectionStatus>());
  CHECK(members<AxisStatus>() == keys_of<AxisStatus>());
  CHECK(members<InputStatus>() == keys_of<InputStatus>());
  CHECK(members<SensorError>() == keys_of<SensorError>());
  CHECK(members<Jump>() == keys_of<Jump>());
  CHECK(members<SensorStatus>() == keys_of<SensorStatus>());
  CHECK(members<UnitStatus>() == keys_of<UnitStatus>());
  CHECK(members<BusStatus>() == keys_of<BusStatus>());
  CHECK(members<WriteStatus>() == keys_of<WriteStatus>());
  CHECK(members<ControllerStatus>() == keys_of<ControllerStatus>());
  CHECK(members<HistoryStatus>() == keys_of<HistoryStatus>());
  CHECK(members<SocketStatus>() == keys_of<SocketStatus>());
  CHECK(members<CycleStatus>() == keys_of<CycleStatus>());
  CHECK(members<ModelStatus>() == keys_of<ModelStatus>());
  CHECK(members<ReferenceStatus>() == keys_of<ReferenceStatus>());
  CHECK(members<Status>() == keys_of<Status>());
  CHECK(members<SensorsAnswer>() == keys_of<SensorsAnswer>());
  CHECK(members<OffsetsAnswer>() == keys_of<OffsetsAnswer>());
}

TEST_CASE("unknown values are null, inapplicable ones are omitted", "[status][json]") {
  const json axis = json_of(std::vector<AxisStatus>{AxisStatus{}})[0];
  CHECK(axis["offset"].is_null());
  CHECK(axis["mismatch"].is_null());
  CHECK_FALSE(axis.contains("at_mm"));
  CHECK_FALSE(axis.contains("correction"));
  CHECK(json_of(Status{})["model"]["outside"].is_null());
}

TEST_CASE("an answer of unexpected shape is read as far as possible", "[status][json]") {
  for (const char* text :
       {"{}", "[]", "null", "7", R"({"axes": 5, "cycle": [], "mode": 3, "reasons": [1, null]})",
        R"({"axes": [1, null, {"name": 5, "mismatch": 7}], "buses": "none", "uptime_s": "x"})"}) {
    INFO(text);
    const auto status = part_from<Status>(json::parse(text));
    CHECK(status.mode == Mode::starting);
    CHECK(status.buses.empty());
    CHECK_NOTHROW(part_from<SensorsAnswer>(json::parse(text)));
    CHECK_NOTHROW(part_from<EventsAnswer>(json::parse(text)));
  }
  const auto numbers = part_from<Status>(
      json::parse(R"({"cycle_ends": -5, "socket": {"requests": 1e300, "clients": 1.5}})"));
  CHECK(numbers.cycle_ends == 0);
  CHECK(numbers.socket.requests == 0);
  CHECK(numbers.socket.clients == 1);
}

TEST_CASE("a text is reduced to one line", "[status][json]") {
  const auto status = part_from<Status>(json{{"warnings", {"a\n\x1b[31mb"}}});
  CHECK(status.warnings == std::vector<std::string>{"a  [31mb"});
}

TEST_CASE("an unknown reason is shown as a warning", "[status][json]") {
  const auto status =
      part_from<Status>(json::parse(R"({"reasons": ["at_bound", "too_loud"], "warnings": ["w"]})"));
  CHECK(status.reasons == static_cast<std::uint32_t>(Reason::at_bound));
  REQUIRE(status.warnings.size() == 2);
  CHECK_THAT(status.warnings[1], Catch::StartsWith("too_loud: "));
}
