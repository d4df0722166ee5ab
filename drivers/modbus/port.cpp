#include "drivers/modbus/port.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <memory>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

#include <modbus/modbus.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t length{0};
};

/// Resolves a host name: a numeric address at once, a name in a thread of its own, which may
/// outlive this object (the name service cannot be interrupted).
class NameLookup {
 public:
  NameLookup(const std::string& host, int port);
  NameLookup(const NameLookup&) = delete;
  NameLookup& operator=(const NameLookup&) = delete;
  ~NameLookup();

  /// Readable when done() is true.
  [[nodiscard]] int done_fd() const noexcept;
  [[nodiscard]] bool done() const noexcept;
  /// @pre done()
  /// @return the addresses, the preferred one first; none: `error` is set
  [[nodiscard]] std::vector<SocketAddress> result(std::string& error) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

struct NameLookup::State {
  std::string host;
  std::string port;
  int done_fd{-1};
  std::atomic<bool> done{false};
  int error{EAI_AGAIN};
  std::vector<SocketAddress> addresses;

  State(std::string host_given, int port_given)
      : host(std::move(host_given)),
        port(std::to_string(port_given)),
        done_fd(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    if (done_fd >= 0) ::close(done_fd);
  }

  void look_up(int flags) {
    addrinfo hints{};
    hints.ai_family = AF_UNSPEC;
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = flags;
    addrinfo* found = nullptr;
    error = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
    if (error != 0) return;
    for (const addrinfo* at = found; at != nullptr; at = at->ai_next) {
      SocketAddress& address = addresses.emplace_back();
      std::memcpy(&address.storage, at->ai_addr, at->ai_addrlen);
      address.length = at->ai_addrlen;
    }
    ::freeaddrinfo(found);
  }

  void finish() noexcept {
    done.store(true, std::memory_order_release);
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(done_fd, &one, sizeof one);
  }
};

/// Starts a detached thread with all signals blocked and a small stack.
bool run_detached(void* (*body)(void*), void* argument) noexcept {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, 2 * BusThread::stack_bytes);
  pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  pthread_t thread;
  const int error = pthread_create(&thread, &attributes, body, argument);
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  pthread_attr_destroy(&attributes);
  return error == 0;
}

NameLookup::NameLookup(const std::string& host, int port)
    : state_(std::make_shared<State>(host, port)) {
  state_->look_up(AI_NUMERICHOST | AI_NUMERICSERV);
  if (state_->error == 0) {
    state_->finish();
    return;
  }
  auto* shared = new std::shared_ptr<State>(state_);
  const bool started = run_detached(
      [](void* argument) -> void* {
        const std::unique_ptr<std::shared_ptr<State>> state(
            static_cast<std::shared_ptr<State>*>(argument));
        (*state)->look_up(AI_NUMERICSERV);
        (*state)->finish();
        return nullptr;
      },
      shared);
  if (started) return;
  delete shared;
  state_->finish();
}

NameLookup::~NameLookup() = default;

int NameLookup::done_fd() const noexcept {
  return state_->done_fd;
}

bool NameLookup::done() const noexcept {
  return state_->done.load(std::memory_order_acquire);
}

std::vector<SocketAddress> NameLookup::result(std::string& error) const {
  THERMOCOMP_ENSURE(done());  // also synchronises with the other thread's result
  if (state_->error != 0) error = state_->host + ": " + ::gai_strerror(state_->error);
  return state_->addresses;
}

/// Waits for the first of a descriptor, a time and cancel().
class InterruptibleWait {
 public:
  /// @throws DriverError when the system has no more descriptors
  InterruptibleWait();
  InterruptibleWait(const InterruptibleWait&) = delete;
  InterruptibleWait& operator=(const InterruptibleWait&) = delete;
  ~InterruptibleWait();

  /// Waits for `events` of `fd` (negative: none), cancel() or the deadline. Errors of the
  /// descriptor count as ready: the following read or write returns them.
  PortWait wait_for(int fd, short events, nanoseconds deadline) noexcept;
  bool pause_until(nanoseconds time) noexcept;  ///< @return false when cancelled
  void cancel() noexcept;
  [[nodiscard]] bool cancelled() const noexcept {
    return cancelled_.load(std::memory_order_acquire);
  }

 private:
  int wake_fd_;
  std::atomic<bool> cancelled_{false};
};

timespec to_timespec(nanoseconds time) noexcept {
  const auto positive = std::max(time, nanoseconds{0});
  const auto whole = std::chrono::duration_cast<std::chrono::seconds>(positive);
  return {static_cast<time_t>(whole.count()), static_cast<long>((positive - whole).count())};
}

InterruptibleWait::InterruptibleWait() : wake_fd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (wake_fd_ < 0) throw DriverError(std::string("eventfd: ") + std::strerror(errno));
}

