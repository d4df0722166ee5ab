#include "drivers/controllers/kinds/modbus/modbus_dialogue.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/bus_thread.hpp"
#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"
#include "drivers/controllers/travel_values.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// Format of valid bits and heartbeat: plain counts, all bits used.
NumberFormat raw_format(const ModbusValue& value) noexcept {
  NumberFormat format{value.encoding, value.word_order, 1.0, 0.0};
  if (format.encoding == Encoding::int16) format.encoding = Encoding::uint16;
  if (format.encoding == Encoding::int32) format.encoding = Encoding::uint32;
  return format;
}

/// The smallest count that the register cannot hold exactly.
std::uint64_t counts_of(Encoding encoding) noexcept {
  switch (encoding) {
    case Encoding::int16:
    case Encoding::uint16:
      return std::uint64_t{1} << 16;
    case Encoding::int32:
    case Encoding::uint32:
      return std::uint64_t{1} << 32;
    case Encoding::float32:
      return std::uint64_t{1} << 24;
    case Encoding::float64:
      break;
  }
  return std::uint64_t{1} << 53;
}

bool drivable(const OffsetCommand& command, std::size_t axis) noexcept {
  return command.valid[axis] && std::isfinite(command.offset_um[axis]);
}

/// Offset of a piezo at an amplifier voltage; 0 at rest.
double resting_um(const PiezoConfig& config, double volt) {
  return std::abs(volt) <= config.tolerance_V ? 0.0 : displacement_at(config, volt);
}

WriteField field_of(const ModbusValue& place, WriteStage stage, double value,
                    const NumberFormat& format) {
  const Encoded encoded = encode(value, format);
  return {place.address, stage, {encoded.words().begin(), encoded.words().end()}};
}

}  // namespace

ModbusDialogue::ModbusDialogue(ModbusControllerConfig config, ModbusConnection& connection)
    : config_((check_layout(config), std::move(config))),
      connection_(connection),
      gate_(from_seconds(config_.period_s), applied_resolution_um(config_)),
      next_exchange_at_(connection.now()),
      retry_at_(connection.now()) {
  plan_values();
  for (const ModbusAxis& axis : config_.axes) {
    piezos_.push_back(axis.piezo ? std::optional<PiezoDrive>(*axis.piezo) : std::nullopt);
    written_.push_back(axis.reads_back() ? std::nullopt : std::optional<WrittenOffsets>(axis));
  }
  health_.name = config_.name;
  health_.kind = kind_of(config_.line);
}

void ModbusDialogue::plan_values() {
  std::size_t offsets = 0;
  for (const ModbusAxis& axis : config_.axes) {
    first_.push_back(offsets);
    offsets += axis.offsets();
    shown_sets_.emplace_back(axis.travel ? axis.travel->applied.size() : 0, not_a_number);
  }
  set_numbers_.assign(config_.axes.size(), 0);
  const auto read = [this](const ModbusValue& value, double& target) {
    read_values_.push_back(value);
    read_targets_.push_back(&target);
  };
  for (std::size_t i = 0; i < config_.axes.size(); ++i) {
    const ModbusAxis& axis = config_.axes[i];
    for (std::size_t each = 0; each < shown_sets_[i].size(); ++each)
      read(axis.travel->applied[each], shown_sets_[i][each]);
    if (axis.applied) read(*axis.applied, axis.piezo ? shown_V_[i] : state_.applied_um[first_[i]]);
  }
  for (const ModbusSignal& signal : config_.signals)
    read(signal.value, state_.signals[signal.signal]);
  read_plan_ = plan_reads(read_values_, config_);
}

void ModbusDialogue::newest(ControllerState& state) noexcept {
  states_.fresh();
  state = states_.front();
}

void ModbusDialogue::offer(const OffsetCommand& command, nanoseconds computed_at) noexcept {
  commands_.back() = {command, computed_at};
  commands_.publish();
}

ControllerHealth ModbusDialogue::health() const {
  const std::scoped_lock lock(health_mutex_);
  return health_;
}

nanoseconds ModbusDialogue::next_action_at() const noexcept {
  return gate_.in_sync() ? next_exchange_at_ : retry_at_;
}

