#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"

#include <algorithm>
#include <numeric>

#include "drivers/modbus/register_codec.hpp"

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
         (may_take_one ? "; if it takes single registers only, write_function = 6" : "");
}

}  // namespace thermocomp
