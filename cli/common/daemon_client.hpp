/// One question to the daemon, with errors as this program reports them.
#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

/// @throws Failure: status 2 where there is no daemon, no permission or no answer; status 1 where
///         the daemon understood and refused
nlohmann::json ask_daemon(const std::filesystem::path& socket, const std::string& method,
                          const nlohmann::json& params);

/// The socket that is used where none is named: THERMOCOMP_SOCKET, else the daemon's default.
[[nodiscard]] std::string default_socket();

}  // namespace thermocomp::cli
