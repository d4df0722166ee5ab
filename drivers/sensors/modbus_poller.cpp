#include "drivers/sensors/modbus_poller.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "drivers/modbus/shared_line.hpp"
#include "drivers/sensors/make_source.hpp"

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

namespace {

using std::chrono::seconds;

constexpr nanoseconds backoff_first = seconds(1);

bool is_serial(const ModbusLine& line) {
  return std::holds_alternative<ModbusRtu>(line.link);
}

/// Limits answers of a slow serial line, which would delay stop() and the other units.
int registers_max_of(const ModbusLine& line) {
  if (!is_serial(line)) return registers_per_request_limit;
  constexpr double answer_s_max = 0.5;
  const double register_s = static_cast<double>(time_on_line(line, 2).count()) * 1e-9;
  const double registers = std::floor(answer_s_max / register_s) - 3.0;
  return static_cast<int>(
      std::clamp(registers, double{registers_of_value_max}, double{registers_per_request_limit}));
}

void check_that(const ModbusDeviceConfig& device, bool holds, const std::string& what) {
  if (!holds) throw DriverError("device " + device.name + ": " + what);
}

void check_words(const ModbusDeviceConfig& device, std::size_t address, std::size_t words) {
  check_that(device, address + words <= 65536,
             "address " + std::to_string(address) + ": the value ends beyond register 65535");
}

void check_channel(const ModbusDeviceConfig& device, const ModbusChannel& channel) {
  const std::size_t words = words_of(channel.table, channel.encoding);
  check_words(device, channel.address, words);
  check_that(device, static_cast<int>(words) <= device.registers_per_request_max,
             "registers_per_request_max is smaller than a value");
  check_that(device, std::isfinite(channel.scale) && channel.scale != 0.0,
             "scale must be finite and not 0");
  check_that(device, std::isfinite(channel.offset_degC), "offset_degC must be finite");
  const NumberFormat format = format_in(channel.table, {channel.encoding, channel.word_order});
  for (const Sentinel& sentinel : channel.sentinels) {
    check_that(device, is_representable(sentinel.code, format.encoding),
               "code " + std::to_string(sentinel.code) + " cannot occur in the encoding");
  }
}

void check_device(const ModbusLine& line, const ModbusDeviceConfig& device) {
  const int unit_min = is_serial(line) ? 1 : 0;
  const int unit_max = is_serial(line) ? 247 : 255;
  check_that(device, device.unit >= unit_min && device.unit <= unit_max,
             "unit " + std::to_string(device.unit) + " must be in " + std::to_string(unit_min) +
                 ".." + std::to_string(unit_max));
  check_that(device, device.period_s > 0.0 && device.period_s <= 86400.0,
             "period_s must be in (0, 86400]");
  check_that(device,
             device.registers_per_request_max >= 1 &&
                 device.registers_per_request_max <= registers_per_request_limit,
             "registers_per_request_max must be in 1..125");
  check_that(device, device.gap_registers_max >= 0, "gap_registers_max must not be negative");
  check_that(device, !device.channels.empty(), "has no channel");
  for (const ModbusChannel& channel : device.channels) check_channel(device, channel);
}

std::size_t channels_of(const ModbusBusConfig& config) {
  std::size_t channels = 0;
  for (const ModbusDeviceConfig& device : config.devices) channels += device.channels.size();
  return channels;
}

}  // namespace

ModbusPoller::ModbusPoller(const ModbusBusConfig& config, ModbusConnection& connection)
    : config_(config),
      reconnect_(from_seconds(config.line.reconnect_s)),
      connection_(connection),
      readings_(channels_of(config)),
      slot_(readings_) {
  health_.name = config.name;
  health_.kind = config.outline().kind;
  for (const ModbusDeviceConfig& device_config : config.devices) {
    check_device(config.line, device_config);
    Device device{device_config, {}, {}, UnitBackoff(backoff_first)};
    plan(device);
    device.first_reading = sensors_.size();
    for (const ModbusChannel& channel : device_config.channels) {
      sensors_.push_back(channel.sensor);
    }
    devices_.push_back(std::move(device));
    health_.units.emplace_back().name = device_config.name;
  }
  if (devices_.empty()) throw DriverError("bus " + config.name + ": has no device");
  for (Device& device : devices_) device.next_due = connection_.now();
}

void ModbusPoller::plan(Device& device) const {
  device.plan = plan_requests(device.config, registers_max_of(config_.line));
  device.requests.clear();
  for (const PlannedRequest& planned : device.plan.requests) {
    const std::size_t each = is_bit_table(planned.table) ? 1 : device.plan.words_a_register;
    device.requests.push_back({planned, std::vector<std::uint16_t>(each * planned.count)});
  }
}

