#include "simulator/devices/modbus_servers.hpp"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <stdexcept>
#include <termios.h>
#include <unistd.h>

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

namespace thermocomp {
namespace {

constexpr std::size_t unsent_bytes_max = 262144;

nanoseconds from_ms(double ms) {
  return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double, std::milli>(ms));
}

int port_of(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  if (::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  if (address.ss_family == AF_INET6) {
    sockaddr_in6 six{};
    std::memcpy(&six, &address, sizeof six);
    return ntohs(six.sin6_port);
  }
  sockaddr_in four{};
  std::memcpy(&four, &address, sizeof four);
  return ntohs(four.sin_port);
}

/// @return a listening socket, or -1 with errno
int try_listen(const addrinfo& address) {
  const int file = ::socket(address.ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (file < 0) return -1;
  const int on = 1;
  ::setsockopt(file, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (::bind(file, address.ai_addr, address.ai_addrlen) == 0 && ::listen(file, 64) == 0) {
    return file;
  }
  const int error = errno;
  ::close(file);
  errno = error;
  return -1;
}

}  // namespace

struct ModbusTcpServer::Client {
  int file;
  std::vector<std::uint8_t> received;
  std::vector<std::uint8_t> unsent;
};

ModbusTcpServer::ModbusTcpServer(EventLoop& loop, const std::string& host, int port,
                                 ModbusAnswerer answerer)
    : loop_(loop), host_(host), answerer_(std::move(answerer)) {
  listen_at(port);
}

ModbusTcpServer::~ModbusTcpServer() {
  switch_off();
}

void ModbusTcpServer::listen_at(int port) {
  const auto what = host_ + ":" + std::to_string(port);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(host_.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (error != 0) {
    throw std::runtime_error("cannot listen at " + what + ": " + ::gai_strerror(error));
  }
  for (const addrinfo* each = found; each != nullptr && listener_ < 0; each = each->ai_next) {
    listener_ = try_listen(*each);
  }
  const int reason = errno;
  ::freeaddrinfo(found);
  if (listener_ < 0) {
    throw std::runtime_error("cannot listen at " + what + ": " + std::strerror(reason));
  }
  port_ = port_of(listener_);
  loop_.watch(listener_, POLLIN, [this](short) { accept_client(); });
}

void ModbusTcpServer::accept_client() {
  const int file = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (file < 0) return;
  if (clients_.size() >= clients_max) {
    ::close(file);
    return;
  }
  const int on = 1;
  ::setsockopt(file, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  auto client = std::make_shared<Client>(Client{file, {}, {}});
  clients_[file] = client;
  loop_.watch(file, POLLIN, [this, client](short happened) { client_ready(client, happened); });
}

void ModbusTcpServer::client_ready(const std::shared_ptr<Client>& client, short happened) {
  if ((happened & POLLOUT) != 0) flush(client);
  if (client->file >= 0 && (happened & ~POLLOUT) != 0) read_requests(client);
}

void ModbusTcpServer::read_requests(const std::shared_ptr<Client>& client) {
  std::array<std::uint8_t, 4096> buffer{};
  const ssize_t count = ::recv(client->file, buffer.data(), buffer.size(), 0);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return;
  if (count <= 0) return close_client(client);
  client->received.insert(client->received.end(), buffer.begin(), buffer.begin() + count);
  std::size_t used = 0;
  while (client->file >= 0) {
    const ModbusFrame frame = find_tcp_frame(std::span(client->received).subspan(used));
    if (frame.state == FrameState::broken) return close_client(client);
    if (frame.state == FrameState::incomplete) break;
    used += frame.length;
    const std::optional<WireAnswer> answer = answerer_(frame.unit, frame.pdu);
    if (!answer) continue;
    const auto bytes =
        answer->raw ? answer->bytes : make_tcp_frame(frame.transaction, frame.unit, answer->bytes);
    if (answer->delay_ms > 0.0) {
      loop_.at(EventLoop::now() + from_ms(answer->delay_ms),
               [this, client, bytes] { send(client, bytes); });
    } else {
      send(client, bytes);
    }
  }
  client->received.erase(client->received.begin(),
                         client->received.begin() + static_cast<std::ptrdiff_t>(used));
}

void ModbusTcpServer::send(const std::shared_ptr<Client>& client,
                           std::span<const std::uint8_t> bytes) {
  if (client->file < 0) return;  // closed before a late answer
  client->unsent.insert(client->unsent.end(), bytes.begin(), bytes.end());
  if (client->unsent.size() > unsent_bytes_max) return close_client(client);  // it never reads
  flush(client);
}

void ModbusTcpServer::flush(const std::shared_ptr<Client>& client) {
  if (!client->unsent.empty()) {
    const ssize_t count =
        ::send(client->file, client->unsent.data(), client->unsent.size(), MSG_NOSIGNAL);
    if (count < 0 && errno != EAGAIN && errno != EINTR) return close_client(client);
    if (count > 0) {
      client->unsent.erase(client->unsent.begin(), client->unsent.begin() + count);
    }
  }
  const int events = client->unsent.empty() ? POLLIN : POLLIN | POLLOUT;
  loop_.change(client->file, static_cast<short>(events));
}

void ModbusTcpServer::close_client(const std::shared_ptr<Client>& client) {
  if (client->file < 0) return;
  loop_.unwatch(client->file);
  clients_.erase(client->file);
  ::close(client->file);
  client->file = -1;
}

void ModbusTcpServer::close_connections() {
  while (!clients_.empty()) {
    const std::shared_ptr<Client> client = clients_.begin()->second;
    close_client(client);
  }
}

void ModbusTcpServer::switch_off() {
  // Closes the listener first, so that a client cannot reconnect in the meantime.
  if (listener_ >= 0) {
    loop_.unwatch(listener_);
    ::close(listener_);
    listener_ = -1;
  }
  close_connections();
}

void ModbusTcpServer::switch_on() {
  if (listener_ >= 0) return;
  try {
    listen_at(port_);
  } catch (const std::runtime_error&) {
    // The port is taken; the caller retries.
  }
}

namespace {

// Far longer than 3.5 characters, since a client may be interrupted between two bytes.
constexpr nanoseconds silence = std::chrono::milliseconds(20);
constexpr double bits_a_character = 11.0;

}  // namespace

ModbusRtuLine::ModbusRtuLine(EventLoop& loop, std::filesystem::path link, RtuLineTiming timing,
                             ModbusAnswerer answerer)
    : loop_(loop), link_(std::move(link)), timing_(timing), answerer_(std::move(answerer)) {
  open_terminal();
  place_link();
  loop_.watch(master_, POLLIN, [this](short) { readable(); });
}

ModbusRtuLine::~ModbusRtuLine() {
  *alive_ = false;
  loop_.unwatch(master_);
  std::error_code error;
  if (std::filesystem::read_symlink(link_, error) == terminal_) {
    std::filesystem::remove(link_, error);
  }
  ::close(slave_);
  ::close(master_);
}

void ModbusRtuLine::open_terminal() {
  master_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  std::array<char, 128> name{};
  if (master_ < 0 || ::grantpt(master_) != 0 || ::unlockpt(master_) != 0 ||
      ::ptsname_r(master_, name.data(), name.size()) != 0) {
    throw std::runtime_error(std::string("cannot open a pseudo terminal: ") + std::strerror(errno));
  }
  terminal_ = name.data();
  slave_ = ::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (slave_ < 0) {
    throw std::runtime_error("cannot open " + terminal_ + ": " + std::strerror(errno));
  }
  termios settings{};
  ::tcgetattr(slave_, &settings);
  ::cfmakeraw(&settings);  // no translation and no echo before a client configures it
  ::tcsetattr(slave_, TCSANOW, &settings);
}

void ModbusRtuLine::place_link() {
  std::error_code error;
  const auto status = std::filesystem::symlink_status(link_, error);
  if (std::filesystem::is_symlink(status)) {
    std::filesystem::remove(link_, error);
  } else if (std::filesystem::exists(status)) {
    throw std::runtime_error("cannot put a link to the serial line at " + link_.string() +
                             ": something other than a symbolic link is there");
  }
  if (link_.has_parent_path()) std::filesystem::create_directories(link_.parent_path(), error);
  std::filesystem::create_symlink(terminal_, link_, error);
  if (error) {
    throw std::runtime_error("cannot put a link to the serial line at " + link_.string() + ": " +
                             error.message());
  }
}

void ModbusRtuLine::discard() {
  received_.clear();
  ++discards_;
}

void ModbusRtuLine::readable() {
  std::array<std::uint8_t, 1024> buffer{};
  const ssize_t count = ::read(master_, buffer.data(), buffer.size());
  if (count <= 0) return;
  received_.insert(received_.end(), buffer.begin(), buffer.begin() + count);
  ++receptions_;
  handle(false);
  if (received_.empty()) return;
  loop_.at(EventLoop::now() + silence, [this, alive = alive_, reception = receptions_] {
    if (*alive && reception == receptions_) handle(true);
  });
}

void ModbusRtuLine::handle(bool after_silence) {
  while (!received_.empty()) {
    const ModbusFrame frame = find_rtu_frame(received_, after_silence);
    if (frame.state == FrameState::incomplete) return;
    if (frame.state == FrameState::broken) {
      received_.clear();  // ignored until the next silence, as by a unit
      return;
    }
    answer(frame);
    received_.erase(received_.begin(),
                    received_.begin() + static_cast<std::ptrdiff_t>(frame.length));
  }
}

void ModbusRtuLine::answer(const ModbusFrame& frame) {
  const std::optional<WireAnswer> answer = answerer_(frame.unit, frame.pdu);
  if (!answer) return;
  const auto bytes = answer->raw ? answer->bytes : make_rtu_frame(frame.unit, answer->bytes);
  double delay_ms = answer->delay_ms;
  if (timing_.line_delay) {
    const double characters = static_cast<double>(frame.length + bytes.size()) + 3.5;
    delay_ms += 1000.0 * characters * bits_a_character / timing_.baud;
  }
  if (!(delay_ms > 0.0)) return write(bytes);
  const auto delay =
      std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double, std::milli>(delay_ms));
  loop_.at(EventLoop::now() + delay, [this, alive = alive_, bytes, discards = discards_] {
    if (*alive && discards == discards_) write(bytes);
  });
}

void ModbusRtuLine::write(std::span<const std::uint8_t> bytes) {
  // If a client does not read, the terminal's queue fills and further bytes are lost.
  [[maybe_unused]] const ssize_t count = ::write(master_, bytes.data(), bytes.size());
}

}  // namespace thermocomp
