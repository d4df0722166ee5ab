#include "drivers/modbus/connection.hpp"

#include <algorithm>
#include <array>
#include <atomic>

#include <modbus/modbus.h>

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/modbus/late_answers.hpp"
#include "drivers/modbus/modbus_codec.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

using std::chrono::milliseconds;

constexpr int time_outs_of_dead_connection = 2;
constexpr int closings_of_a_habit = 3;
constexpr milliseconds silence_min{10};

constexpr std::uint8_t read_function(ModbusTable table) noexcept {
  switch (table) {
    case ModbusTable::coil:
      return MODBUS_FC_READ_COILS;
    case ModbusTable::discrete_input:
      return MODBUS_FC_READ_DISCRETE_INPUTS;
    case ModbusTable::holding:
    case ModbusTable::data_block:
      return MODBUS_FC_READ_HOLDING_REGISTERS;
    case ModbusTable::input:
      break;
  }
  return MODBUS_FC_READ_INPUT_REGISTERS;
}

/// Function and data of a request or an answer, without framing.
struct Pdu {
  std::array<std::uint8_t, MODBUS_MAX_PDU_LENGTH> bytes{};
  std::size_t size{0};

  void push(std::uint8_t byte) noexcept { bytes[size++] = byte; }
  void push_word(std::size_t word) noexcept {
    push(static_cast<std::uint8_t>((word >> 8) & 0xFF));
    push(static_cast<std::uint8_t>(word & 0xFF));
  }
  [[nodiscard]] std::span<const std::uint8_t> view() const noexcept { return {bytes.data(), size}; }
};

void unpack_bits(std::span<const std::uint8_t> data, std::span<std::uint16_t> words) noexcept {
  for (std::size_t i = 0; i < words.size(); ++i) {
    words[i] = static_cast<std::uint16_t>((data[i / 8] >> (i % 8)) & 1);
  }
}
void unpack_words(std::span<const std::uint8_t> data, std::span<std::uint16_t> words) noexcept {
  for (std::size_t i = 0; i < words.size(); ++i) words[i] = word_at(data, 2 * i);
}

/// Size of the PDU that answers a read.
constexpr std::size_t answer_bytes_of(ModbusTable table, std::size_t words) noexcept {
  return 2 + (is_bit_table(table) ? (words + 7) / 8 : 2 * words);
}

ModbusQuestion question_of(const Pdu& request, std::size_t answer_bytes) noexcept {
  return {request.bytes[0], word_at(request.view(), 1), answer_bytes};
}

/// "exception 2 (illegal data address)"
std::string exception_text(int code) {
  constexpr std::array names{"",
                             "illegal function",
                             "illegal data address",
                             "illegal data value",
                             "device failure",
                             "acknowledge",
                             "busy",
                             "",
                             "memory parity",
                             "",
                             "gateway has no path",
                             "gateway has no answer of the unit"};
  const bool is_known = code > 0 && static_cast<std::size_t>(code) < names.size();
  const std::string_view name = is_known ? names[static_cast<std::size_t>(code)] : "";
  return "exception " + std::to_string(code) + " (" +
         (name.empty() ? "not in the protocol" : std::string(name)) + ")";
}

}  // namespace

Fault Exchange::fault() const noexcept {
  switch (outcome) {
    case ExchangeOutcome::ok:
      return Fault::none;
    case ExchangeOutcome::bad_frame:
      return Fault::bad_frame;
    case ExchangeOutcome::exception:
      if (!unit_answered()) return Fault::no_answer;
      return exception_code == MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY ? Fault::device_busy
                                                                     : Fault::device_error;
    case ExchangeOutcome::timeout:
    case ExchangeOutcome::disconnected:
    case ExchangeOutcome::cancelled:
      break;
  }
  return Fault::no_answer;
}

bool Exchange::unit_answered() const noexcept {
  if (outcome == ExchangeOutcome::exception) {
    return exception_code != MODBUS_EXCEPTION_GATEWAY_PATH &&
           exception_code != MODBUS_EXCEPTION_GATEWAY_TARGET;
  }
  return ok();
}

class ModbusConnection::Implementation {
 public:
  Implementation(const ModbusLine& line, std::unique_ptr<ModbusPort> port);