ModbusPoller::Answer ModbusPoller::value_of(std::size_t device, std::size_t channel) const {
  const Device& of = devices_[device];
  const WordPlace& place = of.plan.channels[channel].value;
  const Request& request = of.requests[place.request];
  const ModbusChannel& config = of.config.channels[channel];
  return {request.newest, request.planned,
          std::span(request.words).subspan(place.offset, words_of(config.table, config.encoding))};
}

std::optional<ModbusPoller::Answer> ModbusPoller::status_of(std::size_t device,
                                                            std::size_t channel) const {
  const Device& of = devices_[device];
  const auto& place = of.plan.channels[channel].status;
  if (!place) return std::nullopt;
  const Request& request = of.requests[place->request];
  return Answer{request.newest, request.planned,
                std::span(request.words).subspan(place->offset, 1)};
}

bool ModbusPoller::has_asked(std::size_t device) const noexcept {
  const Device& of = devices_[device];
  const bool all = std::none_of(of.requests.begin(), of.requests.end(), [](const Request& request) {
    return request.fault == Fault::never_read;
  });
  return of.rounds > 0 && (all || of.rounds > of.requests.size());
}

void ModbusPoller::newest(std::span<Reading> all) noexcept {
  slot_.fresh();
  const std::vector<Reading>& newest_readings = slot_.front();
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    if (sensors_[i] < all.size()) all[sensors_[i]] = newest_readings[i];
  }
}

BusHealth ModbusPoller::health() const {
  const std::lock_guard lock(health_mutex_);
  return health_;
}

// ---- schedule

nanoseconds ModbusPoller::next_action_at() const noexcept {
  if (connection_.connected()) return due(devices_[most_due()]);
  if (lost_ && !loss_reported_ && connection_.now() < next_connect_at_) return connection_.now();
  return next_connect_at_;
}

void ModbusPoller::act() {
  if (connects_ != connection_.connects()) note_connected();
  if (connection_.connected()) {
    Device& device = devices_[most_due()];
    if (connection_.pause_until(due(device))) poll(device);
  } else if (lost_ && !loss_reported_ && connection_.now() < next_connect_at_) {
    set_lost();  // otherwise closed on purpose, and reported by the failed exchanges
  } else if (connection_.pause_until(next_connect_at_)) {
    connect();
  }
}

void ModbusPoller::connect() {
  next_connect_at_ = connection_.now() + reconnect_;
  const bool connected = connection_.connect();
  if (connection_.cancelled()) return;
  if (connected) return note_connected();
  {
    const std::lock_guard lock(health_mutex_);
    health_.last_error = connection_.last_error();
  }
  set_lost();
}

/// The line was opened by this poller, within an exchange or by another user.
void ModbusPoller::note_connected() {
  connects_ = connection_.connects();
  if (lost_) {  // dead units may have returned with the line
    for (Device& device : devices_) {
      device.backoff.answered();
      device.next_due = std::min(device.next_due, connection_.now());
    }
  }
  lost_ = false;
  loss_reported_ = false;
  const std::lock_guard lock(health_mutex_);
  health_.connected = true;
  health_.connects = connects_;
  health_.last_error.clear();
}

/// Marks every reading of the bus invalid.
void ModbusPoller::set_lost() {
  lost_ = true;
  loss_reported_ = true;
  for (Device& device : devices_) {
    for (Request& request : device.requests) request.fault = Fault::no_answer;
    finish_round(device, false);
  }
  publish();
  const std::lock_guard lock(health_mutex_);
  health_.connected = false;
  for (UnitHealth& unit : health_.units) unit.answering = false;
}

nanoseconds ModbusPoller::due(const Device& device) const noexcept {
  return std::max({device.next_due, device.backoff.not_before(), ready_at(device, device.cursor)});
}

/// Before this time, an answer to another request may come that fits this one too.
nanoseconds ModbusPoller::ready_at(const Device& device, std::size_t index) const noexcept {
  const PlannedRequest& planned = device.requests[index].planned;
  return connection_.ready_at(device.config.unit, planned.table, planned.address, planned.count);
}

std::size_t ModbusPoller::most_due() const noexcept {
  const auto earlier = [this](const Device& a, const Device& b) { return due(a) < due(b); };
  return static_cast<std::size_t>(std::min_element(devices_.begin(), devices_.end(), earlier) -
                                  devices_.begin());
}

