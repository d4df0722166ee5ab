#include "drivers/modbus/connection.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fcntl.h>
#include <optional>
#include <poll.h>
#include <unistd.h>
#include <vector>

#include <modbus/modbus.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/eventfd.h>
#include <sys/select.h>
#include <sys/socket.h>

#include "drivers/driver_error.hpp"
#include "drivers/modbus/late_answers.hpp"
#include "drivers/modbus/name_lookup.hpp"
#include "drivers/modbus/register_codec.hpp"
#include "drivers/monotonic_clock.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t frame_bytes_max = MODBUS_TCP_MAX_ADU_LENGTH;
constexpr std::size_t mbap_bytes = 7;  // transaction, protocol, length, unit
constexpr int time_outs_of_dead_connection = 2;
constexpr std::uint8_t exception_bit = 0x80;

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

enum class Wait { ready, late, cancelled };

struct ContextDeleter {
  void operator()(modbus_t* context) const noexcept { modbus_free(context); }
};
using Context = std::unique_ptr<modbus_t, ContextDeleter>;

timespec to_timespec(nanoseconds time) noexcept {
  const auto positive = std::max(time, nanoseconds{0});
  const auto whole = std::chrono::duration_cast<std::chrono::seconds>(positive);
  return {static_cast<time_t>(whole.count()), static_cast<long>((positive - whole).count())};
}

Context make_context(const ModbusLine& line) {
  modbus_t* context = nullptr;
  if (const auto* rtu = std::get_if<ModbusRtu>(&line.link)) {
    context =
        modbus_new_rtu(rtu->device.c_str(), rtu->baud, rtu->parity, rtu->data_bits, rtu->stop_bits);
  } else {
    // Only a carrier for framing: the socket is opened here, so that connecting can be bounded
    // and interrupted.
    context = modbus_new_tcp("127.0.0.1", std::get<ModbusTcp>(line.link).port);
  }
  if (context == nullptr) {
    throw DriverError(std::string("Modbus line: ") + modbus_strerror(errno));
  }
  modbus_set_error_recovery(context, MODBUS_ERROR_RECOVERY_NONE);
  modbus_set_byte_timeout(context, 0, 0);  // one time-out for the rest of a frame
  return Context(context);
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
  explicit Implementation(const ModbusLine& line);
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;
  ~Implementation();

  bool connect();
  void disconnect() noexcept;
  [[nodiscard]] bool connected() const noexcept { return connected_; }
  [[nodiscard]] const std::string& last_error() const noexcept { return last_error_; }
  [[nodiscard]] nanoseconds ready_at(int unit) const noexcept;
  bool pause_until(nanoseconds time) noexcept;
  void cancel() noexcept;
  [[nodiscard]] bool cancelled() const noexcept {
    return cancelled_.load(std::memory_order_acquire);
  }

  /// One request and its answer, which is left in answer_. `answer_bytes` is the size of the
  /// expected answer's PDU, for the time it takes on the line.
  Exchange exchange(int unit, const Pdu& request, std::size_t answer_bytes);
  [[nodiscard]] std::span<const std::uint8_t> answer() const noexcept { return answer_; }
  /// The answer was of the right function but not what was asked for.
  void reject(int unit, Exchange& exchange, const char* detail) noexcept;

 private:
  enum class Frame { ours, foreign, bad, lost };

  bool connect_tcp(const ModbusTcp& tcp);
  bool open_socket(const SocketAddress& address);
  bool connect_rtu(const ModbusRtu& rtu);
  bool fail(std::string why) noexcept;
  Wait wait_for(int fd, short events, nanoseconds deadline) noexcept;
  [[nodiscard]] bool tcp_frame_waits() const noexcept;
  int take_tcp_frame(nanoseconds deadline) noexcept;
  int take_serial_frame(nanoseconds rest) noexcept;
  [[nodiscard]] int line_fd() const noexcept { return modbus_get_socket(context_.get()); }

  bool send(int unit, const Pdu& request) noexcept;
  Frame receive(int unit, std::uint8_t function, std::size_t answer_bytes, const char*& detail);
  Frame classify_tcp(std::size_t size, int unit, const char*& detail) noexcept;
  Exchange await_answer(int unit, std::uint8_t function, std::size_t answer_bytes,
                        Exchange exchange);
  void settle(int unit, Exchange& exchange) noexcept;
  void drain() noexcept;

  ModbusLine line_;
  bool serial_;
  Context context_;
  nanoseconds timeout_;
  nanoseconds gap_;
  int wake_fd_;
  std::atomic<bool> cancelled_{false};
  bool connected_{false};
  std::string last_error_;
  std::unique_ptr<NameLookup> lookup_;
  std::uint16_t transaction_{0};
  int time_outs_in_a_row_{0};
  nanoseconds line_free_at_{0};
  std::array<LateAnswers, 256> units_;
  std::array<std::uint8_t, frame_bytes_max> frame_{};
  std::array<std::uint8_t, 2 * frame_bytes_max> stream_{};  ///< TCP: received, not yet taken
  std::size_t received_{0};                                 ///< bytes of stream_
  std::span<const std::uint8_t> answer_;
};

