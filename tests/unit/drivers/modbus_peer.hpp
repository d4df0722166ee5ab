/// A Modbus device of raw bytes on a TCP socket or a pseudo terminal: tests script its answers,
/// their times and errors. It uses no code under test.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <functional>
#include <map>
#include <mutex>
#include <poll.h>
#include <stdexcept>
#include <stdlib.h>
#include <string>
#include <termios.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include <netinet/in.h>
#include <sys/socket.h>

namespace peer {

using Bytes = std::vector<std::uint8_t>;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

struct Request {
  int unit{0};
  int function{0};
  int address{0};
  int count{0};
  Bytes pdu;
};

struct Reply {
  Bytes pdu{};  ///< function and data; empty: no answer
  milliseconds delay{0};
  int unit{-1};  ///< -1: that of the request
  bool spoil_checksum{false};
  bool close{false};        ///< TCP: close the connection instead of answering
  bool close_after{false};  ///< TCP: close it after the answer
  Bytes raw{};              ///< sent unchanged instead of a frame
};

using Handler = std::function<Reply(const Request&)>;

inline Bytes registers_pdu(int function, const std::vector<std::uint16_t>& words) {
  Bytes pdu{static_cast<std::uint8_t>(function), static_cast<std::uint8_t>(2 * words.size())};
  for (const std::uint16_t word : words) {
    pdu.push_back(static_cast<std::uint8_t>(word >> 8));
    pdu.push_back(static_cast<std::uint8_t>(word & 0xFF));
  }
  return pdu;
}

/// The lowest bit of each word.
inline Bytes bits_pdu(int function, const std::vector<std::uint16_t>& words) {
  Bytes pdu{static_cast<std::uint8_t>(function), static_cast<std::uint8_t>((words.size() + 7) / 8)};
  pdu.resize(2 + pdu[1]);
  for (std::size_t i = 0; i < words.size(); ++i) {
    pdu[2 + i / 8] = static_cast<std::uint8_t>(pdu[2 + i / 8] | ((words[i] & 1) << (i % 8)));
  }
  return pdu;
}

/// Every register holds unit * 1000 + address; every bit is the lowest bit of that number.
inline Reply correct(const Request& request) {
  if (request.function == 16 || request.function == 5) {
    return {Bytes(request.pdu.begin(), request.pdu.begin() + 5)};
  }
  std::vector<std::uint16_t> words;
  for (int i = 0; i < request.count; ++i) {
    words.push_back(static_cast<std::uint16_t>(request.unit * 1000 + request.address + i));
  }
  if (request.function > 2) return {registers_pdu(request.function, words)};
  return {bits_pdu(request.function, words)};
}

inline Reply exception(const Request& request, int code) {
  return {{static_cast<std::uint8_t>(request.function | 0x80), static_cast<std::uint8_t>(code)}};
}

inline std::uint16_t crc(const Bytes& bytes) {
  unsigned sum = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    sum ^= byte;
    for (int i = 0; i < 8; ++i) sum = (sum & 1) != 0 ? (sum >> 1) ^ 0xA001 : sum >> 1;
  }
  return static_cast<std::uint16_t>(sum);
}

class Device {
 public:
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  virtual ~Device() { halt(); }

  [[nodiscard]] int requests() const { return requests_.load(); }
  void handle(Handler handler) {
    const std::lock_guard lock(mutex_);
    handler_ = std::move(handler);
  }

 protected:
  explicit Device(Handler handler) : handler_(std::move(handler)) {}
  void halt() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  Reply answer(const Request& request) {
    ++requests_;
    const std::lock_guard lock(mutex_);
    return handler_(request);
  }
  static Request parse(int unit, const Bytes& pdu) {
    Request request{unit, pdu[0], 0, 0, pdu};
    request.address = (pdu[1] << 8) | pdu[2];
    request.count = (pdu[3] << 8) | pdu[4];
    return request;
  }
  void later(const Reply& reply, Bytes bytes) {
    pending_.emplace(steady_clock::now() + reply.delay, std::move(bytes));
  }
  void send_due(int fd) {
    while (!pending_.empty() && pending_.begin()->first <= steady_clock::now()) {
      const Bytes bytes = pending_.begin()->second;
      pending_.erase(pending_.begin());
      [[maybe_unused]] const auto written = ::write(fd, bytes.data(), bytes.size());
    }
  }

  std::atomic<bool> stop_{false};
  std::thread thread_;
  std::multimap<steady_clock::time_point, Bytes> pending_;
  Bytes buffer_;

 private:
  std::mutex mutex_;
  Handler handler_;
  std::atomic<int> requests_{0};
};