void ModbusDialogue::act() {
  const nanoseconds began = connection_.now();
  const nanoseconds period = from_seconds(config_.period_s);
  if (gate_.in_sync() && link_number() != link_) lose(false);  // another user has reopened the line
  if (!gate_.in_sync()) {
    if (!synchronise()) {
      retry_at_ = connection_.now() + from_seconds(config_.line.reconnect_s);
      return;
    }
    next_exchange_at_ = connection_.now();
  }
  // Reconnecting is not part of the controller's response time.
  const nanoseconds exchange_began = connection_.now();
  exchange();
  const nanoseconds now = connection_.now();
  gate_.note_exchange_time(now - exchange_began);
  if (now - began > period) {
    const std::scoped_lock lock(health_mutex_);
    ++health_.write.late;
  }
  retry_at_ = write_failed_ ? std::max(began + period, now) : now;
  // A slow line determines the period; missed periods are skipped.
  next_exchange_at_ = std::max(next_exchange_at_ + gate_.next_pause(), now);
}

void ModbusDialogue::end() {
  take_command();
  if (gate_.verdict(connection_.now()) == SendVerdict::send) write_command();
}

/// Without read-back a restart of the controller would go unnoticed, so an unexpected close by the
/// peer counts as a new link too.
std::uint64_t ModbusDialogue::link_number() const noexcept {
  const bool reads_back = std::none_of(written_.begin(), written_.end(),
                                       [](const auto& written) { return written.has_value(); });
  return reads_back ? connection_.links() : connection_.breaks();
}

/// Connects if necessary, reads everything, and only then begins the new epoch.
bool ModbusDialogue::synchronise() {
  if (!connection_.connected() && !connection_.connect()) {
    const std::scoped_lock lock(health_mutex_);
    health_.connected = false;
    health_.last_error = connection_.last_error();
    return false;
  }
  if (link_number() != link_) {
    link_ = link_number();
    gate_.lost();
    const std::scoped_lock lock(health_mutex_);
    ++health_.connects;
  }
  if (!gate_.link_is_new()) {
    const std::optional<bool> restarted = has_restarted();
    if (!restarted) {
      lose(refused_);
      return false;
    }
    if (*restarted) gate_.lost();
  }
  if (!read_set_numbers() || (gate_.link_is_new() && !read_written()) || !read_all()) {
    lose(refused_);
    return false;
  }
  restart_piezos();
  show_piezos();
  gate_.synchronised(judged_um());
  publish(true);
  const std::scoped_lock lock(health_mutex_);
  health_.connected = true;
  health_.last_error = health_.write.error;
  return true;
}

bool ModbusDialogue::read_set_numbers() {
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    const auto& travel = config_.axes[axis].travel;
    if (!travel) continue;
    std::vector<std::uint16_t> words(registers_of(travel->end.encoding));
    const Exchange exchange = with_retries([&] {
      return connection_.read(config_.unit, ModbusTable::holding, travel->end.address, words);
    });
    if (!exchange.ok()) {
      return note_unread({ModbusTable::holding, travel->end.address, words.size()}, exchange);
    }
    set_numbers_[axis] = bits_of(words, travel->end.encoding, travel->end.word_order);
  }
  return true;
}

bool ModbusDialogue::read_written() {
  constexpr int asked_max = 3;
  for (std::size_t axis = 0; axis < written_.size(); ++axis) {
    if (!written_[axis]) continue;
    written_[axis]->left_out();  // nothing is written on this link yet
    std::vector<std::uint16_t> words;
    if (written_[axis]->count()) {
      const ReadRequest& request = written_[axis]->request();
      const Exchange exchange = read_registers(request, words);
      // A device may lack these registers: it answers with an exception or not at all.
      const bool goes_without = refused_ && exchange.fault() == Fault::device_error;
      if (!exchange.ok() && !goes_without && ++written_asked_ < asked_max) {
        return note_unread(request, exchange);
      }
      if (!exchange.ok()) words.clear();
    }
    show_written(axis, words);
  }
  written_asked_ = 0;
  return true;
}

/// An unanswered write may have been taken: the registers last read may no longer be in effect.
void ModbusDialogue::forget_written() noexcept {
  for (std::size_t axis = 0; axis < written_.size(); ++axis)
    if (written_[axis])
      std::fill_n(state_.applied_um.begin() + static_cast<std::ptrdiff_t>(first_[axis]),
                  config_.axes[axis].offsets(), not_a_number);
}

void ModbusDialogue::show_written(std::size_t axis, std::span<const std::uint16_t> words) {
  std::vector<double> written_um = written_[axis]->decode(words);
  if (piezos_[axis]) written_um = {resting_um(*config_.axes[axis].piezo, written_um.front())};
  std::copy(written_um.begin(), written_um.end(),
            state_.applied_um.begin() + static_cast<std::ptrdiff_t>(first_[axis]));
}

/// @return nullopt: the registers of the offset could not be read
std::optional<std::vector<std::uint16_t>> ModbusDialogue::registers_now(
    const WrittenOffsets& written) {
  const ReadRequest& request = written.request();
  std::vector<std::uint16_t> words(request.count);
  const Exchange exchange = connection_.read(config_.unit, request.table, request.address, words);
  return exchange.ok() ? std::optional(std::move(words)) : std::nullopt;
}

