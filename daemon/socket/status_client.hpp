/// Client of the status socket, for commands and gateway: small, blocking, robust against any
/// server. A call never exceeds its time-out, nor an answer JsonLimits in memory.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "report/command.hpp"

namespace thermocomp {

/// No daemon, no permission, connection lost, or time-out.
class ClientError : public cli::Failure {
 public:
  using cli::Failure::Failure;
};

/// The daemon answered with an error; the command's exit status is 1 if the daemon refused a valid
/// request.
class RemoteError : public cli::Failure {
 public:
  RemoteError(int code, const std::string& message);
  [[nodiscard]] int code() const noexcept { return code_; }

 private:
  int code_;
};

class StatusClient {
 public:
  static constexpr std::chrono::seconds patience{5};
  /// When full, the oldest notification is dropped.
  static constexpr std::size_t notifications_max = 256;

  /// @throws ClientError "no daemon at PATH: ...", or on time-out
  explicit StatusClient(const std::filesystem::path& path,
                        std::chrono::milliseconds timeout = patience);
  ~StatusClient();
  StatusClient(StatusClient&&) noexcept;

  /// Sends a request and returns its answer; notifications in between are kept for next().
  /// @throws ClientError, RemoteError
  nlohmann::json call(const std::string& method, const nlohmann::json& params,
                      std::chrono::milliseconds timeout = patience);
  /// The next notification, {"method": ..., "params": ...}, after call("subscribe", ...).
  /// @throws ClientError when the connection ends or on time-out
  nlohmann::json next(std::chrono::milliseconds timeout);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
