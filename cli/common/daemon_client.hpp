/// Requests to the daemon, with errors as this program reports them.
#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

/// @throws Failure: status 2 without a daemon, permission or answer; status 1 if the daemon refuses
///         a valid request
nlohmann::json ask_daemon(const std::filesystem::path& socket, const std::string& method,
                          const nlohmann::json& params);

/// Default socket: THERMOCOMP_SOCKET, else the daemon's default.
[[nodiscard]] std::string default_socket();

}  // namespace thermocomp::cli
