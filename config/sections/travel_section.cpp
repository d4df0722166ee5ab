#include "config/sections/travel_section.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "config/sections/common.hpp"
#include "config/sections/modbus_values.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp::sections {
namespace {

constexpr double mm_per_m = 1000.0;
/// Largest rounding difference between sent offset and read-back [um].
constexpr double rounding_um_max = 0.1;

/// Largest count of an offset [um]: 1 um, the coarsest usual one, or the slew per second if that is
/// more, but at most a quarter of the bound.
double count_um_max(const LimiterConfig& limiter) {
  constexpr double coarsest_um = 1.0;
  constexpr double share_of_bound = 0.25;
  return std::min(std::max(coarsest_um, limiter.rate_um_per_s_max),
                  share_of_bound * limiter.offset_um_max);
}

}  // namespace

void check_offset_place(const TomlTable& table, std::string_view key, const Carried& place,
                        const LimiterConfig& limiter) {
  const Range& reach = place.reach;
  if (!reach.contains(limiter.offset_um_max) || !reach.contains(-limiter.offset_um_max))
    table.problem(key, "must be able to hold -offset_um_max ... offset_um_max, but reaches from " +
                           number_text(reach.min) + " to " + number_text(reach.max));
  if (place.count <= count_um_max(limiter)) return;
  table.problem(key, "one count of " + number_text(place.count) + " um",
                "must be at most " + number_text(count_um_max(limiter)) +
                    " um with offset_um_max = " + number_text(limiter.offset_um_max) +
                    " and rate_um_per_s_max = " + number_text(limiter.rate_um_per_s_max) +
                    ": check `scale`");
}

TomlTable travel_table(const TomlTable& axis) {
  return axis.has("line") ? axis.table("line") : axis.table_or_empty("table");
}

TravelSection::TravelSection(const TomlTable& axis, const LimiterConfig& limiter)
    : table_(travel_table(axis)), limiter_(limiter) {
  axis.has("line") ? read_line() : read_table();
}

void TravelSection::read_line() {
  std::vector<double>& nodes_mm = shape_.nodes_mm;
  nodes_mm = table_.numbers("travel_mm");
  shape_.p0_mm = table_.number("p0_mm", Range::any());
  is_travel_ = nodes_mm.size() == 2 && nodes_mm[1] > nodes_mm[0];
  // Reported by read_axes() already.
  if (!is_travel_) nodes_mm = {0.0, 1.0};
  if (is_travel_ && table_.has("p0_mm") &&
      !(*shape_.p0_mm >= nodes_mm[0] && *shape_.p0_mm <= nodes_mm[1]))
    table_.problem("p0_mm", "must be within travel_mm");
}

void TravelSection::read_table() {
  shape_.nodes_mm = table_.numbers("nodes_mm");
  shape_.nodes_mm.resize(std::clamp<std::size_t>(shape_.nodes_mm.size(), 2, TravelShape::nodes_max),
                         0.0);
}

void TravelSection::check_offset(const TomlTable& own, std::string_view key,
                                 const Carried& place) const {
  check_offset_place(own, key, place, limiter_);
}

void TravelSection::check_slope(const TomlTable& own, std::string_view key,
                                const Carried& place) const {
  if (!is_travel_) return;
  const double length_m = (shape_.nodes_mm.back() - shape_.nodes_mm.front()) / mm_per_m;
  const double steepest = 2.0 * limiter_.offset_um_max / length_m;
  const Range& can = place.reach;
  if (!can.contains(steepest) || !can.contains(-steepest))
    own.problem(key, "must be able to hold +-" + number_text(steepest) +
                         " um/m, from -offset_um_max to offset_um_max over the travel, but "
                         "reaches from " +
                         number_text(can.min) + " to " + number_text(can.max));
  if (place.count * length_m > rounding_um_max)
    own.problem(key, "one count moves the end of the travel by " +
                         number_text(std::round(1e6 * place.count * length_m) / 1e6) +
                         " um: must be at most " + number_text(rounding_um_max) + " um");
}