/// A unit alone on its line can be asked often without delaying others.
nanoseconds ModbusPoller::pause_max() const noexcept {
  const bool is_alone = devices_.size() == 1 && !connection_.is_shared();
  const ModbusLine& line = config_.line;
  return from_seconds(is_alone ? std::min(line.backoff_s_max, line.reconnect_s)
                               : line.backoff_s_max);
}

std::size_t ModbusPoller::dead_units() const noexcept {
  return static_cast<std::size_t>(
      std::count_if(devices_.begin(), devices_.end(),
                    [](const Device& device) { return device.backoff.dead(); }));
}

/// One round over the device's requests from its cursor: an unanswered request is repeated first,
/// so that a late answer can only belong to the same request.
void ModbusPoller::poll(Device& device) {
  const nanoseconds began_at = connection_.now();
  const nanoseconds period = std::max(from_seconds(device.config.period_s), nanoseconds{1});
  const bool from_start = device.cursor == 0;
  for (Request& request : device.requests) request.settled = false;
  const std::size_t begin = device.cursor;
  device.cursor = 0;
  Step step = Step::next;
  for (std::size_t k = 0; k < device.requests.size() && step == Step::next; ++k) {
    const std::size_t index = (begin + k) % device.requests.size();
    if (k > 0 && ready_at(device, index) > connection_.now()) {
      device.cursor = index;
      step = Step::again;  // other units need not wait for it
    } else {
      step = ask(device, index);
    }
  }
  if (step == Step::line_lost) {
    if (!connection_.cancelled()) set_lost();
    return;
  }
  if (step != Step::again && device.next_due <= began_at) {
    device.next_due += period * ((began_at - device.next_due) / period + 1);  // keeps its phase
  }
  if (step != Step::again) ++device.rounds;
  finish_round(device, from_start);
  publish();
}

/// Splits the device's requests. @return false if that is not possible
bool ModbusPoller::split(Device& device, std::size_t index) const {
  const Request& request = device.requests[index];
  const int code = request.newest.exception_code;
  const bool is_refused = code == illegal_address || code == illegal_value;
  if (!is_refused || request.arrived_at != nanoseconds{0}) return false;
  const std::size_t before = device.requests.size();
  ModbusDeviceConfig fewer = device.config;
  const auto count = [&] {
    return plan_requests(fewer, registers_max_of(config_.line)).requests.size();
  };
  fewer.gap_registers_max = 0;
  if (count() == before) fewer.one_register_a_request = true;
  if (count() == before) return false;
  device.config = fewer;
  device.is_split = true;
  plan(device);
  return true;
}

ModbusPoller::Step ModbusPoller::ask(Device& device, std::size_t index) {
  Request& request = device.requests[index];
  const Exchange exchange =
      connection_.read(device.config.unit, request.planned.table, request.planned.address,
                       request.words, device.config.wide_registers);
  if (exchange.outcome == ExchangeOutcome::cancelled) return Step::line_lost;
  request.newest = exchange;
  note(static_cast<std::size_t>(&device - devices_.data()), exchange);
  if (exchange.outcome == ExchangeOutcome::disconnected) {
    device.cursor = index;
    return Step::line_lost;
  }
  if (!exchange.unit_answered()) return give_up(device, index, exchange);
  device.tries = 0;
  device.backoff.answered();
  if (split(device, index)) return Step::again;
  request.settled = true;
  request.fault = exchange.fault();
  if (exchange.ok()) {
    // A gateway may return a buffered answer from any time after the request.
    const nanoseconds timeout = from_seconds(1e-3 * config_.line.timeout_ms);
    request.arrived_at = std::min(exchange.arrived_at, exchange.sent_at + timeout);
  }
  return Step::next;
}

/// Handles a request without a usable answer: another attempt, or the fault.
ModbusPoller::Step ModbusPoller::give_up(Device& device, std::size_t index,
                                         const Exchange& exchange) {
  // A gateway that answers for a unit has already asked it.
  const bool gateway = exchange.outcome == ExchangeOutcome::exception;
  if (!gateway && !device.backoff.dead() && device.tries < config_.line.retries) {
    ++device.tries;
    device.cursor = index;
    return Step::again;
  }
  device.tries = 0;
  device.cursor = (index + 1) % device.requests.size();
  const bool any_answered = std::any_of(device.requests.begin(), device.requests.end(),
                                        [](const Request& request) { return request.settled; });
  // A unit is not dead if only some registers are never answered.
  for (Request& request : device.requests) {
    if (!request.settled && (!any_answered || &request == &device.requests[index])) {
      request.fault = exchange.fault();
    }
  }
  if (!any_answered) {
    const bool was_dead = device.backoff.dead();
    const nanoseconds now = connection_.now();
    const nanoseconds cost = std::max(now - exchange.sent_at, connection_.held());
    device.backoff.failed(now, cost, dead_units() + (was_dead ? 0 : 1), pause_max());
  }
  return Step::end_of_round;
}