InterruptibleWait::~InterruptibleWait() {
  ::close(wake_fd_);
}

void InterruptibleWait::cancel() noexcept {
  cancelled_.store(true, std::memory_order_release);
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(wake_fd_, &one, sizeof one);
}

PortWait InterruptibleWait::wait_for(int fd, short events, nanoseconds deadline) noexcept {
  while (true) {
    if (cancelled()) return PortWait::cancelled;
    std::array<pollfd, 2> waits{pollfd{wake_fd_, POLLIN, 0}, pollfd{fd, events, 0}};
    const timespec left = to_timespec(deadline - monotonic_now());
    const int count = ::ppoll(waits.data(), fd >= 0 ? 2 : 1, &left, nullptr);
    if (count > 0 && waits[0].revents != 0) return PortWait::cancelled;
    if (count > 0) return PortWait::ready;
    if (count == 0 && monotonic_now() >= deadline) return PortWait::late;
    if (count < 0 && errno != EINTR) return PortWait::late;
  }
}

bool InterruptibleWait::pause_until(nanoseconds time) noexcept {
  if (time <= monotonic_now()) return !cancelled();
  return wait_for(-1, 0, time) != PortWait::cancelled;
}

/// Stream or datagram socket to a host and port.
class TcpPort final : public ModbusPort {
 public:
  /// @param connect_max  limit for connecting
  TcpPort(const ModbusTcp& tcp, nanoseconds connect_max) : tcp_(tcp), connect_max_(connect_max) {}
  ~TcpPort() override { close_socket(); }

  [[nodiscard]] nanoseconds now() const noexcept override;
  bool open(std::string& why) override;
  void close() noexcept override { close_socket(); }
  bool send(std::span<const std::uint8_t> bytes) noexcept override;
  PortWait wait_for_input(nanoseconds deadline) noexcept override;
  PortBytes receive(std::span<std::uint8_t> into) noexcept override;
  bool pause_until(nanoseconds time) noexcept override { return wait_.pause_until(time); }
  void cancel() noexcept override { wait_.cancel(); }
  [[nodiscard]] bool cancelled() const noexcept override { return wait_.cancelled(); }

 private:
  bool open_socket(const SocketAddress& address, std::string& why);
  void close_socket() noexcept;

  ModbusTcp tcp_;
  nanoseconds connect_max_;
  InterruptibleWait wait_;
  std::unique_ptr<NameLookup> lookup_;
  std::size_t address_{0};  ///< the host's address to connect to, counted on beyond the last one
  bool has_answered_{true};
  int fd_{-1};
};

nanoseconds TcpPort::now() const noexcept {
  return monotonic_now();
}

bool TcpPort::open(std::string& why) {
  constexpr std::chrono::milliseconds name_service_max{2000};
  if (!lookup_) lookup_ = std::make_unique<NameLookup>(tcp_.host, tcp_.port);
  if (!lookup_->done()) {
    const PortWait wait =
        wait_.wait_for(lookup_->done_fd(), POLLIN, monotonic_now() + name_service_max);
    if (wait != PortWait::ready) {
      why = tcp_.host + ": the name service does not answer";
      return false;
    }
  }
  const std::vector<SocketAddress> addresses = lookup_->result(why);
  lookup_.reset();  // resolved for every connection, since addresses may change
  if (addresses.empty()) return false;
  if (!std::exchange(has_answered_, false)) ++address_;  // a device may listen at only one
  return open_socket(addresses[address_ % addresses.size()], why);
}

bool TcpPort::open_socket(const SocketAddress& address, std::string& why) {
  const int type = tcp_.datagrams ? SOCK_DGRAM : SOCK_STREAM;
  const int fd = ::socket(address.storage.ss_family, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) {
    why = std::strerror(errno);
    return false;
  }
  const int on = 1;
  if (!tcp_.datagrams) ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  int error = 0;
  const auto* target = reinterpret_cast<const sockaddr*>(&address.storage);
  if (::connect(fd, target, address.length) != 0) {
    error = errno;
    if (error == EINPROGRESS) {
      const PortWait wait = wait_.wait_for(fd, POLLOUT, monotonic_now() + connect_max_);
      socklen_t size = sizeof error;
      if (wait == PortWait::ready) ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
      if (wait == PortWait::late) error = ETIMEDOUT;
      if (wait == PortWait::cancelled) error = ECANCELED;
    }
  }
  if (error != 0) {
    ::close(fd);
    why = std::strerror(error);
    return false;
  }
  fd_ = fd;
  return true;
}

void TcpPort::close_socket() noexcept {
  if (fd_ < 0) return;
  ::shutdown(fd_, SHUT_RDWR);
  ::close(fd_);
  fd_ = -1;
}

bool TcpPort::send(std::span<const std::uint8_t> bytes) noexcept {
  return ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
         static_cast<ssize_t>(bytes.size());
}

