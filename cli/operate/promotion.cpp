#include "cli/operate/promotion.hpp"

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "config/daemon/daemon_config.hpp"
#include "config/model/model_file.hpp"
#include "config/toml/toml_reader.hpp"
#include "daemon/socket/status_client.hpp"
#include "report/command.hpp"
#include "report/files.hpp"

namespace thermocomp::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string text_of_model(const fs::path& path) {
  return read_text_file(path, model_bytes_max);
}

/// @return the candidate's file. @throws Failure if none runs
fs::path candidate_in(const json& status) {
  if (!status.contains("candidate"))
    throw Failure(
        "no candidate is running: thermocomp candidate FILE, or [model] candidate in "
        "the configuration and thermocomp reload");
  const json& candidate = status["candidate"];
  const std::string problem = text_of(candidate, "problem");
  if (!problem.empty()) throw Failure("the candidate does not run: " + problem);
  return text_of(candidate, "file");
}

void require_checksum(const fs::path& file, const std::string& text, const std::string& checksum) {
  if (!checksum.empty() && sha256_hex(text) != checksum)
    throw Failure(file.string() + ": is not the model with the SHA-256 " + checksum);
}

json status_at(const fs::path& socket) {
  return StatusClient(socket).call("status", json::object());
}

/// Writes `next` to the model's file and reloads; on failure restores `now`.
void reload_with(const fs::path& socket, const fs::path& model, const std::string& next,
                 const std::string& now) {
  cli::write_file(model, next);
  try {
    static_cast<void>(StatusClient(socket).call("reload", json::object()));
  } catch (...) {
    cli::write_file(model, now);
    throw;
  }
}

}  // namespace

void start_candidate(const fs::path& socket, const fs::path& file) {
  static_cast<void>(StatusClient(socket).call("candidate", {{"file", file.string()}}));
  if (file.empty()) return;
  const json status = status_at(socket);
  if (!status.contains("candidate")) throw Failure(file.string() + ": is the model in use itself");
  static_cast<void>(candidate_in(status));
}

Promotion promote(const fs::path& socket, const std::string& checksum) {
  const json status = status_at(socket);
  const fs::path model = text_of(status["model"], "file");
  const fs::path before = model.string() + ".before";
  const fs::path candidate = candidate_in(status);
  const std::string next = text_of_model(candidate);
  require_checksum(candidate, next, checksum);
  const std::string now = text_of_model(model);
  // In this order one of the files always holds the model previously in use.
  cli::write_file(before, now);
  reload_with(socket, model, next, now);
  return {model, before, number_of(status["candidate"], "better_probability")};
}

Promotion take_back(const fs::path& socket, const std::string& checksum) {
  const fs::path model = text_of(status_at(socket)["model"], "file");
  const fs::path before = model.string() + ".before";
  if (!fs::exists(before)) throw Failure(before.string() + ": nothing was promoted");
  const std::string next = text_of_model(before);
  const std::string now = text_of_model(model);
  require_checksum(model, now, checksum);
  reload_with(socket, model, next, now);
  cli::write_file(before, now);
  return {model, before};
}

}  // namespace thermocomp::cli
