#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <numeric>
#include <utility>

#include "drivers/controllers/travel_values.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t bits_a_read_max = 2000;

}  // namespace

ReadPlan plan_reads(std::span<const ModbusValue> values, const ModbusControllerConfig& config) {
  const auto gap_max = static_cast<std::size_t>(config.gap_registers_max);
  const auto registers_max = static_cast<std::size_t>(config.registers_per_request_max);
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (values[a].table != values[b].table) return values[a].table < values[b].table;
    return values[a].address < values[b].address;
  });
  ReadPlan plan;
  plan.places.resize(values.size());
  for (const std::size_t index : order) {
    const ModbusValue& value = values[index];
    const std::size_t begin = value.address;
    const std::size_t end = begin + words_of(value.table, value.encoding);
    const std::size_t most = is_bit_table(value.table) ? bits_a_read_max : registers_max;
    if (plan.requests.empty() || plan.requests.back().table != value.table ||
        begin > plan.requests.back().address + plan.requests.back().count + gap_max ||
        end - plan.requests.back().address > most) {
      plan.requests.push_back({value.table, value.address, 0});
    }
    ReadRequest& request = plan.requests.back();
    plan.places[index] = {plan.requests.size() - 1, begin - request.address};
    request.count = std::max(request.count, end - request.address);
  }
  return plan;
}

std::vector<WriteField> join_writes(std::vector<WriteField> fields, std::size_t registers_max) {
  std::sort(fields.begin(), fields.end(),
            [](const WriteField& a, const WriteField& b) { return a.address < b.address; });
  std::vector<WriteField> requests;
  for (WriteField& field : fields) {
    if (!requests.empty()) {
      WriteField& last = requests.back();
      const bool touches = last.address + last.words.size() == field.address;
      if (touches && last.words.size() + field.words.size() <= registers_max) {
        last.words.insert(last.words.end(), field.words.begin(), field.words.end());
        last.stage = std::max(last.stage, field.stage);
        continue;
      }
    }
    requests.push_back(std::move(field));
  }
  std::stable_sort(requests.begin(), requests.end(),
                   [](const WriteField& a, const WriteField& b) { return a.stage < b.stage; });
  return requests;
}

Exchange write_field(ModbusConnection& connection, const ModbusControllerConfig& config,
                     const WriteField& request) {
  return config.write_function == ModbusControllerConfig::one_register
             ? connection.write_register(config.unit, request.address, request.words.front())
             : connection.write_registers(config.unit, request.address, request.words);
}

bool is_refused(const Exchange& exchange) noexcept {
  return exchange.outcome == ExchangeOutcome::exception && exchange.unit_answered();
}

std::string s7_place(const S7Block& s7, std::size_t address, std::size_t count) {
  return "DB" + std::to_string(s7.db) + ", bytes " + std::to_string(2 * address) + ".." +
         std::to_string(2 * (address + count) - 1);
}

std::string write_error(const ModbusControllerConfig& config, const WriteField& request,
                        const Exchange& exchange) {
  const std::string begins =
      is_refused(exchange) ? "the controller refuses writes" : "no write is answered";
  if (const S7Block* s7 = s7_of(config.line))
    return begins + " (" + s7_place(*s7, request.address, request.words.size()) +
           "): " + exchange.detail;
  const bool may_take_one = config.write_function != ModbusControllerConfig::one_register &&
                            exchange.exception_code == illegal_function;
  return begins + " (function " + std::to_string(config.write_function) + ", register " +
         std::to_string(request.address) + "): " + exchange.detail +
         (may_take_one ? "; if it takes single registers only, write_function = 6" : "") +
         (exchange.exception_code == illegal_value ? "; if the offset is beyond a limit of the "
                                                     "controller, offset_um_max must be below it"
                                                   : "");
}

namespace {

void append(WriteField& field, const ModbusValue& place, double value, Encoding encoding) {
  const Encoded encoded = encode(value, {encoding, place.word_order, place.scale, 0.0});
  field.words.insert(field.words.end(), encoded.words().begin(), encoded.words().end());
}

/// All bits of a set's number are used.
Encoding count_encoding(const ModbusValue& place) noexcept {
  return place.encoding == Encoding::uint32 ? Encoding::uint32 : Encoding::uint16;
}

}  // namespace

