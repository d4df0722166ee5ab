#include "fleet/release/release_exchange.hpp"

#include <cstdint>
#include <pqxx/pqxx>
#include <string>

#include <nlohmann/json.hpp>
#include <system_error>

#include "config/daemon/daemon_config.hpp"
#include "config/toml/toml_reader.hpp"
#include "report/files.hpp"

namespace thermocomp::fleet {
namespace {

using nlohmann::json;

constexpr std::uintmax_t file_bytes_max = 2 * model_bytes_max;

/// Null if the file is missing or incomplete.
json json_in(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return nullptr;
  json read = json::parse(read_text_file(file, file_bytes_max), nullptr, false);
  return read.is_object() ? read : json(nullptr);
}

void fetch_offer(pqxx::work& work, const std::filesystem::path& file) {
  const pqxx::result found = work.exec(
      "SELECT release.id, machine.name, release.model,"
      " EXISTS (SELECT FROM fleet.release_step WHERE release = release.id AND step = 'withdrawn'),"
      " (SELECT detail FROM fleet.release_step WHERE release = release.id AND step = 'approved'"
      "  ORDER BY id DESC LIMIT 1),"
      " (SELECT detail FROM fleet.release_step WHERE release = release.id AND step = 'rollback'"
      "  ORDER BY id DESC LIMIT 1)"
      " FROM fleet.release JOIN fleet.machine ON machine.id = release.machine"
      " ORDER BY release.id DESC LIMIT 1");
  if (found.empty()) return;
  const auto& row = found[0];
  json offer = {{"release", row[0].as<std::uint64_t>()},  {"machine", row[1].as<std::string>()},
                {"model", row[2].as<std::string>()},      {"withdrawn", row[3].as<bool>()},
                {"approved", row[4].as<std::string>("")}, {"rollback", row[5].as<std::string>("")}};
  const json before = json_in(file);
  if (before.is_object() && before.value("release", json()) == offer["release"]) {
    offer["content"] = before.value("content", json());
  } else {
    offer["content"] = work.exec_params1("SELECT content FROM fleet.document WHERE checksum = $1",
                                         row[2].as<std::string>())[0]
                           .as<std::string>();
  }
  if (offer != before) cli::write_file(file.string(), offer.dump() + "\n");
}

void report_steps(pqxx::work& work, const std::filesystem::path& file) {
  const json kept = json_in(file);
  if (!kept.is_object()) return;
  const auto release = kept.value("release", std::uint64_t{0});
  const auto known = work.exec_params1(
                             "SELECT count(*) FROM fleet.release_step WHERE release = $1"
                             " AND who = session_user",
                             release)[0]
                         .as<std::size_t>();
  const json steps = kept.value("steps", json::array());
  for (std::size_t i = known; i < steps.size(); ++i) {
    const std::string detail = steps[i].value("detail", "");
    work.exec_params0("INSERT INTO fleet.release_step (release, step, detail) VALUES ($1, $2, $3)",
                      release, steps[i].value("step", ""),
                      steps[i].value("at", "").append(detail.empty() ? "" : ": ").append(detail));
  }
}

}  // namespace

void exchange_releases(pqxx::connection& store, const ReleaseFiles& files) {
  pqxx::work work(store);
  report_steps(work, files.steps);
  fetch_offer(work, files.offer);
  work.commit();
}

}  // namespace thermocomp::fleet