  [[nodiscard]] ModbusPort& port() noexcept { return *port_; }
  bool connect();
  void disconnect() noexcept;
  [[nodiscard]] bool connected() const noexcept { return connected_; }
  [[nodiscard]] const std::string& last_error() const noexcept { return last_error_; }
  [[nodiscard]] std::uint64_t connects() const noexcept { return connects_; }
  [[nodiscard]] std::uint64_t links() const noexcept { return links_; }
  [[nodiscard]] std::uint64_t breaks() const noexcept { return links_ + closed_unexpectedly_; }
  [[nodiscard]] nanoseconds held() const noexcept { return held_; }
  void reset_silence() noexcept { silent_asked_ = 0; }
  void share() noexcept { shared_ = true; }
  [[nodiscard]] bool is_shared() const noexcept { return shared_; }
  void time_as(const ModbusLine& line) noexcept;
  [[nodiscard]] nanoseconds ready_at(int unit, const ModbusQuestion& question) const noexcept;

  /// One request and its answer, available as answer(). `answer_bytes`: size of the expected PDU.
  Exchange exchange(int unit, const Pdu& request, std::size_t answer_bytes);
  [[nodiscard]] std::span<const std::uint8_t> answer() const noexcept { return frames_.answer(); }
  Exchange write(int unit, const Pdu& request, std::size_t word);
  /// Rejects an answer with the right function but other content than requested.
  void reject(int unit, Exchange& exchange, const std::string& detail);

 private:
  bool open();
  bool open_anew();
  bool discard();
  Exchange try_once(int unit, const Pdu& request, std::size_t answer_bytes, nanoseconds deadline);
  void await_answer(nanoseconds deadline, Exchange& exchange);
  void judge_silence(Exchange& exchange) const;
  void take_exception(Exchange& exchange) const;
  void settle(int unit, Exchange& exchange);

  ModbusLine line_;
  bool serial_;    ///< a serial port: without a peer that opens or closes it
  bool rtu_;       ///< serial frames
  bool numbered_;  ///< answers carry their request's transaction id
  nanoseconds timeout_{0};
  nanoseconds gap_{0};
  std::unique_ptr<ModbusPort> port_;
  ModbusFrames frames_;
  bool connected_{false};
  std::uint64_t connects_{0};
  std::uint64_t links_{0};
  std::uint64_t closed_unexpectedly_{0};
  std::string last_error_;
  int answers_{0};   ///< on this connection
  int closings_{0};  ///< consecutive closings by the peer, each after one answer
  int time_outs_in_a_row_{0};
  nanoseconds line_free_at_{0};
  std::array<LateAnswers, 256> units_;
  ModbusQuestion question_;  ///< of the present exchange
  bool was_sent_{false};     ///< its request was sent
  bool in_step_{true};       ///< the start of the next frame is known
  int silent_unit_{-1};      ///< last unit without answer
  int silent_asked_{0};      ///< requests that a gateway may still be processing
  nanoseconds silent_since_{0};
  nanoseconds held_{0};
  std::atomic<bool> shared_{false};
};

ModbusConnection::Implementation::Implementation(const ModbusLine& line,
                                                 std::unique_ptr<ModbusPort> port)
    : line_(line),
      serial_(std::holds_alternative<ModbusRtu>(line.link)),
      rtu_(serial_ || std::get<ModbusTcp>(line.link).rtu_frames),
      numbered_(!rtu_ && !line.ignore_transaction),
      port_(std::move(port)),
      frames_(rtu_, numbered_) {
  time_as(line);
}

void ModbusConnection::Implementation::time_as(const ModbusLine& line) noexcept {
  timeout_ = from_seconds(line.timeout_ms * 1e-3);
  gap_ = inter_frame_delay(line);
}

nanoseconds ModbusConnection::Implementation::ready_at(
    int unit, const ModbusQuestion& question) const noexcept {
  if (numbered_ || unit < 0 || unit > 255) return nanoseconds{0};
  return units_[static_cast<std::size_t>(unit)].ready_at(question);
}

// ---- opening and closing

bool ModbusConnection::Implementation::connect() {
  if (connected_) return true;
  if (!open()) return false;
  ++links_;
  return true;
}

bool ModbusConnection::Implementation::open() {
  if (port_->cancelled()) {
    last_error_ = "cancelled";
    return false;
  }
  if (!port_->open(last_error_)) {
    closings_ = 0;
    return false;
  }
  connected_ = in_step_ = true;
  ++connects_;
  answers_ = 0;
  time_outs_in_a_row_ = 0;
  line_free_at_ = port_->now() + gap_;
  last_error_.clear();
  return true;
}

void ModbusConnection::Implementation::disconnect() noexcept {
  if (!connected_) return;
  connected_ = false;
  frames_.forget();
  port_->close();
}

bool ModbusConnection::Implementation::open_anew() {
  disconnect();
  return open();
}

// ---- one exchange

