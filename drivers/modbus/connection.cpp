#include "drivers/modbus/connection.hpp"

#include <algorithm>
#include <array>

#include <modbus/modbus.h>

#include "drivers/driver_error.hpp"
#include "drivers/modbus/late_answers.hpp"
#include "drivers/modbus/register_codec.hpp"
#include "drivers/modbus/rtu_port.hpp"
#include "drivers/modbus/tcp_port.hpp"
#include "drivers/monotonic_clock.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t frame_bytes_max = MODBUS_TCP_MAX_ADU_LENGTH;
constexpr std::size_t mbap_bytes = 7;  // transaction, protocol, length, unit
constexpr int time_outs_of_dead_connection = 2;
constexpr std::uint8_t exception_bit = 0x80;
constexpr milliseconds silence_min{10};

constexpr std::uint8_t high_byte(std::size_t word) noexcept {
  return static_cast<std::uint8_t>((word >> 8) & 0xFF);
}
constexpr std::uint8_t low_byte(std::size_t word) noexcept {
  return static_cast<std::uint8_t>(word & 0xFF);
}
constexpr std::uint16_t word_at(std::span<const std::uint8_t> bytes, std::size_t at) noexcept {
  return static_cast<std::uint16_t>((bytes[at] << 8) | bytes[at + 1]);
}

constexpr std::uint8_t read_function(ModbusTable table) noexcept {
  switch (table) {
    case ModbusTable::coil:
      return MODBUS_FC_READ_COILS;
    case ModbusTable::discrete_input:
      return MODBUS_FC_READ_DISCRETE_INPUTS;
    case ModbusTable::holding:
      return MODBUS_FC_READ_HOLDING_REGISTERS;
    case ModbusTable::input:
      break;
  }
  return MODBUS_FC_READ_INPUT_REGISTERS;
}

/// Function and data of a request or an answer, without what the line puts around it.
struct Pdu {
  std::array<std::uint8_t, MODBUS_MAX_PDU_LENGTH> bytes{};
  std::size_t size{0};