Exchange ModbusDialogue::read_registers(const ReadRequest& request,
                                        std::vector<std::uint16_t>& words) {
  words.resize(request.count);
  return with_retries(
      [&] { return connection_.read(config_.unit, request.table, request.address, words); });
}

/// Behind a gateway that answers for it, a controller restarts without a new link; its registers
/// then hold none of the offsets written. While a register that held them cannot be read, it may
/// be restarting: nothing is written.
std::optional<bool> ModbusDialogue::has_restarted() {
  for (std::size_t axis = 0; axis < written_.size(); ++axis) {
    const std::optional<WrittenOffsets>& written = written_[axis];
    if (!written || !written->holds_known_offset()) continue;
    std::vector<std::uint16_t> words;
    const Exchange exchange = read_registers(written->request(), words);
    if (!exchange.ok()) {
      note_unread(written->request(), exchange);
      return std::nullopt;
    }
    if (!written->is_one_written(words)) return true;
    show_written(axis, words);
  }
  return false;
}

/// A controller whose program starts again may keep the link; its registers are then 0. One axis
/// with an offset shows it.
bool ModbusDialogue::is_cleared() {
  for (const std::optional<WrittenOffsets>& written : written_) {
    if (!written || !written->holds_an_offset()) continue;
    const auto words = registers_now(*written);
    return words && written->is_cleared(*words);
  }
  return false;
}

/// Done before the next write, since a controller's program may change a register at its next scan.
/// @return false: the link is lost
bool ModbusDialogue::compare_written() {
  if (!write_taken_) return true;
  if (is_cleared()) {
    lose(true);  // synchronise() finds that it has restarted
    return false;
  }
  const bool is_due = connection_.now() >= compare_at_;
  if (is_due) compare_at_ = connection_.now() + gate_.patience();
  bool held = true;
  for (std::size_t axis = 0; axis < written_.size(); ++axis) {
    std::optional<WrittenOffsets>& written = written_[axis];
    if (!written || !written->is_to_be_compared(is_due)) continue;
    const auto words = registers_now(*written);
    if (!words) continue;
    written->compare(*words);
    show_written(axis, *words);
    held = held && written->count();
  }
  // At the start of the link the registers did not contain a written offset.
  if (!held) lose(false);
  return held;
}

/// One period: reads, and writes only if the offsets written explain the read-back. So no command
/// computed before a re-homing was seen is written after it (a command carries the number of the
/// read-back it was computed from), and a slow controller still gets the newest command. A write
/// without answer is not repeated before another read, since the controller can restart during the
/// time-out. A refused write waits for the next period.
void ModbusDialogue::exchange() {
  write_failed_ = false;
  take_command();
  for (int retries = config_.line.retries;; --retries) {
    if (!read_and_judge()) {
      if (!ending_.load()) lose(refused_);
      return;
    }
    if (!shows_piezos()) return;
    take_command();
    const SendVerdict verdict = gate_.verdict(connection_.now());
    if (verdict == SendVerdict::resynchronise) lose(true);
    if (verdict != SendVerdict::send) return;
    if (!compare_written()) return;
    if (write_command()) return;
    if (refused_ || retries == 0 || !connection_.connected() || ending_.load())
      return lose_by_write();
  }
}

bool ModbusDialogue::read_and_judge() {
  if (!read_all()) return false;
  show_piezos();
  if (!gate_.check_read_back(judged_um())) {
    gate_.synchronised(judged_um());
    const std::scoped_lock lock(health_mutex_);
    health_.last_error = "the controller applies an offset that was not sent";
  }
  publish(true);
  return true;
}

/// An amplifier whose voltage is unknown may have been moved meanwhile.
bool ModbusDialogue::shows_piezos() const noexcept {
  for (std::size_t axis = 0; axis < piezos_.size(); ++axis)
    if (piezos_[axis] && config_.axes[axis].reads_back() && !std::isfinite(shown_V_[axis]))
      return false;
  return true;
}

void ModbusDialogue::take_command() {
  if (commands_.fresh()) gate_.offered(commands_.front().command, commands_.front().computed_at);
}

double ModbusDialogue::written_value(std::size_t axis, double offset_um) {
  return piezos_[axis] ? piezos_[axis]->step(connection_.now(), offset_um) : offset_um;
}

