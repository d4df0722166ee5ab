// Independent CAN access for the tests on real interfaces: raw frames, can-utils and python-can.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>
#include <unistd.h>

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <sys/wait.h>

namespace thermocomp::test {

/// Runs a shell command. @return true if it succeeded
inline bool shell(const std::string& command) {
  return std::system(command.c_str()) == 0;
}

/// A background program that ends with the object.
class Background {
 public:
  explicit Background(const std::string& command) : pid_(::fork()) {
    if (pid_ < 0) throw std::runtime_error("fork");
    if (pid_ > 0) return;
    const std::string replaced = "exec " + command;
    ::execl("/bin/sh", "sh", "-c", replaced.c_str(), nullptr);
    ::_exit(127);
  }
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;
  ~Background() {
    ::kill(pid_, SIGTERM);
    ::waitpid(pid_, nullptr, 0);
  }

 private:
  pid_t pid_;
};

/// Sends frames without any code of the project.
class RawSender {
 public:
  explicit RawSender(const std::string& interface)
      : socket_(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
    if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) < 0) {
      throw std::runtime_error("no " + interface);
    }
  }
  RawSender(const RawSender&) = delete;
  RawSender& operator=(const RawSender&) = delete;
  ~RawSender() { ::close(socket_); }

  /// @param id  may include CAN_EFF_FLAG or CAN_RTR_FLAG
  bool send(std::uint32_t id, std::initializer_list<int> bytes) {
    can_frame frame{};
    frame.can_id = id;
    for (const int byte : bytes) frame.data[frame.len++] = static_cast<std::uint8_t>(byte);
    return ::write(socket_, &frame, sizeof frame) == static_cast<ssize_t>(sizeof frame);
  }

 private:
  int socket_;
};

/// Received classic frames of an interface.
class RawReceiver {
 public:
  explicit RawReceiver(const std::string& interface)
      : socket_(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW)) {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
    if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) < 0) {
      throw std::runtime_error("no " + interface);
    }
  }
  RawReceiver(const RawReceiver&) = delete;
  RawReceiver& operator=(const RawReceiver&) = delete;
  ~RawReceiver() { ::close(socket_); }

  /// Without waiting.
  std::optional<can_frame> receive() {
    can_frame frame{};
    if (::read(socket_, &frame, sizeof frame) != static_cast<ssize_t>(sizeof frame)) return {};
    return frame;
  }

 private:
  int socket_;
};

/// candump of one interface into a file that is removed with the object.
class Candump {
 public:
  explicit Candump(const std::string& what)
      : file_(std::filesystem::temp_directory_path() / ("candump." + std::to_string(::getpid()))),
        program_("candump " + what + " > " + file_.string()) {}
  Candump(const Candump&) = delete;
  Candump& operator=(const Candump&) = delete;
  ~Candump() {
    std::error_code ignored;
    std::filesystem::remove(file_, ignored);
  }

  [[nodiscard]] std::string text() const {
    std::ifstream file(file_);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  [[nodiscard]] bool shows(const std::string& part) const {
    return text().find(part) != std::string::npos;
  }
  /// Sends a frame and looks for it in the output, since candump takes time to start.
  [[nodiscard]] bool listens(RawSender& bus, std::uint32_t id) const {
    return bus.send(id, {0x5A, 0xA5}) && shows("5A A5");
  }

 private:
  std::filesystem::path file_;
  Background program_;
};

}  // namespace thermocomp::test