void TravelSection::check_p0(const TomlTable& own, std::string_view key,
                             const Carried& place) const {
  const double p0_mm = *shape_.p0_mm;
  const double counts = place.count > 0.0 ? p0_mm / place.count : 0.0;
  if (!place.reach.contains(p0_mm) || std::abs(counts - std::round(counts)) > 1e-6)
    own.problem(key, "must be able to hold p0_mm = " + number_text(p0_mm));
}

namespace {

using FrameId = std::pair<std::uint32_t, bool>;

FrameId id_of(const CanSignal& signal) {
  return {signal.id, signal.extended_id};
}

Carried carried(const CanSignal& signal) {
  return {reach(signal), count_of(signal)};
}

/// Whether set numbers of this length are supported.
bool can_count(int bits) {
  return bits >= CanSet::number_bits_min && bits <= CanSet::number_bits_max;
}

template <class Places>
std::vector<CanSignal> signals_of(const Places& places) {
  std::vector<CanSignal> signals;
  signals.reserve(places.size());
  for (const auto& place : places) signals.push_back(place.signal);
  return signals;
}

}  // namespace

CanTravelSection::CanTravelSection(const TomlTable& axis, const LimiterConfig& limiter,
                                   TakenBits& sent)
    : section_(axis, limiter), travel_{section_.shape(), {}, {}} {
  const TomlTable& table = section_.table();
  refuse_registers(table);
  const std::vector<Place> values = read_values(table);
  const std::vector<Place> numbers = read_numbers(table);
  check_values(values);
  check_numbers(values, numbers);
  for (const std::vector<Place>* places : {&values, &numbers})
    for (const Place& place : *places)
      if (place.table) sent.add(place.table, "start_bit", place.signal);
  travel_.sent = {signals_of(values), signals_of(numbers)};
}

void CanTravelSection::refuse_registers(const TomlTable& own) {
  refuse_all(own, {"begin", "end"},
             "does not apply in frames: each of them has the number of the set (set_numbers)");
  own.refuse("p0_register_mm", "does not apply in frames: it is called p0_signal_mm");
}

void CanTravelSection::read_applied(const TakenBits& sent) {
  const TomlTable own = section_.table().table_or_empty("applied");
  if (!own) return;
  refuse_registers(own);
  const std::vector<Place> values = read_values(own);
  const std::vector<Place> numbers = read_numbers(own);
  check_values(values);
  check_numbers(values, numbers);
  TakenBits shown;
  for (const std::vector<Place>* places : {&values, &numbers}) {
    for (const Place& place : *places) {
      if (!place.table) continue;
      shown.add(place.table, "start_bit", place.signal);
      if (sent.has_frame_of(place.signal))
        place.table.problem("id", "is in a frame that is sent, not received");
    }
  }
  travel_.applied = {signals_of(values), signals_of(numbers)};
  if (numbers.empty() || travel_.sent.numbers.empty()) return;
  const int bits = travel_.sent.numbers.front().length_bits;
  if (can_count(bits) && numbers.front().signal.length_bits != bits)
    numbers.front().table.problem("length_bits",
                                  "must be as in the frames that are sent: it is the same number");
}

void CanTravelSection::check_round(double period_s, double silent_after_s) const {
  if (travel_.applied.values.empty() || travel_.sent.numbers.empty()) return;
  const double round_s = std::ldexp(period_s, travel_.sent.numbers.front().length_bits);
  if (round_s > silent_after_s) return;
  section_.table().problem("set_numbers", "must have more bits: the numbers repeat after " +
                                              number_text(round_s) + " s, within silent_after_s");
}