void check_travel(const ModbusTravel& travel) {
  check_shape(travel);
  check_count(travel, travel.values.size(), "values");
  if (!travel.applied.empty()) check_count(travel, travel.applied.size(), "applied");
  std::size_t next = travel.begin.address + registers_of(travel.begin.encoding);
  const auto follows = [&next](const ModbusValue& value) {
    require(value.table == ModbusTable::holding && value.address == next, "address", value.address,
            "the registers of a set must follow one another: begin, values, end");
    next += registers_of(value.encoding);
  };
  for (const ModbusValue& value : travel.values) follows(value);
  follows(travel.end);
  for (const ModbusValue* number : {&travel.begin, &travel.end})
    require((number->encoding == Encoding::uint16 || number->encoding == Encoding::uint32) &&
                number->encoding == travel.begin.encoding && number->scale == 1.0,
            "encoding", number->address,
            "begin and end must be both uint16 or both uint32, without scale");
}

std::uint64_t travel_numbers(const ModbusTravel& travel) noexcept {
  return std::uint64_t{1} << (count_encoding(travel.begin) == Encoding::uint32 ? 32 : 16);
}

WriteField travel_field(const ModbusTravel& travel, std::uint64_t number,
                        std::span<const double> offset_um) {
  WriteField field{travel.begin.address, WriteStage::offset, {}};
  const auto add_number = [&](const ModbusValue& place) {
    append(field, place, static_cast<double>(number), count_encoding(place));
  };
  add_number(travel.begin);
  const std::vector<double> values = travel_values(travel, travel.values.size(), offset_um);
  for (std::size_t i = 0; i < values.size(); ++i)
    append(field, travel.values[i], values[i], travel.values[i].encoding);
  add_number(travel.end);
  return field;
}

double shown_resolution_um(const ModbusTravel& travel, std::size_t node) {
  std::vector<double> counts;
  counts.reserve(travel.applied.size());
  for (const ModbusValue& value : travel.applied) counts.push_back(value.scale);
  return node_resolution_um(travel, counts, node);
}

namespace {

double value_of(const ModbusValue& place, std::span<const std::uint16_t> words) {
  return thermocomp::decode(words, {place.encoding, place.word_order, place.scale, 0.0}, {}).value;
}

ReadRequest request_of(const ModbusAxis& axis) {
  if (!axis.travel)
    return {axis.offset.table, axis.offset.address, registers_of(axis.offset.encoding)};
  const ModbusValue& end = axis.travel->end;
  const std::uint16_t begin = axis.travel->begin.address;
  return {ModbusTable::holding, begin, end.address + registers_of(end.encoding) - begin};
}

bool is_zero(std::span<const std::uint16_t> words) noexcept {
  return std::all_of(words.begin(), words.end(), [](std::uint16_t word) { return word == 0; });
}

}  // namespace

WrittenOffsets::WrittenOffsets(const ModbusAxis& axis) : axis_(axis), request_(request_of(axis)) {}

std::vector<double> WrittenOffsets::decode(std::span<const std::uint16_t> words) const {
  std::vector<double> offsets(axis_.offsets(), not_a_number);
  if (words.size() != request_.count) return offsets;
  if (!axis_.travel) return {value_of(axis_.offset, words)};
  const ModbusTravel& travel = *axis_.travel;
  const auto at = [&](const ModbusValue& place) {
    return words.subspan(place.address - request_.address);
  };
  const auto number = [&](const ModbusValue& place) {
    return bits_of(at(place).first(registers_of(place.encoding)), place.encoding, place.word_order);
  };
  // An incomplete set is not in effect.
  if (number(travel.begin) != number(travel.end)) return offsets;
  std::vector<double> values;
  for (const ModbusValue& value : travel.values) values.push_back(value_of(value, at(value)));
  offsets_shown(travel, values, offsets);
  return offsets;
}

void WrittenOffsets::wrote(const WriteField& field) {
  if (field.words == words_) return;
  words_before_ = std::exchange(words_, field.words);
}

void WrittenOffsets::taken() {
  taken_ = words_;
}

bool WrittenOffsets::is_one_written(std::span<const std::uint16_t> words) const noexcept {
  return std::ranges::equal(words, words_) || std::ranges::equal(words, words_before_) ||
         std::ranges::equal(words, taken_);
}

bool WrittenOffsets::holds_an_offset() const noexcept {
  return holds_known_offset() && !is_zero(taken_);
}

bool WrittenOffsets::is_cleared(std::span<const std::uint16_t> words) const noexcept {
  return is_zero(words) && !is_one_written(words);
}

void WrittenOffsets::left_out() {
  taken_.clear();
  words_.clear();
  words_before_.clear();
  differed_ = false;
  untaken_.clear();
}