PortWait TcpPort::wait_for_input(nanoseconds deadline) noexcept {
  return wait_.wait_for(fd_, POLLIN, deadline);
}

PortBytes TcpPort::receive(std::span<std::uint8_t> into) noexcept {
  while (true) {
    const ssize_t count = ::recv(fd_, into.data(), into.size(), MSG_DONTWAIT);
    if (count > 0) {
      has_answered_ = true;
      return {PortBytes::Kind::bytes, static_cast<std::size_t>(count)};
    }
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno == EAGAIN) return {PortBytes::Kind::nothing};
    return {PortBytes::Kind::lost};
  }
}

/// Serial port, opened and configured by libmodbus.
class RtuPort final : public ModbusPort {
 public:
  /// @throws DriverError when libmodbus refuses the line
  explicit RtuPort(const ModbusRtu& rtu);
  ~RtuPort() override { close_device(); }

  [[nodiscard]] nanoseconds now() const noexcept override;
  bool open(std::string& why) override;
  void close() noexcept override { close_device(); }
  bool send(std::span<const std::uint8_t> bytes) noexcept override;
  PortWait wait_for_input(nanoseconds deadline) noexcept override;
  PortBytes receive(std::span<std::uint8_t> into) noexcept override;
  bool pause_until(nanoseconds time) noexcept override { return wait_.pause_until(time); }
  void cancel() noexcept override { wait_.cancel(); }
  [[nodiscard]] bool cancelled() const noexcept override { return wait_.cancelled(); }

 private:
  struct ContextDeleter {
    void operator()(modbus_t* context) const noexcept { modbus_free(context); }
  };

  [[nodiscard]] int fd() const noexcept { return modbus_get_socket(context_.get()); }
  void close_device() noexcept;

  ModbusRtu rtu_;
  InterruptibleWait wait_;
  std::unique_ptr<modbus_t, ContextDeleter> context_;
  bool open_{false};
};

RtuPort::RtuPort(const ModbusRtu& rtu)
    : rtu_(rtu),
      context_(
          modbus_new_rtu(rtu.device.c_str(), rtu.baud, rtu.parity, rtu.data_bits, rtu.stop_bits)) {
  if (!context_) throw DriverError(std::string("Modbus line: ") + modbus_strerror(errno));
}

nanoseconds RtuPort::now() const noexcept {
  return monotonic_now();
}

bool RtuPort::open(std::string& why) {
  if (modbus_connect(context_.get()) != 0) {
    why = rtu_.device + ": " + std::strerror(errno);
    modbus_close(context_.get());
    return false;
  }
  if (rtu_.rs485 && modbus_rtu_set_serial_mode(context_.get(), MODBUS_RTU_RS485) != 0) {
    why = rtu_.device + ": RS-485 mode is not supported by this port: " + std::strerror(errno);
    modbus_close(context_.get());
    return false;
  }
  modbus_flush(context_.get());
  open_ = true;
  return true;
}

void RtuPort::close_device() noexcept {
  if (!open_) return;
  open_ = false;
  // close() of a serial port would wait for bytes that can no longer be sent.
  modbus_flush(context_.get());
  modbus_close(context_.get());
}

bool RtuPort::send(std::span<const std::uint8_t> bytes) noexcept {
  return ::write(fd(), bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size());
}

PortWait RtuPort::wait_for_input(nanoseconds deadline) noexcept {
  return wait_.wait_for(fd(), POLLIN, deadline);
}

PortBytes RtuPort::receive(std::span<std::uint8_t> into) noexcept {
  const ssize_t count = ::read(fd(), into.data(), into.size());
  if (count > 0) return {PortBytes::Kind::bytes, static_cast<std::size_t>(count)};
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return {PortBytes::Kind::nothing};
  if (count < 0) return {PortBytes::Kind::lost};
  // 0: no data, or the port is gone.
  pollfd port{fd(), POLLIN, 0};
  const timespec at_once{};
  const bool is_gone = ::ppoll(&port, 1, &at_once, nullptr) > 0 && (port.revents & ~POLLIN) != 0;
  return {is_gone ? PortBytes::Kind::lost : PortBytes::Kind::nothing};
}

}  // namespace

std::unique_ptr<ModbusPort> make_modbus_port(const ModbusLine& line) {
  if (const auto* rtu = std::get_if<ModbusRtu>(&line.link)) return std::make_unique<RtuPort>(*rtu);
  const auto& tcp = std::get<ModbusTcp>(line.link);
  const nanoseconds timeout = from_seconds(line.timeout_ms * 1e-3);
  auto port = std::make_unique<TcpPort>(tcp, timeout);
  if (!tcp.s7) return port;
  return make_s7_port(*tcp.s7, std::move(port), timeout);
}

}  // namespace thermocomp