ModbusConnection::Implementation::Implementation(const ModbusLine& line)
    : line_((check_line(line), line)),
      serial_(std::holds_alternative<ModbusRtu>(line.link)),
      context_(make_context(line)),
      timeout_(from_seconds(line.timeout_ms * 1e-3)),
      gap_(inter_frame_delay(line)),
      wake_fd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (wake_fd_ < 0) throw DriverError(std::string("eventfd: ") + std::strerror(errno));
}

ModbusConnection::Implementation::~Implementation() {
  disconnect();
  ::close(wake_fd_);
}

void ModbusConnection::Implementation::cancel() noexcept {
  cancelled_.store(true, std::memory_order_release);
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(wake_fd_, &one, sizeof one);
}

/// Waits for `fd` (negative: for nothing but the time), cancel() or the deadline. Errors of the
/// descriptor count as ready: the following read or write names them.
Wait ModbusConnection::Implementation::wait_for(int fd, short events,
                                                nanoseconds deadline) noexcept {
  while (true) {
    if (cancelled()) return Wait::cancelled;
    std::array<pollfd, 2> waits{pollfd{wake_fd_, POLLIN, 0}, pollfd{fd, events, 0}};
    const timespec left = to_timespec(deadline - monotonic_now());
    const int count = ::ppoll(waits.data(), fd >= 0 ? 2 : 1, &left, nullptr);
    if (count > 0 && waits[0].revents != 0) return Wait::cancelled;
    if (count > 0) return Wait::ready;
    if (count == 0 && monotonic_now() >= deadline) return Wait::late;
    if (count < 0 && errno != EINTR) return Wait::late;
  }
}

bool ModbusConnection::Implementation::pause_until(nanoseconds time) noexcept {
  if (time <= monotonic_now()) return !cancelled();
  return wait_for(-1, 0, time) != Wait::cancelled;
}

nanoseconds ModbusConnection::Implementation::ready_at(int unit) const noexcept {
  if (!serial_ || unit < 0 || unit > 255) return nanoseconds{0};
  return units_[static_cast<std::size_t>(unit)].ready_at();
}

// ---- opening and closing

bool ModbusConnection::Implementation::fail(std::string why) noexcept {
  last_error_ = std::move(why);
  return false;
}

bool ModbusConnection::Implementation::connect() {
  if (connected_) return true;
  if (cancelled()) return fail("cancelled");
  const auto* rtu = std::get_if<ModbusRtu>(&line_.link);
  if (!(rtu != nullptr ? connect_rtu(*rtu) : connect_tcp(std::get<ModbusTcp>(line_.link)))) {
    return false;
  }
  if (line_fd() >= FD_SETSIZE) {  // libmodbus waits with select()
    modbus_close(context_.get());
    return fail("too many open files for libmodbus");
  }
  connected_ = true;
  time_outs_in_a_row_ = 0;
  line_free_at_ = monotonic_now() + gap_;
  last_error_.clear();
  return true;
}

bool ModbusConnection::Implementation::connect_rtu(const ModbusRtu& rtu) {
  if (modbus_connect(context_.get()) != 0) {
    const int error = errno;
    modbus_close(context_.get());
    return fail(rtu.device + ": " + std::strerror(error));
  }
  if (rtu.rs485 && modbus_rtu_set_serial_mode(context_.get(), MODBUS_RTU_RS485) != 0) {
    const int error = errno;
    modbus_close(context_.get());
    return fail(rtu.device +
                ": RS-485 mode is not supported by this port: " + std::strerror(error));
  }
  modbus_flush(context_.get());
  return true;
}

