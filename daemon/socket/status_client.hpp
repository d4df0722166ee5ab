/// The other end of the status socket, for command and gateway: small, blocking, and as careful as
/// the server. Whoever listens there, no call outlasts its time, and no answer costs more memory
/// than JsonLimits allow.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp {

/// No daemon there, no permission to connect, connection lost, no answer in time.
class ClientError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The daemon answered with an error.
class RemoteError : public std::runtime_error {
 public:
  RemoteError(int code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] int code() const noexcept { return code_; }

 private:
  int code_;
};

class StatusClient {
 public:
  static constexpr std::chrono::seconds patience{5};
  /// Beyond these the oldest notification is dropped.
  static constexpr std::size_t notifications_max = 256;

  /// @throws ClientError "no daemon at PATH: ...", or the connection is not taken in time
  explicit StatusClient(const std::filesystem::path& path,
                        std::chrono::milliseconds timeout = patience);
  ~StatusClient();
  StatusClient(StatusClient&&) noexcept;

  /// One request and its answer; notifications that come in between are kept for next().
  /// @throws ClientError, RemoteError
  nlohmann::json call(const std::string& method, const nlohmann::json& params,
                      std::chrono::milliseconds timeout = patience);
  /// The next notification, {"method": ..., "params": ...}, after call("subscribe", ...).
  /// @throws ClientError when the connection ends or nothing comes in time
  nlohmann::json next(std::chrono::milliseconds timeout);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