// ---- readings from answers

bool ModbusPoller::renewed(Device& device, bool whole_from_start) const {
  if (!device.config.renewal) return true;
  const Request& request = device.requests[device.plan.renewal->request];
  if (!whole_from_start || !request.settled || request.fault != Fault::none) return false;
  const std::uint16_t counter = request.words[device.plan.renewal->offset];
  const bool moved = !device.counter_known || counter != device.counter;
  device.counter = counter;
  device.counter_known = true;
  return moved;
}

void ModbusPoller::finish_round(Device& device, bool whole_from_start) {
  const bool renewed_now = renewed(device, whole_from_start);
  for (std::size_t i = 0; i < device.config.channels.size(); ++i) {
    Reading& reading = readings_[device.first_reading + i];
    reading = evaluate(device, i, reading, renewed_now);
  }
}

Reading ModbusPoller::evaluate(const Device& device, std::size_t channel, const Reading& before,
                               bool renewed_now) const {
  const ModbusChannel& config = device.config.channels[channel];
  const ChannelPlace& place = device.plan.channels[channel];
  const Request& request = device.requests[place.value.request];
  Fault fault = request.fault;
  nanoseconds arrived_at = request.arrived_at;
  if (fault == Fault::none && place.status) {
    const Request& status = device.requests[place.status->request];
    // A value is valid only while its status is fresh.
    arrived_at = std::min(arrived_at, status.arrived_at);
    fault = status.fault != Fault::none
                ? status.fault
                : decode_status(*config.status, status.words[place.status->offset]);
  }
  if (fault != Fault::none) return {not_a_number, before.taken_at, fault};
  const auto words = std::span(request.words).subspan(place.value.offset);
  const Decoded decoded = decode(words, format_of(config), config.sentinels);
  if (decoded.fault != Fault::none) return {not_a_number, before.taken_at, decoded.fault};
  if (!may_be_measured(config, decoded.value))
    return {not_a_number, before.taken_at, Fault::out_of_range};
  const bool stamp = renewed_now || before.taken_at == nanoseconds{0};
  return {decoded.value, stamp ? arrived_at : before.taken_at, Fault::none};
}

void ModbusPoller::publish() noexcept {
  std::copy(readings_.begin(), readings_.end(), slot_.back().begin());
  slot_.publish();
}

void ModbusPoller::note(std::size_t device, const Exchange& exchange) {
  const std::lock_guard lock(health_mutex_);
  UnitHealth& unit = health_.units[device];
  ++unit.requests;
  unit.answering = exchange.unit_answered();
  switch (exchange.outcome) {
    case ExchangeOutcome::ok:
      ++unit.answers;
      unit.round_trip_ms =
          static_cast<double>((exchange.arrived_at - exchange.sent_at).count()) * 1e-6;
      break;
    case ExchangeOutcome::exception:
      ++unit.exceptions;
      break;
    case ExchangeOutcome::timeout:
      ++unit.timeouts;
      break;
    case ExchangeOutcome::bad_frame:
      ++unit.bad_frames;
      break;
    case ExchangeOutcome::disconnected:
      health_.connected = false;
      health_.last_error = exchange.detail;
      break;
    case ExchangeOutcome::cancelled:
      break;
  }
  if (exchange.ok() ? !unit.last_error.empty() : unit.last_error != exchange.detail) {
    unit.last_error = exchange.detail;
  }
}

namespace {

/// Thermocouples on one Modbus line (TCP or RTU), polled by the line's thread.
class ModbusSource final : public SensorSource {
 public:
  explicit ModbusSource(const ModbusBusConfig& config)
      : name_("mb-" + config.name),
        line_(SharedLine::of(config.line)),
        poller_(config, line_->connection()) {}
  ~ModbusSource() override { ModbusSource::stop(); }

  void start() override { line_->join(poller_, name_); }
  void stop() noexcept override { line_->leave(poller_, {}); }
  void newest(std::span<Reading> all) noexcept override { poller_.newest(all); }
  [[nodiscard]] BusHealth health() const override { return poller_.health(); }

 private:
  std::string name_;
  std::shared_ptr<SharedLine> line_;
  ModbusPoller poller_;
};

}  // namespace

std::unique_ptr<SensorSource> make_bus_source(const ModbusBusConfig& bus) {
  return std::make_unique<ModbusSource>(bus);
}

}  // namespace thermocomp
