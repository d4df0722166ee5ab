// SPDX-License-Identifier: GPL-2.0-or-later
/// The connection to the daemon's status socket: non-blocking exchange of lines.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace thermocomp_linuxcnc {

class DaemonLink {
 public:
  /// Longest answer of the daemon.
  static constexpr std::size_t line_bytes_max = std::size_t{256} * 1024;

  explicit DaemonLink(std::string path) : path_(std::move(path)) {}
  ~DaemonLink() { close(); }
  DaemonLink(const DaemonLink&) = delete;
  DaemonLink& operator=(const DaemonLink&) = delete;

  /// @return connected; if not, error() gives the reason
  bool connect();
  void close();
  [[nodiscard]] bool connected() const noexcept { return fd_ >= 0; }
  [[nodiscard]] int fd() const noexcept { return fd_; }  ///< -1: none
  [[nodiscard]] const std::string& error() const noexcept { return error_; }

  /// A request is far smaller than a socket's buffer; a partial write ends the connection.
  bool send(const std::string& line);
  /// The next complete line, if any. May end the connection.
  std::optional<std::string> receive();

 private:
  void fail(const std::string& what, int code);

  std::string path_;
  int fd_{-1};
  std::string input_;
  std::string error_;
};

}  // namespace thermocomp_linuxcnc