std::vector<CanTravelSection::Place> CanTravelSection::read_values(const TomlTable& own) const {
  std::vector<Place> places;
  const auto add = [&places](const TomlTable& table) {
    places.push_back({table, read_can_signal(table, table, CanUse::offset)});
  };
  if (section_.is_line()) {
    add(own.table("k0_um"));
    add(own.table("slope_um_per_m"));
    if (own.has("p0_signal_mm")) add(own.table("p0_signal_mm"));
    return places;
  }
  for (const TomlTable& table : own.tables_required("offsets")) add(table);
  const std::size_t nodes = section_.shape().nodes_mm.size();
  if (!places.empty() && places.size() != nodes)
    own.problem("offsets", std::to_string(places.size()) + " places",
                "must be " + std::to_string(nodes) + ", one per node");
  return places;
}

std::vector<CanTravelSection::Place> CanTravelSection::read_numbers(const TomlTable& own) {
  std::vector<Place> places;
  for (const TomlTable& table : own.tables_required("set_numbers"))
    places.push_back({table, read_can_signal(table, table, CanUse::bits)});
  return places;
}

void CanTravelSection::check_values(const std::vector<Place>& values) const {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const TomlTable& table = values[i].table;
    if (!table) continue;
    const Carried place = carried(values[i].signal);
    if (!section_.is_line() || i == 0)
      section_.check_offset(table, "length_bits", place);
    else if (i == 1)
      section_.check_slope(table, "length_bits", place);
    else
      section_.check_p0(table, "length_bits", place);
  }
}

void CanTravelSection::check_numbers(const std::vector<Place>& values,
                                     const std::vector<Place>& numbers) {
  std::set<FrameId> numbered;
  std::set<FrameId> carrying;
  for (const Place& value : values)
    if (value.table) carrying.insert(id_of(value.signal));
  for (const Place& number : numbers) {
    const int bits = number.signal.length_bits;
    if (!can_count(bits))
      number.table.problem("length_bits", "must be in [8, 32]: a number of sets that counts up");
    else if (bits != numbers.front().signal.length_bits)
      number.table.problem("length_bits", "must be the same in each frame: it is one number");
    if (!numbered.insert(id_of(number.signal)).second)
      number.table.problem("id", "the frame has a number of the set already");
    else if (!carrying.contains(id_of(number.signal)))
      number.table.problem("id", "the frame carries no value of the set");
  }
  if (numbers.empty()) return;  // reported already
  for (const Place& value : values) {
    if (!value.table || numbered.contains(id_of(value.signal))) continue;
    value.table.problem("id",
                        "the frame carries no number of the set: name its place in set_numbers");
    numbered.insert(id_of(value.signal));  // once per frame
  }
}

namespace {

Carried carried(const ModbusValue& value) {
  return {reach(value), count_of(value)};
}

struct TravelReader {
  const TravelSection section;
  WrittenRegisters& written;
  ModbusTravel travel{section.shape(), {}, {}, {}, {}};

  /// Places begin, values and end in one block; `next` is the following address.
  ModbusValue read_in_block(const TomlTable& own, std::string_view key, RegisterUse use,
                            std::optional<int>& next) {
    const TomlTable place = own.table(key);
    const ModbusValue value = read_modbus_value(place, use);
    if (!place) {
      next.reset();
      return value;
    }
    written.add(own, key, value);
    if (next && *next != value.address)
      own.problem(key, "must begin at register " + std::to_string(*next) +
                           ": the registers of a set follow one another, from `begin` to `end`");
    next = value.address + static_cast<int>(registers_of(value.encoding));
    return value;
  }

  void read_line() {
    const TomlTable& table = section.table();
    std::optional<int> next;
    travel.begin = read_in_block(table, "begin", RegisterUse::written_bits, next);
    const ModbusValue k0 = read_in_block(table, "k0_um", RegisterUse::written, next);
    const ModbusValue slope = read_in_block(table, "slope_um_per_m", RegisterUse::written, next);
    travel.values = {k0, slope};
    if (table.has("p0_register_mm"))
      travel.values.push_back(read_in_block(table, "p0_register_mm", RegisterUse::written, next));
    check_line(table, travel.values);
    travel.end = read_in_block(table, "end", RegisterUse::written_bits, next);
    const TomlTable applied = table.table_or_empty("applied");
    if (!applied) return;
    const auto shown = [&](std::string_view key) {
      return read_modbus_value(applied.table(key), RegisterUse::number);
    };
    travel.applied = {shown("k0_um"), shown("slope_um_per_m")};
    if (applied.has("p0_register_mm")) travel.applied.push_back(shown("p0_register_mm"));
    check_line(applied, travel.applied);
  }