/// Discards bytes received before the request. @return false: line lost, or bytes keep coming
bool ModbusConnection::Implementation::discard() {
  constexpr int pieces_max = 64;
  for (int piece = 0; piece < pieces_max; ++piece) {
    if (!frames_.discard()) return false;
    const PortBytes came = port_->receive(frames_.room());
    if (came.kind == PortBytes::Kind::nothing) return true;
    if (came.kind == PortBytes::Kind::lost) return false;
    frames_.took(came.size);
  }
  return false;
}

/// Receives until the answer is complete or too late.
void ModbusConnection::Implementation::await_answer(nanoseconds deadline, Exchange& exchange) {
  constexpr milliseconds rest_max{700};
  constexpr milliseconds block{100};  // serial adapters deliver in blocks
  constexpr milliseconds full{50};
  // Limit for the rest of a frame that has begun.
  const nanoseconds rest = rtu_ ? block : std::min<nanoseconds>(timeout_, rest_max);
  const nanoseconds end = deadline + rest;
  nanoseconds until = deadline;
  bool is_over = false;  // unrelated bytes may arrive endlessly
  while (true) {
    const ModbusFrames::Found found = frames_.find();
    in_step_ = found != ModbusFrames::Found::no_frame;
    if (found == ModbusFrames::Found::answer) {
      exchange.arrived_at = port_->now();
      exchange.outcome = ExchangeOutcome::ok;
      return;
    }
    if (found != ModbusFrames::Found::nothing) {
      exchange.outcome = ExchangeOutcome::bad_frame;
      exchange.detail = frames_.unexpected_text();
      return;
    }
    if (is_over) return judge_silence(exchange);
    const PortWait wait = port_->wait_for_input(until);
    if (wait == PortWait::cancelled) {
      exchange.outcome = ExchangeOutcome::cancelled;
      return;
    }
    if (wait == PortWait::late) return judge_silence(exchange);
    const PortBytes came = port_->receive(frames_.room());
    if (came.kind == PortBytes::Kind::lost) {
      exchange.outcome = ExchangeOutcome::disconnected;
      exchange.detail = answers_ > 0 ? "the device closes the connection in place of an answer"
                                     : "the line was lost";
      return;
    }
    frames_.took(came.size);
    const nanoseconds now = port_->now();
    if (frames_.is_full())
      until = std::min(deadline, now + full);
    else if (frames_.has_part())
      until = std::min(end, std::max(deadline, now + rest));
    is_over = now >= until;
  }
}

void ModbusConnection::Implementation::judge_silence(Exchange& exchange) const {
  const std::string within =
      " within timeout_ms = " + std::to_string(std::chrono::round<milliseconds>(timeout_).count());
  const std::string unexpected = frames_.unexpected_text();
  // In TCP, bytes after the start of a frame cannot be distinguished from its rest.
  const bool is_silent =
      unexpected.empty() || (frames_.is_late_or_echo() && (rtu_ || !frames_.has_part()));
  exchange.outcome = is_silent ? ExchangeOutcome::timeout : ExchangeOutcome::bad_frame;
  exchange.detail = unexpected.empty()                 ? "no answer" + within
                    : frames_.has_part() && !is_silent ? unexpected + within
                                                       : unexpected + ", no answer" + within;
}

Exchange ModbusConnection::Implementation::try_once(int unit, const Pdu& request,
                                                    std::size_t answer_bytes,
                                                    nanoseconds deadline) {
  Exchange exchange;
  exchange.sent_at = port_->now();
  was_sent_ = false;
  if (!discard()) {
    exchange.detail = "the line was lost, or unrelated bytes keep arriving";
    return exchange;
  }
  const auto frame = frames_.request(unit, request.view(), answer_bytes);
  if (!port_->send(frame)) {
    exchange.detail = "the request could not be sent";
    return exchange;
  }
  was_sent_ = true;
  await_answer(deadline, exchange);
  return exchange;
}