std::vector<WriteField> ModbusDialogue::fields_of(const OffsetCommand& command) {
  std::vector<WriteField> fields;
  double valid_bits = 0.0;
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis)
    add_axis(axis, command, fields, valid_bits);
  if (config_.valid_bits) {
    fields.push_back(field_of(*config_.valid_bits, WriteStage::valid_bits, valid_bits,
                              raw_format(*config_.valid_bits)));
  }
  if (config_.heartbeat) {
    fields.push_back(field_of(*config_.heartbeat, WriteStage::heartbeat,
                              static_cast<double>(heartbeat_), raw_format(*config_.heartbeat)));
  }
  return fields;
}

void ModbusDialogue::add_axis(std::size_t axis, const OffsetCommand& command,
                              std::vector<WriteField>& fields, double& valid_bits) {
  const ModbusAxis& place = config_.axes[axis];
  for (std::size_t i = 0; i < place.offsets(); ++i)
    if (!drivable(command, first_[axis] + i)) {
      if (written_[axis]) written_[axis]->left_out();
      return;
    }
  const auto offset_um = std::span(command.offset_um).subspan(first_[axis], place.offsets());
  if (place.travel) {
    set_numbers_[axis] = (set_numbers_[axis] + 1) % travel_numbers(*place.travel);
    fields.push_back(travel_field(*place.travel, set_numbers_[axis], offset_um));
  } else {
    const double value = written_value(axis, offset_um.front());
    if (std::isnan(value)) return;  // a piezo that waits for a steady offset
    const ModbusValue& offset = place.offset;
    fields.push_back(field_of(offset, WriteStage::offset, value,
                              {offset.encoding, offset.word_order, offset.scale, 0.0}));
  }
  if (written_[axis]) written_[axis]->wrote(fields.back());
  valid_bits += std::ldexp(1.0, static_cast<int>(axis));
}

bool ModbusDialogue::write_command() {
  if (config_.heartbeat) heartbeat_ = (heartbeat_ + 1) % counts_of(config_.heartbeat->encoding);
  const std::vector<WriteField> requests =
      join_writes(fields_of(gate_.command()), config_.registers_per_write());
  for (const WriteField& request : requests) {
    if (!write(request)) return false;
  }
  const nanoseconds now = connection_.now();
  write_taken_ = true;
  for (std::optional<WrittenOffsets>& written : written_)
    if (written) written->taken();
  gate_.sent(now);
  if (requests.empty()) return true;  // no axis is driven, and nothing else must be written
  const auto difference_text = std::find_if(
      written_.begin(), written_.end(),
      [](const auto& written) { return written && !written->difference_text().empty(); });
  if (difference_text == written_.end()) {
    gate_.confirmed(now);
    note_confirmed(now);
  } else {
    gate_.unconfirmed();
    const std::scoped_lock lock(health_mutex_);
    health_.last_error = health_.write.error = untaken_error(config_, **difference_text);
  }
  publish(true);
  return true;
}

void ModbusDialogue::note_confirmed(nanoseconds now) {
  const std::scoped_lock lock(health_mutex_);
  ++health_.writes;
  WriteHealth& last = health_.write;
  if (health_.last_error == last.error) health_.last_error.clear();
  last.confirmed_at = now;
  last.function = last.address = last.exception = 0;
  last.error.clear();
}

bool ModbusDialogue::write(const WriteField& request) {
  const Exchange exchange = write_field(connection_, config_, request);
  note_refusal(exchange);
  if (exchange.ok()) return true;
  const std::scoped_lock lock(health_mutex_);
  ++health_.write_errors;
  WriteHealth& last = health_.write;
  ++(refused_ ? last.refused : last.unanswered);
  const bool is_s7 = s7_of(config_.line) != nullptr;  // only then the text names the place
  last.function = is_s7 ? 0 : config_.write_function;
  last.address = is_s7 ? 0 : request.address;
  last.exception = is_s7 ? exchange.exception_code & 0x7F : exchange.exception_code;
  health_.last_error = last.error = write_error(config_, request, exchange);
  return false;
}

template <class Request>
Exchange ModbusDialogue::with_retries(Request&& request) {
  Exchange exchange = request();
  for (int again = 0; again < config_.line.retries; ++again) {
    if (exchange.ok() || exchange.outcome == ExchangeOutcome::disconnected || ending_.load()) {
      break;
    }
    exchange = request();
  }
  note_refusal(exchange);
  return exchange;
}