bool WrittenOffsets::is_to_be_compared(bool is_due) const noexcept {
  if (words_.empty() || held_ == Held::no) return false;
  if (held_ == Held::yes) return is_due;
  // Registers that hold nothing are also read as zeros.
  return !is_zero(words_);
}

void WrittenOffsets::compare(std::span<const std::uint16_t> words) {
  if (held_ == Held::not_known) {
    held_ = std::ranges::equal(words, words_) ? Held::yes : Held::no;
    return;
  }
  untaken_.clear();
  const bool differs =
      !std::ranges::equal(words, words_) && !std::ranges::equal(words, words_before_);
  if (std::exchange(differed_, differs) && differs) {
    const std::vector<double> written = decode(words_);
    const std::vector<double> read = decode(words);
    const auto [mine, other] = std::mismatch(written.begin(), written.end(), read.begin());
    const auto i = mine == written.end() ? 0 : mine - written.begin();
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "%.2f was written, %.2f is read",
                  written[static_cast<std::size_t>(i)], read[static_cast<std::size_t>(i)]);
    untaken_ = text.data();
  }
}

std::string untaken_error(const ModbusControllerConfig& config, const WrittenOffsets& written) {
  const ReadRequest& request = written.request();
  const S7Block* s7 = s7_of(config.line);
  return "writes are answered, but " +
         (s7 != nullptr ? s7_place(*s7, request.address, request.count)
                        : "register " + std::to_string(request.address)) +
         " keeps another value: " + written.difference_text();
}

namespace {

void check_place(const ModbusValue& value, const char* key) {
  const std::size_t end = value.address + words_of(value.table, value.encoding);
  require(end <= 65536, key, value.address, "the value must end within address 65535");
  require(std::isfinite(value.scale) && value.scale != 0.0, key, value.scale,
          "the scale must be finite and not 0");
}

void check_written(const ModbusValue& value, const char* key) {
  check_place(value, key);
  require(value.table == ModbusTable::holding || value.table == ModbusTable::data_block, key,
          value.address, "only holding registers can be written");
}

}  // namespace

void check_layout(const ModbusControllerConfig& config) {
  require(config.period_s > 0.0 && std::isfinite(config.period_s), "period_s", config.period_s,
          "must be finite and more than 0");
  require(config.unit >= 0 && config.unit <= 255, "unit", config.unit, "must be in [0, 255]");
  require(config.offsets() <= axes_max, "axes", static_cast<double>(config.offsets()),
          "a controller has at most 16 axes, nodes of travels counted");
  std::vector<std::pair<std::size_t, std::size_t>> written;
  const auto note = [&written](const ModbusValue& value, const char* key) {
    check_written(value, key);
    written.emplace_back(value.address, value.address + registers_of(value.encoding));
  };
  for (const ModbusAxis& axis : config.axes) {
    if (axis.travel) {
      check_travel(*axis.travel);
      note(axis.travel->begin, "begin");
      for (const ModbusValue& value : axis.travel->values) note(value, "values");
      note(axis.travel->end, "end");
      for (const ModbusValue& value : axis.travel->applied) check_place(value, "applied");
      continue;
    }
    note(axis.offset, "offset");
    if (axis.applied) check_place(*axis.applied, "applied");
    if (axis.piezo) axis.piezo->validate();
  }
  for (const ModbusSignal& signal : config.signals) {
    require(signal.signal < signals_max, "signal", static_cast<double>(signal.signal),
            "a controller has at most 48 signals");
    check_place(signal.value, "signal");
  }
  if (config.valid_bits) note(*config.valid_bits, "valid_bits");
  if (config.heartbeat) note(*config.heartbeat, "heartbeat");
  std::sort(written.begin(), written.end());
  for (std::size_t i = 1; i < written.size(); ++i) {
    require(written[i - 1].second <= written[i].first, "address",
            static_cast<double>(written[i].first), "registers that are written must not overlap");
  }
}

std::vector<double> applied_resolution_um(const ModbusControllerConfig& config) {
  std::vector<double> steps_um;
  for (const ModbusAxis& axis : config.axes) {
    for (std::size_t node = 0; node < axis.offsets(); ++node) {
      if (axis.travel)
        steps_um.push_back(shown_resolution_um(*axis.travel, node));
      else
        steps_um.push_back(axis.applied ? std::abs(axis.applied->scale) : 0.0);
    }
  }
  return steps_um;
}

}  // namespace thermocomp