  void push(std::uint8_t byte) noexcept { bytes[size++] = byte; }
  void push_word(std::size_t word) noexcept {
    push(high_byte(word));
    push(low_byte(word));
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

/// Bytes of the PDU that answers a read.
constexpr std::size_t answer_bytes_of(ModbusTable table, std::size_t words) noexcept {
  return 2 + (is_bit_table(table) ? (words + 7) / 8 : 2 * words);
}

ModbusQuestion question_of(const Pdu& request, std::size_t answer_bytes) noexcept {
  return {request.bytes[0], word_at(request.view(), 1), answer_bytes};
}

/// Static text. Beyond the protocol's own codes libmodbus would name errors of its own, or hand out
/// a buffer that its next call overwrites.
const char* exception_text(int code) noexcept {
  constexpr int not_defined = 9;
  const bool is_known = code >= 1 && code <= MODBUS_EXCEPTION_GATEWAY_TARGET && code != not_defined;
  return is_known ? modbus_strerror(MODBUS_ENOBASE + code)
                  : "an exception that the protocol does not know";
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
  [[nodiscard]] nanoseconds ready_at(int unit, const ModbusQuestion& question) const noexcept;

  /// One request and its answer, which is left in answer_. `answer_bytes` is the size of the
  /// expected answer's PDU, for the time it takes on the line.
  Exchange exchange(int unit, const Pdu& request, std::size_t answer_bytes);
  [[nodiscard]] std::span<const std::uint8_t> answer() const noexcept { return answer_; }
  /// The answer was of the right function but not what was asked for.
  void reject(int unit, Exchange& exchange, const char* detail) noexcept;

 private:
  enum class Frame { ours, foreign, bad, lost };

  [[nodiscard]] bool tcp_frame_waits() const noexcept;
  bool drain_stream() noexcept;
  bool take_from_stream() noexcept;
  PortBytes take_tcp_frame(nanoseconds deadline) noexcept;
  bool send(int unit, const Pdu& request) noexcept;
  Frame receive(int unit, std::uint8_t function, std::size_t answer_bytes, const char*& detail);
  Frame classify_tcp(std::size_t size, int unit, const char*& detail) noexcept;
  Exchange await_answer(int unit, std::uint8_t function, std::size_t answer_bytes,
                        Exchange exchange);
  void take_exception(Exchange& exchange) const noexcept;
  void settle(int unit, Exchange& exchange) noexcept;

  ModbusLine line_;
  bool serial_;
  nanoseconds timeout_;
  nanoseconds gap_;
  std::unique_ptr<ModbusPort> port_;
  bool connected_{false};
  std::string last_error_;
  std::uint16_t transaction_{0};
  int time_outs_in_a_row_{0};
  nanoseconds line_free_at_{0};
  std::array<LateAnswers, 256> units_;
  ModbusQuestion question_;  ///< of the exchange under way
  std::array<std::uint8_t, frame_bytes_max> frame_{};
  std::array<std::uint8_t, 2 * frame_bytes_max> stream_{};  ///< TCP: received, not yet taken
  std::size_t received_{0};                                 ///< bytes of stream_
  std::size_t unasked_{0};   ///< ... at its front that were there before the request was sent
  bool was_unasked_{false};  ///< the frame taken last began with such
  std::span<const std::uint8_t> answer_;
};

ModbusConnection::Implementation::Implementation(const ModbusLine& line,
                                                 std::unique_ptr<ModbusPort> port)
    : line_(line),
      serial_(std::holds_alternative<ModbusRtu>(line.link)),
      timeout_(from_seconds(line.timeout_ms * 1e-3)),
      gap_(inter_frame_delay(line)),
      port_(std::move(port)) {}

nanoseconds ModbusConnection::Implementation::ready_at(
    int unit, const ModbusQuestion& question) const noexcept {
  if (!serial_ || unit < 0 || unit > 255) return nanoseconds{0};
  return units_[static_cast<std::size_t>(unit)].ready_at(question);
}

// ---- opening and closing

bool ModbusConnection::Implementation::connect() {
  if (connected_) return true;
  if (port_->cancelled()) {
    last_error_ = "cancelled";
    return false;
  }
  if (!port_->open(last_error_)) return false;
  connected_ = true;
  time_outs_in_a_row_ = 0;
  line_free_at_ = port_->now() + gap_;
  last_error_.clear();
  return true;
}

void ModbusConnection::Implementation::disconnect() noexcept {
  if (!connected_) return;
  connected_ = false;
  received_ = 0;
  unasked_ = 0;
  port_->close();
}

// ---- one exchange

bool ModbusConnection::Implementation::send(int unit, const Pdu& request) noexcept {
  const auto unit_byte = static_cast<std::uint8_t>(unit);
  std::array<std::uint8_t, frame_bytes_max> frame{};
  if (serial_) {
    frame[0] = unit_byte;
    std::copy_n(request.bytes.begin(), request.size, frame.begin() + 1);
    return port_->send({frame.data(), request.size + 1});
  }
  ++transaction_;
  const std::size_t following = request.size + 1;
  const std::array<std::uint8_t, mbap_bytes> head{
      high_byte(transaction_), low_byte(transaction_), 0,        0,
      high_byte(following),    low_byte(following),    unit_byte};
  std::copy(head.begin(), head.end(), frame.begin());
  std::copy_n(request.bytes.begin(), request.size, frame.begin() + mbap_bytes);
  return port_->send({frame.data(), mbap_bytes + request.size});
}

ModbusConnection::Implementation::Frame ModbusConnection::Implementation::classify_tcp(
    std::size_t size, int unit, const char*& detail) noexcept {
  const std::span<const std::uint8_t> frame(frame_.data(), size);
  const bool well_formed = word_at(frame, 2) == 0 && word_at(frame, 4) + std::size_t{6} == size;
  if (!well_formed) {
    detail = "the answer's header does not fit it";
    return Frame::bad;
  }
  // Late: of an earlier request. Or early: who guesses the next number has answered nothing.
  if (was_unasked_ || word_at(frame, 0) != transaction_) return Frame::foreign;
  if (frame[6] != static_cast<std::uint8_t>(unit)) {
    detail = "another unit answered";
    return Frame::bad;
  }
  answer_ = frame.subspan(mbap_bytes);
  return Frame::ours;
}

bool ModbusConnection::Implementation::tcp_frame_waits() const noexcept {
  return received_ >= mbap_bytes && received_ >= word_at(std::span(stream_), 4) + std::size_t{6};
}

/// Takes a whole frame off the front of the stream, into frame_. @return whether there was one
bool ModbusConnection::Implementation::take_from_stream() noexcept {
  if (!tcp_frame_waits()) return false;
  const std::size_t size = word_at(std::span(stream_), 4) + std::size_t{6};
  if (size <= mbap_bytes || size > frame_.size()) return false;
  std::copy_n(stream_.begin(), size, frame_.begin());
  std::copy(stream_.begin() + static_cast<std::ptrdiff_t>(size),
            stream_.begin() + static_cast<std::ptrdiff_t>(received_), stream_.begin());
  received_ -= size;
  was_unasked_ = unasked_ > 0;
  unasked_ -= std::min(unasked_, size);
  return true;
}

/// What came before the question is no answer to it: whole frames go, the beginning of one is
/// remembered. @return false when the line is lost or the peer does not stop
bool ModbusConnection::Implementation::drain_stream() noexcept {
  constexpr int pieces_max = 64;
  for (int piece = 0; piece < pieces_max; ++piece) {
    while (take_from_stream()) {
    }
    const PortBytes came = port_->receive(std::span(stream_).subspan(received_), {});
    if (came.kind == PortBytes::Kind::nothing) {
      unasked_ = received_;
      return true;
    }
    if (came.kind != PortBytes::Kind::bytes) return false;
    received_ += came.size;
    if (received_ == stream_.size() && !tcp_frame_waits()) return false;
  }
  return false;
}

/// The next frame of the stream into frame_, with what comes until `deadline`.
PortBytes ModbusConnection::Implementation::take_tcp_frame(nanoseconds deadline) noexcept {
  while (true) {
    if (received_ >= mbap_bytes) {
      const std::size_t size = word_at(std::span(stream_), 4) + std::size_t{6};
      if (size <= mbap_bytes || size > frame_.size()) return {PortBytes::Kind::too_long};
      if (take_from_stream()) return {PortBytes::Kind::bytes, size};
    }
    const PortBytes came = port_->receive(std::span(stream_).subspan(received_), {});
    if (came.kind == PortBytes::Kind::bytes) {
      received_ += came.size;
      continue;
    }
    if (came.kind != PortBytes::Kind::nothing) return came;
    const PortWait wait = port_->wait_for_input(deadline);
    if (wait == PortWait::late) return {PortBytes::Kind::broke_off};
    if (wait == PortWait::cancelled) return {PortBytes::Kind::lost};
  }
}

/// Takes one frame of which the first byte is there. Bounded by the time the rest may take.
ModbusConnection::Implementation::Frame ModbusConnection::Implementation::receive(
    int unit, std::uint8_t function, std::size_t answer_bytes, const char*& detail) {
  constexpr milliseconds allowance{100};  // serial adapters deliver in blocks
  constexpr milliseconds rest_max{700};   // so that stop() is prompt on the slowest lines too
  const nanoseconds rest =
      serial_ ? std::min<nanoseconds>(time_on_line(line_, answer_bytes + 3) + allowance, rest_max)
              : std::min<nanoseconds>(timeout_, rest_max);
  const PortBytes came =
      serial_ ? port_->receive(frame_, rest) : take_tcp_frame(port_->now() + rest);
  switch (came.kind) {
    case PortBytes::Kind::bytes:
      break;
    case PortBytes::Kind::nothing:
      return Frame::foreign;
    case PortBytes::Kind::wrong_checksum:
      detail = "wrong checksum";
      return Frame::bad;
    case PortBytes::Kind::too_long:
      detail = "the answer is too long";
      return Frame::bad;
    case PortBytes::Kind::broke_off:
      detail = "the answer broke off";
      return Frame::bad;
    case PortBytes::Kind::lost:
      detail = "the line was lost";
      return Frame::lost;
  }
  const std::size_t size = came.size;
  if (!serial_) {
    const Frame frame = classify_tcp(size, unit, detail);
    if (frame != Frame::ours) return frame;
  } else {
    if (frame_[0] != static_cast<std::uint8_t>(unit)) return Frame::foreign;
    answer_ = std::span<const std::uint8_t>(frame_.data() + 1, size - 1);
  }
  if (answer_.empty()) {
    detail = "the answer is empty";
    return Frame::bad;
  }
  const bool fits = answer_[0] == function || answer_[0] == (function | exception_bit);
  if (!fits) detail = "answer to another function";
  return fits ? Frame::ours : Frame::bad;
}

Exchange ModbusConnection::Implementation::await_answer(int unit, std::uint8_t function,
                                                        std::size_t answer_bytes,
                                                        Exchange exchange) {
  const nanoseconds deadline =
      port_->now() + timeout_ + time_on_line(line_, answer_bytes < 8 ? 8 : answer_bytes);
  bool foreign_seen = false;
  while (true) {
    const PortWait wait = tcp_frame_waits() ? PortWait::ready : port_->wait_for_input(deadline);
    if (wait == PortWait::cancelled) {
      exchange.outcome = ExchangeOutcome::cancelled;
      return exchange;
    }
    if (wait == PortWait::late) break;
    exchange.detail = "";
    switch (receive(unit, function, answer_bytes, exchange.detail)) {
      case Frame::ours:
        exchange.arrived_at = port_->now();
        exchange.outcome = ExchangeOutcome::ok;
        return exchange;
      case Frame::bad:
        exchange.outcome = ExchangeOutcome::bad_frame;
        return exchange;
      case Frame::lost:
        exchange.outcome = ExchangeOutcome::disconnected;
        return exchange;
      case Frame::foreign:
        foreign_seen = true;
        break;
    }
    if (port_->now() >= deadline) break;
  }
  const bool noise = foreign_seen && serial_;
  exchange.outcome = noise ? ExchangeOutcome::bad_frame : ExchangeOutcome::timeout;
  exchange.detail = noise ? "only frames of other units came" : "no answer in time";
  return exchange;
}

Exchange ModbusConnection::Implementation::exchange(int unit, const Pdu& request,
                                                    std::size_t answer_bytes) {
  THERMOCOMP_ENSURE(unit >= (serial_ ? 1 : 0) && unit <= 255);
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
  exchange.sent_at = port_->now();
  if (!serial_ && !drain_stream()) {
    exchange.detail = "the line was lost, or bytes come without end that answer nothing";
  } else if (send(unit, request)) {
    exchange = await_answer(unit, request.bytes[0], answer_bytes, exchange);
  } else {
    exchange.detail = "the request could not be sent";
  }
  if (exchange.ok() && (answer_[0] & exception_bit) != 0) take_exception(exchange);
  settle(unit, exchange);
  return exchange;
}

void ModbusConnection::Implementation::take_exception(Exchange& exchange) const noexcept {
  if (answer_.size() != 2 || answer_[1] == 0) {
    exchange.outcome = ExchangeOutcome::bad_frame;
    exchange.detail = "an exception without a code";
    return;
  }
  exchange.outcome = ExchangeOutcome::exception;
  exchange.exception_code = answer_[1];
  exchange.detail = exception_text(answer_[1]);
}

/// What an exchange's end means for the ones to come.
void ModbusConnection::Implementation::settle(int unit, Exchange& exchange) noexcept {
  LateAnswers& late = units_[static_cast<std::size_t>(unit)];
  const nanoseconds now = port_->now();
  line_free_at_ = now + gap_;
  switch (exchange.outcome) {
    case ExchangeOutcome::ok:
    case ExchangeOutcome::exception:
      late.answered(exchange.sent_at, exchange.arrived_at);
      time_outs_in_a_row_ = 0;
      return;
    case ExchangeOutcome::timeout:
      late.unanswered(question_, exchange.sent_at, now);
      // A peer that went without a word (power cut) is only found by connecting anew.
      if (!serial_ && ++time_outs_in_a_row_ >= time_outs_of_dead_connection) disconnect();
      return;
    case ExchangeOutcome::bad_frame:
      late.spoiled(question_, exchange.sent_at, timeout_);
      if (serial_) {
        port_->drain(std::max<nanoseconds>(gap_, silence_min));
        line_free_at_ = port_->now();
      } else {
        disconnect();  // where the next frame of the stream begins is not known any more
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
                                              const char* detail) noexcept {
  exchange.outcome = ExchangeOutcome::bad_frame;
  exchange.detail = detail;
  settle(unit, exchange);
}

// ---- the public face: what is asked, and whether the answer fits

std::unique_ptr<ModbusPort> make_modbus_port(const ModbusLine& line) {
  if (const auto* rtu = std::get_if<ModbusRtu>(&line.link)) return std::make_unique<RtuPort>(*rtu);
  return std::make_unique<TcpPort>(std::get<ModbusTcp>(line.link),
                                   from_seconds(line.timeout_ms * 1e-3));
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
                                std::span<std::uint16_t> words) {
  const bool bits = is_bit_table(table);
  THERMOCOMP_ENSURE(!words.empty() && words.size() <= (bits ? 2000U : 125U));
  Pdu request;
  request.push(read_function(table));
  request.push_word(address);
  request.push_word(words.size());
  const std::size_t answer_bytes = answer_bytes_of(table, words.size());
  Exchange exchange = implementation_->exchange(unit, request, answer_bytes);
  if (!exchange.ok()) return exchange;
  const auto answer = implementation_->answer();
  if (answer.size() != answer_bytes || answer[1] + std::size_t{2} != answer_bytes) {
    implementation_->reject(unit, exchange, "the answer has the wrong length");
    return exchange;
  }
  if (bits) {
    unpack_bits(answer.subspan(2), words);
  } else {
    unpack_words(answer.subspan(2), words);
  }
  return exchange;
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
  Exchange exchange = implementation_->exchange(unit, request, 5);
  if (!exchange.ok()) return exchange;
  const auto answer = implementation_->answer();
  const bool confirmed =
      answer.size() == 5 && word_at(answer, 1) == address && word_at(answer, 3) == words.size();
  if (!confirmed) implementation_->reject(unit, exchange, "the answer confirms another write");
  return exchange;
}

}  // namespace thermocomp