bool ModbusDialogue::note_unread(const ReadRequest& request, const Exchange& exchange) {
  const std::size_t last = request.address + request.count - 1;
  const bool is_block = request.count > registers_of(Encoding::float64) && refused_;
  const std::scoped_lock lock(health_mutex_);
  ++health_.read_errors;
  if (const S7Block* s7 = s7_of(config_.line)) {
    health_.last_error =
        "reading " + s7_place(*s7, request.address, request.count) + ": " + exchange.detail;
    return false;
  }
  health_.last_error =
      "reading " + std::to_string(request.address) +
      (request.count > 1 ? ".." + std::to_string(last) : "") + ": " + exchange.detail +
      (is_block ? "; gap_registers_max = 0 in [controller] reads none between the values" : "");
  return false;
}

void ModbusDialogue::note_refusal(const Exchange& exchange) noexcept {
  refused_ = is_refused(exchange);
}

/// Reads every value into state_, or none on failure; taken_at is the time of the first request.
bool ModbusDialogue::read_all() {
  std::vector<std::vector<std::uint16_t>> answers;
  nanoseconds taken_at = connection_.now();
  for (const ReadRequest& request : read_plan_.requests) {
    answers.emplace_back(request.count);
    const Exchange exchange = with_retries([&] {
      return connection_.read(config_.unit, request.table, request.address, answers.back());
    });
    if (!exchange.ok()) {
      return note_unread(request, exchange);
    }
    if (answers.size() == 1) taken_at = exchange.sent_at;
  }
  take(answers);
  const std::scoped_lock lock(health_mutex_);
  if (gate_.in_sync()) health_.report_aged = connection_.now() - state_.taken_at;
  state_.taken_at = taken_at;
  ++health_.reads;
  health_.last_error = health_.write.error;
  return true;
}

void ModbusDialogue::take(std::span<const std::vector<std::uint16_t>> answers) {
  for (std::size_t i = 0; i < read_values_.size(); ++i) {
    const ModbusValue& value = read_values_[i];
    const ValuePlace place = read_plan_.places[i];
    const std::span<const std::uint16_t> words = answers[place.request];
    const NumberFormat format =
        format_in(value.table, {value.encoding, value.word_order, value.scale, 0.0});
    *read_targets_[i] = decode(words.subspan(place.word), format, {}).value;
  }
  show_travels();
}

void ModbusDialogue::show_travels() noexcept {
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    const auto& travel = config_.axes[axis].travel;
    if (!travel || travel->applied.empty()) continue;
    offsets_shown(*travel, shown_sets_[axis],
                  std::span(state_.applied_um).subspan(first_[axis], travel->nodes_mm.size()));
  }
}

/// At a new epoch the drives start from the amplifiers' voltages, if these are read.
void ModbusDialogue::restart_piezos() {
  for (std::size_t axis = 0; axis < piezos_.size(); ++axis) {
    if (!piezos_[axis]) continue;
    if (config_.axes[axis].applied)
      piezos_[axis]->restart_at(shown_V_[axis]);
    else
      piezos_[axis]->restart();
  }
}

void ModbusDialogue::show_piezos() {
  for (std::size_t axis = 0; axis < piezos_.size(); ++axis) {
    if (!piezos_[axis] || !config_.axes[axis].applied) continue;
    piezos_[axis]->show(connection_.now(), shown_V_[axis]);
    state_.applied_um[first_[axis]] = piezos_[axis]->applied_um();
    if (piezos_[axis]->obeyed()) continue;
    const std::scoped_lock lock(health_mutex_);
    health_.last_error = "the amplifier of axis " + std::to_string(axis + 1) + " shows " +
                         std::to_string(shown_V_[axis]) + " V instead of its setpoint";
  }
}

std::array<double, axes_max> ModbusDialogue::judged_um() const noexcept {
  std::array<double, axes_max> applied_um = state_.applied_um;
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis)
    if (piezos_[axis] || written_[axis])
      for (std::size_t i = 0; i < config_.axes[axis].offsets(); ++i)
        applied_um[first_[axis] + i] = not_a_number;
  return applied_um;
}

void ModbusDialogue::publish(bool online) {
  state_.online = online;
  state_.written = gate_.written(connection_.now());
  state_.link_epoch = gate_.epoch();
  state_.read_back_number = gate_.read_back_number();
  states_.back() = state_;
  states_.publish();
}

/// A controller that answers reads but refuses writes stays online.
void ModbusDialogue::lose_by_write() {
  write_failed_ = true;
  write_taken_ = false;
  if (!connection_.connected() || ending_.load()) return lose(false);
  refused_ ? gate_.paused() : gate_.lost();
  if (!refused_) forget_written();
  publish(true);
}

void ModbusDialogue::lose(bool same_link) {
  if (same_link)
    gate_.paused();
  else
    gate_.lost();
  publish(false);
  const std::scoped_lock lock(health_mutex_);
  health_.connected = false;
}

}  // namespace thermocomp