bool ModbusConnection::Implementation::connect_tcp(const ModbusTcp& tcp) {
  constexpr milliseconds name_service_max{2000};
  if (!lookup_) lookup_ = std::make_unique<NameLookup>(tcp.host, tcp.port);
  if (!lookup_->done()) {
    const Wait wait = wait_for(lookup_->done_fd(), POLLIN, monotonic_now() + name_service_max);
    if (wait != Wait::ready) return fail(tcp.host + ": the name service does not answer");
  }
  std::string error;
  const auto address = lookup_->result(error);
  lookup_.reset();  // names may move: asked anew for every connection
  return address ? open_socket(*address) : fail(std::move(error));
}

bool ModbusConnection::Implementation::open_socket(const SocketAddress& address) {
  const int fd = ::socket(address.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return fail(std::strerror(errno));
  const int on = 1;
  ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  int error = 0;
  const auto* target = reinterpret_cast<const sockaddr*>(&address.storage);
  if (::connect(fd, target, address.length) != 0) {
    error = errno;
    if (error == EINPROGRESS) {
      const Wait wait = wait_for(fd, POLLOUT, monotonic_now() + timeout_);
      socklen_t size = sizeof error;
      if (wait == Wait::ready) ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
      if (wait == Wait::late) error = ETIMEDOUT;
      if (wait == Wait::cancelled) error = ECANCELED;
    }
  }
  if (error != 0) {
    ::close(fd);
    return fail(std::strerror(error));
  }
  modbus_set_socket(context_.get(), fd);
  return true;
}

void ModbusConnection::Implementation::disconnect() noexcept {
  if (!connected_) return;
  connected_ = false;
  received_ = 0;
  // Bytes that cannot be sent any more would make close() of a serial port wait for them.
  if (serial_) modbus_flush(context_.get());
  modbus_close(context_.get());
}

// ---- one exchange

bool ModbusConnection::Implementation::send(int unit, const Pdu& request) noexcept {
  const auto unit_byte = static_cast<std::uint8_t>(unit);
  if (serial_) {
    std::array<std::uint8_t, MODBUS_MAX_PDU_LENGTH + 1> raw{};
    raw[0] = unit_byte;
    std::copy_n(request.bytes.begin(), request.size, raw.begin() + 1);
    modbus_set_slave(context_.get(), unit);
    modbus_flush(context_.get());  // whatever is there answers nothing that was asked
    return modbus_send_raw_request(context_.get(), raw.data(), static_cast<int>(request.size + 1)) >
           0;
  }
  // libmodbus sends raw requests with transaction 0 only, and late answers are told by it.
  ++transaction_;
  std::array<std::uint8_t, frame_bytes_max> adu{};
  const std::size_t following = request.size + 1;
  const std::array<std::uint8_t, mbap_bytes> head{
      high_byte(transaction_), low_byte(transaction_), 0,        0,
      high_byte(following),    low_byte(following),    unit_byte};
  std::copy(head.begin(), head.end(), adu.begin());
  std::copy_n(request.bytes.begin(), request.size, adu.begin() + mbap_bytes);
  const std::size_t size = mbap_bytes + request.size;
  return ::send(line_fd(), adu.data(), size, MSG_NOSIGNAL) == static_cast<ssize_t>(size);
}

ModbusConnection::Implementation::Frame ModbusConnection::Implementation::classify_tcp(
    std::size_t size, int unit, const char*& detail) noexcept {
  const std::span<const std::uint8_t> frame(frame_.data(), size);
  const bool well_formed = word_at(frame, 2) == 0 && word_at(frame, 4) + std::size_t{6} == size;
  if (!well_formed) {
    detail = "the answer's header does not fit it";
    return Frame::bad;
  }
  if (word_at(frame, 0) != transaction_) return Frame::foreign;  // late: of an earlier request
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

/// The next frame of the stream into frame_: read from the socket itself, because libmodbus reads
/// it in steps and each step is two system calls.
/// @return its size; -1 with errno
int ModbusConnection::Implementation::take_tcp_frame(nanoseconds deadline) noexcept {
  while (true) {
    if (received_ >= mbap_bytes) {
      const std::size_t size = word_at(std::span(stream_), 4) + std::size_t{6};
      if (size <= mbap_bytes || size > frame_.size()) {
        errno = EMBBADDATA;
        return -1;
      }
      if (received_ >= size) {
        std::copy_n(stream_.begin(), size, frame_.begin());
        std::copy(stream_.begin() + static_cast<std::ptrdiff_t>(size),
                  stream_.begin() + static_cast<std::ptrdiff_t>(received_), stream_.begin());
        received_ -= size;
        return static_cast<int>(size);
      }
    }
    const ssize_t count =
        ::recv(line_fd(), stream_.data() + received_, stream_.size() - received_, MSG_DONTWAIT);
    if (count > 0) {
      received_ += static_cast<std::size_t>(count);
      continue;
    }
    if (count == 0) errno = ECONNRESET;
    if (count < 0 && errno == EINTR) continue;
    if (count == 0 || errno != EAGAIN) return -1;
    const Wait wait = wait_for(line_fd(), POLLIN, deadline);
    if (wait == Wait::ready) continue;
    errno = wait == Wait::late ? ETIMEDOUT : ECANCELED;
    return -1;
  }
}

int ModbusConnection::Implementation::take_serial_frame(nanoseconds rest) noexcept {
  const auto rest_us = std::chrono::duration_cast<std::chrono::microseconds>(rest).count();
  modbus_set_response_timeout(context_.get(), static_cast<std::uint32_t>(rest_us / 1000000),
                              static_cast<std::uint32_t>(rest_us % 1000000));
  return modbus_receive_confirmation(context_.get(), frame_.data());
}

/// Takes one frame of which the first byte is there. Bounded by the time the rest may take.
ModbusConnection::Implementation::Frame ModbusConnection::Implementation::receive(
    int unit, std::uint8_t function, std::size_t answer_bytes, const char*& detail) {
  constexpr milliseconds allowance{100};  // serial adapters deliver in blocks
  constexpr milliseconds rest_max{700};   // so that stop() is prompt on the slowest lines too
  const nanoseconds rest =
      serial_ ? std::min<nanoseconds>(time_on_line(line_, answer_bytes + 3) + allowance, rest_max)
              : std::min<nanoseconds>(timeout_, rest_max);
  const int received = serial_ ? take_serial_frame(rest) : take_tcp_frame(monotonic_now() + rest);
  if (received < 0) {
    const int error = errno;
    if (error == EMBBADCRC) detail = "wrong checksum";
    if (error == EMBBADDATA) detail = "the answer is too long";
    if (error == ETIMEDOUT) detail = "the answer broke off";
    if (*detail != 0) return Frame::bad;
    detail = "the line was lost";
    return Frame::lost;
  }
  if (received == 0) return Frame::foreign;  // serial: a frame of another unit
  const auto size = static_cast<std::size_t>(received);
  if (!serial_) {
    const Frame frame = classify_tcp(size, unit, detail);
    if (frame != Frame::ours) return frame;
  } else {
    if (frame_[0] != static_cast<std::uint8_t>(unit)) return Frame::foreign;
    answer_ = std::span<const std::uint8_t>(frame_.data() + 1, size - 3);
  }
  const bool fits = answer_[0] == function || answer_[0] == (function | exception_bit);
  if (!fits) detail = "answer to another function";
  return fits ? Frame::ours : Frame::bad;
}

Exchange ModbusConnection::Implementation::await_answer(int unit, std::uint8_t function,
                                                        std::size_t answer_bytes,
                                                        Exchange exchange) {
  const nanoseconds deadline =
      monotonic_now() + timeout_ + time_on_line(line_, answer_bytes < 8 ? 8 : answer_bytes);
  bool foreign_seen = false;
  while (true) {
    const Wait wait = tcp_frame_waits() ? Wait::ready : wait_for(line_fd(), POLLIN, deadline);
    if (wait == Wait::cancelled) {
      exchange.outcome = ExchangeOutcome::cancelled;
      return exchange;
    }
    if (wait == Wait::late) break;
    exchange.detail = "";
    switch (receive(unit, function, answer_bytes, exchange.detail)) {
      case Frame::ours:
        exchange.arrived_at = monotonic_now();
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
    if (monotonic_now() >= deadline) break;
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
  if (!pause_until(std::max(line_free_at_, ready_at(unit)))) {
    exchange.outcome = ExchangeOutcome::cancelled;
    return exchange;
  }
  exchange.sent_at = monotonic_now();
  if (send(unit, request)) {
    exchange = await_answer(unit, request.bytes[0], answer_bytes, exchange);
  } else {
    exchange.detail = "the request could not be sent";
  }
  if (exchange.ok() && (answer_[0] & exception_bit) != 0) {
    exchange.outcome = ExchangeOutcome::exception;
    exchange.exception_code = answer_.size() > 1 ? answer_[1] : 0;
    exchange.detail = modbus_strerror(MODBUS_ENOBASE + exchange.exception_code);
  }
  settle(unit, exchange);
  return exchange;
}

/// What an exchange's end means for the ones to come.
void ModbusConnection::Implementation::settle(int unit, Exchange& exchange) noexcept {
  LateAnswers& late = units_[static_cast<std::size_t>(unit)];
  const nanoseconds now = monotonic_now();
  line_free_at_ = now + gap_;
  switch (exchange.outcome) {
    case ExchangeOutcome::ok:
    case ExchangeOutcome::exception:
      late.answered(exchange.sent_at, exchange.arrived_at);
      time_outs_in_a_row_ = 0;
      return;
    case ExchangeOutcome::timeout:
      late.unanswered(exchange.sent_at, now);
      // A peer that went without a word (power cut) is only found by connecting anew.
      if (!serial_ && ++time_outs_in_a_row_ >= time_outs_of_dead_connection) disconnect();
      return;
    case ExchangeOutcome::bad_frame:
      late.spoiled(exchange.sent_at, timeout_);
      if (serial_) {
        drain();
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

/// Serial: throws away what still comes until the line is silent; bounded.
void ModbusConnection::Implementation::drain() noexcept {
  constexpr milliseconds silence_min{10};
  constexpr milliseconds drain_max{300};
  const nanoseconds give_up_at = monotonic_now() + drain_max;
  const nanoseconds silence = std::max<nanoseconds>(gap_, silence_min);
  modbus_flush(context_.get());
  while (monotonic_now() < give_up_at) {
    if (wait_for(line_fd(), POLLIN, monotonic_now() + silence) != Wait::ready) break;
    std::array<std::uint8_t, 256> rubbish{};
    if (::read(line_fd(), rubbish.data(), rubbish.size()) <= 0) break;
  }
  line_free_at_ = monotonic_now();
}

void ModbusConnection::Implementation::reject(int unit, Exchange& exchange,
                                              const char* detail) noexcept {
  exchange.outcome = ExchangeOutcome::bad_frame;
  exchange.detail = detail;
  settle(unit, exchange);
}

// ---- the public face: what is asked, and whether the answer fits

ModbusConnection::ModbusConnection(const ModbusLine& line)
    : implementation_(std::make_unique<Implementation>(line)) {}
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
nanoseconds ModbusConnection::ready_at(int unit) const noexcept {
  return implementation_->ready_at(unit);
}
bool ModbusConnection::pause_until(nanoseconds time) noexcept {
  return implementation_->pause_until(time);
}
void ModbusConnection::cancel() noexcept {
  implementation_->cancel();
}
bool ModbusConnection::cancelled() const noexcept {
  return implementation_->cancelled();
}

Exchange ModbusConnection::read(int unit, ModbusTable table, std::uint16_t address,
                                std::span<std::uint16_t> words) {
  const bool bits = is_bit_table(table);
  THERMOCOMP_ENSURE(!words.empty() && words.size() <= (bits ? 2000U : 125U));
  Pdu request;
  request.push(read_function(table));
  request.push_word(address);
  request.push_word(words.size());
  const std::size_t data_bytes = bits ? (words.size() + 7) / 8 : 2 * words.size();
  Exchange exchange = implementation_->exchange(unit, request, data_bytes + 2);
  if (!exchange.ok()) return exchange;
  const auto answer = implementation_->answer();
  if (answer.size() != data_bytes + 2 || answer[1] != data_bytes) {
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

Exchange ModbusConnection::write_coil(int unit, std::uint16_t address, bool on) {
  Pdu request;
  request.push(MODBUS_FC_WRITE_SINGLE_COIL);
  request.push_word(address);
  request.push_word(on ? 0xFF00 : 0);
  Exchange exchange = implementation_->exchange(unit, request, 5);
  if (!exchange.ok()) return exchange;
  const auto answer = implementation_->answer();
  const bool confirmed =
      std::equal(answer.begin(), answer.end(), request.view().begin(), request.view().end());
  if (!confirmed) implementation_->reject(unit, exchange, "the answer confirms another write");
  return exchange;
}

}  // namespace thermocomp