Exchange ModbusConnection::Implementation::exchange(int unit, const Pdu& request,
                                                    std::size_t answer_bytes) {
  THERMOCOMP_ENSURE(unit >= (rtu_ ? 1 : 0) && unit <= 255);
  Exchange exchange;
  if (!connected_) {
    exchange.detail = "not connected";
    return exchange;
  }
  question_ = question_of(request, answer_bytes);
  if (!port_->pause_until(std::max(line_free_at_, ready_at(unit, question_)))) {
    exchange.outcome = ExchangeOutcome::cancelled;
    return exchange;
  }
  nanoseconds deadline =
      port_->now() + timeout_ + time_on_line(line_, answer_bytes < 8 ? 8 : answer_bytes);
  if (numbered_ && silent_asked_ > 0 && silent_unit_ != unit)
    deadline = std::max(deadline, silent_since_ + gateway_wait_max + timeout_);
  const auto opened_anew = [&] {
    if (open_anew()) return true;
    exchange.detail = last_error_;
    return false;
  };
  if (closings_ < closings_of_a_habit || answers_ == 0 || opened_anew()) {
    const bool has_answered = answers_ > 0;
    exchange = try_once(unit, request, answer_bytes, deadline);
    // A write may have taken effect: the caller must read before it writes again.
    const bool may_repeat = !was_sent_ || question_.function <= MODBUS_FC_READ_INPUT_REGISTERS;
    if (exchange.outcome == ExchangeOutcome::disconnected && has_answered && may_repeat) {
      closings_ = answers_ == 1 ? closings_ + 1 : 0;
      ++closed_unexpectedly_;
      if (opened_anew()) exchange = try_once(unit, request, answer_bytes, deadline);
    }
  }
  if (exchange.ok() && (answer()[0] & exception_bit) != 0) take_exception(exchange);
  settle(unit, exchange);
  return exchange;
}

void ModbusConnection::Implementation::take_exception(Exchange& exchange) const {
  if (answer().size() < 2 || answer()[1] == 0) {
    exchange.outcome = ExchangeOutcome::bad_frame;
    exchange.detail = "an exception without a code (" + hex_text(answer()) + ")";
    return;
  }
  exchange.outcome = ExchangeOutcome::exception;
  exchange.exception_code = answer()[1];
  exchange.detail = port_->refusal();
  if (exchange.detail.empty()) exchange.detail = exception_text(answer()[1]);
}

/// Effects of the result on later exchanges.
void ModbusConnection::Implementation::settle(int unit, Exchange& exchange) {
  LateAnswers& late = units_[static_cast<std::size_t>(unit)];
  const nanoseconds now = port_->now();
  line_free_at_ = now + gap_;
  switch (exchange.outcome) {
    case ExchangeOutcome::ok:
    case ExchangeOutcome::exception:
      ++answers_;
      late.answered(exchange.sent_at, exchange.arrived_at);
      time_outs_in_a_row_ = 0;
      if (silent_unit_ == unit) silent_asked_ = 0;
      if (silent_asked_ > 0) {
        const bool was_held = exchange.arrived_at - exchange.sent_at > timeout_;
        held_ = was_held ? exchange.arrived_at - silent_since_ : nanoseconds{0};
        silent_asked_ = was_held ? silent_asked_ - 1 : 0;
      }
      return;
    case ExchangeOutcome::timeout:
      late.unanswered(question_, exchange.sent_at, now);
      silent_unit_ = unit;
      ++silent_asked_;
      silent_since_ = exchange.sent_at;
      // The loss of a peer (power cut) is only detected by reconnecting.
      if (!serial_ && ++time_outs_in_a_row_ >= time_outs_of_dead_connection) disconnect();
      return;
    case ExchangeOutcome::bad_frame:
      // The rest of an incomplete answer may arrive as late as the answer.
      late.spoiled(question_, frames_.has_part() && !frames_.is_full() ? now : exchange.sent_at,
                   timeout_);
      if (rtu_) {
        // Drains the line until it is silent, within this limit.
        constexpr milliseconds drain_max{300};
        const nanoseconds silence = std::max<nanoseconds>(gap_, silence_min);
        while (port_->now() < now + drain_max && discard() &&
               port_->wait_for_input(port_->now() + silence) == PortWait::ready) {
        }
        line_free_at_ = port_->now();
      } else if (!in_step_ || frames_.has_part()) {
        disconnect();  // the start of the next frame is unknown
      }
      return;
    case ExchangeOutcome::disconnected:
    case ExchangeOutcome::cancelled:
      last_error_ = exchange.detail;
      disconnect();
      return;
  }
}

void ModbusConnection::Implementation::reject(int unit, Exchange& exchange,
                                              const std::string& detail) {
  exchange.outcome = ExchangeOutcome::bad_frame;
  exchange.detail = detail + " (" + hex_text(answer()) + ")";
  settle(unit, exchange);
}

// ---- public interface: requests, and checks of the answers

/// Writes; the answer repeats the address and this word.
Exchange ModbusConnection::Implementation::write(int unit, const Pdu& request, std::size_t word) {
  constexpr std::size_t answer_bytes = 5;
  Exchange written = exchange(unit, request, answer_bytes);
  if (!written.ok()) return written;
  const bool confirmed = answer().size() >= answer_bytes &&
                         word_at(answer(), 1) == word_at(request.view(), 1) &&
                         word_at(answer(), 3) == word;
  if (!confirmed) reject(unit, written, "the answer confirms another write");
  return written;
}

