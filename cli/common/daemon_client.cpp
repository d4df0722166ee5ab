#include "cli/common/daemon_client.hpp"

#include <cstdlib>

#include <nlohmann/json.hpp>

#include "config/daemon/daemon_config.hpp"
#include "daemon/socket/status_client.hpp"
#include "report/command.hpp"

namespace thermocomp::cli {

namespace {

// JSON-RPC error of a valid request that the daemon's state forbids; other errors are misuse.
constexpr int refused = -32002;

}  // namespace

nlohmann::json ask_daemon(const std::filesystem::path& socket, const std::string& method,
                          const nlohmann::json& params) {
  try {
    StatusClient client(socket);
    return client.call(method, params);
  } catch (const RemoteError& error) {
    throw Failure(error.what(), error.code() == refused ? exit_no : exit_error);
  } catch (const ClientError& error) {
    throw Failure(error.what());
  }
}

std::string default_socket() {
  const char* chosen = std::getenv("THERMOCOMP_SOCKET");
  return chosen != nullptr && *chosen != '\0' ? chosen : SocketConfig{}.path.string();
}

}  // namespace thermocomp::cli