  void check_line(const TomlTable& own, const std::vector<ModbusValue>& values) const {
    if (own.has("k0_um")) section.check_offset(own, "k0_um", carried(values[0]));
    if (own.has("slope_um_per_m")) section.check_slope(own, "slope_um_per_m", carried(values[1]));
    if (values.size() > 2) section.check_p0(own, "p0_register_mm", carried(values[2]));
  }

  /// Consecutive values, beginning with `first`.
  static std::vector<ModbusValue> row_from(const ModbusValue& first, std::size_t count) {
    std::vector<ModbusValue> row(count, first);
    for (std::size_t i = 0; i < count; ++i)
      row[i].address = static_cast<std::uint16_t>(first.address + i * registers_of(first.encoding));
    return row;
  }

  static bool fits(const TomlTable& own, std::string_view key, const ModbusValue& first,
                   std::size_t count) {
    if (first.address + count * registers_of(first.encoding) <= 65536) return true;
    own.problem(key, "the offsets of all nodes would pass register 65535");
    return false;
  }

  void read_table() {
    const TomlTable& table = section.table();
    const std::size_t count = travel.nodes_mm.size();
    std::optional<int> next;
    travel.begin = read_in_block(table, "begin", RegisterUse::written_bits, next);
    const ModbusValue first = read_in_block(table, "offsets", RegisterUse::written, next);
    if (table.has("offsets")) section.check_offset(table, "offsets", carried(first));
    if (!fits(table, "offsets", first, count)) return;
    travel.values = row_from(first, count);
    for (std::size_t i = 1; i < count; ++i) written.add(table, "offsets", travel.values[i]);
    if (next) next = travel.values.back().address + static_cast<int>(registers_of(first.encoding));
    travel.end = read_in_block(table, "end", RegisterUse::written_bits, next);
    const TomlTable applied = table.table_or_empty("applied");
    if (!applied) return;
    const ModbusValue shown = read_modbus_value(applied, RegisterUse::number);
    section.check_offset(table, "applied", carried(shown));
    if (fits(table, "applied", shown, count)) travel.applied = row_from(shown, count);
  }
};

}  // namespace

void WrittenRegisters::add(const TomlTable& table, std::string_view key, const ModbusValue& value) {
  const bool is_s7 = value.table == ModbusTable::data_block;
  for (int i = 0; i < static_cast<int>(words_of(value.table, value.encoding)); ++i) {
    const auto [entry, is_new] = used_.emplace(value.address + i, table.path());
    if (is_new) continue;
    const int place = is_s7 ? 2 * entry->first : entry->first;
    table.problem(key, (is_s7 ? "byte " : "register ") + std::to_string(place) + " is written by " +
                           entry->second + " already");
    return;
  }
}

ModbusTravel read_modbus_travel(const TomlTable& axis, const LimiterConfig& limiter,
                                WrittenRegisters& written) {
  TravelReader reader{TravelSection(axis, limiter), written};
  reader.section.table().refuse("set_numbers",
                                "does not apply in registers: `begin` and `end` hold the number");
  reader.section.is_line() ? reader.read_line() : reader.read_table();
  const ModbusTravel& travel = reader.travel;
  if (travel.begin.encoding != travel.end.encoding)
    reader.section.table().problem(
        "end", "must have the encoding of `begin`: both hold the number of the set");
  return reader.travel;
}

}  // namespace thermocomp::sections