ModbusConnection::ModbusConnection(const ModbusLine& line)
    : ModbusConnection(line, (check_line(line), make_modbus_port(line))) {}
ModbusConnection::ModbusConnection(const ModbusLine& line, std::unique_ptr<ModbusPort> port)
    : implementation_(std::make_unique<Implementation>((check_line(line), line), std::move(port))) {
}
ModbusConnection::~ModbusConnection() = default;

bool ModbusConnection::connect() {
  return implementation_->connect();
}
void ModbusConnection::disconnect() noexcept {
  implementation_->disconnect();
}
bool ModbusConnection::connected() const noexcept {
  return implementation_->connected();
}
const std::string& ModbusConnection::last_error() const noexcept {
  return implementation_->last_error();
}
std::uint64_t ModbusConnection::connects() const noexcept {
  return implementation_->connects();
}
std::uint64_t ModbusConnection::links() const noexcept {
  return implementation_->links();
}
std::uint64_t ModbusConnection::breaks() const noexcept {
  return implementation_->breaks();
}
nanoseconds ModbusConnection::held() const noexcept {
  return implementation_->held();
}
void ModbusConnection::reset_silence() noexcept {
  implementation_->reset_silence();
}
void ModbusConnection::share() noexcept {
  implementation_->share();
}
bool ModbusConnection::is_shared() const noexcept {
  return implementation_->is_shared();
}
void ModbusConnection::time_as(const ModbusLine& line) noexcept {
  implementation_->time_as(line);
}
nanoseconds ModbusConnection::ready_at(int unit, ModbusTable table, std::uint16_t address,
                                       std::size_t words) const noexcept {
  return implementation_->ready_at(unit,
                                   {read_function(table), address, answer_bytes_of(table, words)});
}
bool ModbusConnection::pause_until(nanoseconds time) noexcept {
  return implementation_->port().pause_until(time);
}
void ModbusConnection::cancel() noexcept {
  implementation_->port().cancel();
}
bool ModbusConnection::cancelled() const noexcept {
  return implementation_->port().cancelled();
}
nanoseconds ModbusConnection::now() const noexcept {
  return implementation_->port().now();
}

Exchange ModbusConnection::read(int unit, ModbusTable table, std::uint16_t address,
                                std::span<std::uint16_t> words, bool wide) {
  const bool bits = is_bit_table(table);
  THERMOCOMP_ENSURE(!words.empty() && words.size() <= (bits ? 2000U : 125U));
  Pdu request;
  request.push(read_function(table));
  request.push_word(address);
  request.push_word(wide ? words.size() / 2 : words.size());
  const std::size_t answer_bytes = answer_bytes_of(table, words.size());
  Exchange exchange = implementation_->exchange(unit, request, answer_bytes);
  if (!exchange.ok()) return exchange;
  const auto answer = implementation_->answer();
  const std::size_t data_bytes = answer_bytes - 2;
  // Some gateways pad their frames.
  if (answer.size() < answer_bytes || answer[1] != data_bytes) {
    const std::size_t declared = answer.size() < 2 ? 0 : answer[1];
    const std::size_t came = declared == data_bytes ? answer.size() - 2 : declared;
    implementation_->reject(unit, exchange,
                            "expected " + std::to_string(data_bytes) + " bytes of data, got " +
                                std::to_string(came) +
                                (!bits && !wide && came == 2 * data_bytes
                                     ? ": if a register has 32 bits, wide_registers = true"
                                     : ""));
    return exchange;
  }
  if (bits) {
    unpack_bits(answer.subspan(2), words);
  } else {
    unpack_words(answer.subspan(2), words);
  }
  return exchange;
}

Exchange ModbusConnection::write_register(int unit, std::uint16_t address, std::uint16_t word) {
  Pdu request;
  request.push(MODBUS_FC_WRITE_SINGLE_REGISTER);
  request.push_word(address);
  request.push_word(word);
  return implementation_->write(unit, request, word);
}

Exchange ModbusConnection::write_registers(int unit, std::uint16_t address,
                                           std::span<const std::uint16_t> words) {
  THERMOCOMP_ENSURE(!words.empty() && words.size() <= 123);
  Pdu request;
  request.push(MODBUS_FC_WRITE_MULTIPLE_REGISTERS);
  request.push_word(address);
  request.push_word(words.size());
  request.push(static_cast<std::uint8_t>(2 * words.size()));
  for (const std::uint16_t word : words) request.push_word(word);
  return implementation_->write(unit, request, words.size());
}

}  // namespace thermocomp