/// One connection at a time on a free port (or a given one, to return at the same address).
class TcpDevice : public Device {
 public:
  explicit TcpDevice(Handler handler = correct, int port = 0) : Device(std::move(handler)) {
    signal(SIGPIPE, SIG_IGN);
    listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const int on = 1;
    ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    socklen_t size = sizeof address;
    auto* plain = reinterpret_cast<sockaddr*>(&address);
    if (::bind(listener_, plain, size) != 0) throw std::runtime_error("bind");
    ::listen(listener_, 4);
    ::getsockname(listener_, plain, &size);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { run(); });
  }
  ~TcpDevice() override {
    halt();
    if (client_ >= 0) ::close(client_);
    ::close(listener_);
  }
  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] int connections() const { return connections_.load(); }

 private:
  void run() {
    while (!stop_) {
      std::array<pollfd, 2> waits{pollfd{listener_, POLLIN, 0}, pollfd{client_, POLLIN, 0}};
      ::poll(waits.data(), client_ >= 0 ? 2 : 1, 1);
      if (waits[0].revents != 0) {
        drop();
        client_ = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
        ++connections_;
      } else if (client_ >= 0 && waits[1].revents != 0) {
        take();
      }
      if (client_ >= 0) send_due(client_);
      if (is_last_answer_ && pending_.empty()) drop();
    }
  }
  void drop() {
    is_last_answer_ = false;
    if (client_ >= 0) ::close(client_);
    client_ = -1;
    buffer_.clear();
    pending_.clear();
  }
  void take() {
    std::array<std::uint8_t, 512> bytes{};
    const auto count = ::read(client_, bytes.data(), bytes.size());
    if (count <= 0) return drop();
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.begin() + count);
    while (buffer_.size() >= 7) {
      const auto size = static_cast<std::size_t>((buffer_[4] << 8) | buffer_[5]) + 6;
      if (buffer_.size() < size) return;
      const Bytes adu(buffer_.begin(), buffer_.begin() + static_cast<long>(size));
      buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<long>(size));
      const Reply reply = answer(parse(adu[6], Bytes(adu.begin() + 7, adu.end())));
      if (reply.close) return drop();
      is_last_answer_ = reply.close_after;
      if (!reply.raw.empty()) later(reply, reply.raw);
      if (reply.pdu.empty()) continue;
      const auto length = reply.pdu.size() + 1;
      Bytes frame{adu[0],
                  adu[1],
                  0,
                  0,
                  static_cast<std::uint8_t>(length >> 8),
                  static_cast<std::uint8_t>(length & 0xFF),
                  static_cast<std::uint8_t>(reply.unit >= 0 ? reply.unit : adu[6])};
      frame.insert(frame.end(), reply.pdu.begin(), reply.pdu.end());
      later(reply, frame);
    }
  }

  bool is_last_answer_{false};
  int listener_{-1};
  int client_{-1};
  int port_{0};
  std::atomic<int> connections_{0};
};

/// All units of a serial line behind one pseudo terminal, reached through a link in /tmp so that
/// the line can vanish and return under its name.
class SerialLine : public Device {
 public:
  explicit SerialLine(Handler handler = correct) : Device(std::move(handler)) {
    std::array<char, 32> folder{"/tmp/modbus_line_XXXXXX"};
    if (::mkdtemp(folder.data()) == nullptr) throw std::runtime_error("mkdtemp");
    folder_ = folder.data();
    plug_in();
  }
  ~SerialLine() override {
    unplug();
    ::rmdir(folder_.c_str());
  }
  [[nodiscard]] std::string device() const { return folder_ + "/line"; }

  void plug_in() {
    master_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    ::grantpt(master_);
    ::unlockpt(master_);
    std::array<char, 64> name{};
    ::ptsname_r(master_, name.data(), name.size());
    keep_open_ = ::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    termios raw{};
    ::tcgetattr(keep_open_, &raw);
    ::cfmakeraw(&raw);
    ::tcsetattr(keep_open_, TCSANOW, &raw);
    if (::symlink(name.data(), device().c_str()) != 0) throw std::runtime_error("symlink");
    stop_ = false;
    thread_ = std::thread([this] { run(); });
  }
  void unplug() {
    if (master_ < 0) return;
    halt();
    ::unlink(device().c_str());
    ::close(keep_open_);
    ::close(master_);
    master_ = -1;
  }

 private:
  void run() {
    while (!stop_) {
      pollfd wait{master_, POLLIN, 0};
      ::poll(&wait, 1, 1);
      if ((wait.revents & POLLIN) != 0) take();
      send_due(master_);
    }
  }
  void take() {
    std::array<std::uint8_t, 512> bytes{};
    const auto count = ::read(master_, bytes.data(), bytes.size());
    if (count <= 0) return;
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.begin() + count);
    while (buffer_.size() >= 8) {
      const std::size_t size = buffer_[1] == 16 ? 9U + buffer_[6] : 8U;
      if (buffer_.size() < size) return;
      const int unit = buffer_[0];
      const Bytes pdu(buffer_.begin() + 1, buffer_.begin() + static_cast<long>(size) - 2);
      buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<long>(size));
      const Reply reply = answer(parse(unit, pdu));
      if (!reply.raw.empty()) later(reply, reply.raw);
      if (reply.pdu.empty()) continue;
      Bytes frame{static_cast<std::uint8_t>(reply.unit >= 0 ? reply.unit : unit)};
      frame.insert(frame.end(), reply.pdu.begin(), reply.pdu.end());
      const unsigned sum = crc(frame) ^ (reply.spoil_checksum ? 1U : 0U);
      frame.push_back(static_cast<std::uint8_t>(sum & 0xFF));
      frame.push_back(static_cast<std::uint8_t>(sum >> 8));
      later(reply, frame);
    }
  }

  std::string folder_;
  int master_{-1};
  int keep_open_{-1};
};

/// Waits for a condition that must become true, longer than any machine may need.
inline bool eventually(const std::function<bool()>& holds, int limit_s = 20) {
  const auto give_up_at = steady_clock::now() + std::chrono::seconds(limit_s);
  while (steady_clock::now() < give_up_at) {
    if (holds()) return true;
    std::this_thread::sleep_for(milliseconds(5));
  }
  return holds();
}

}  // namespace peer
