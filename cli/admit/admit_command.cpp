#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <iostream>
#include <memory>
#include <sstream>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <system_error>

#include "cli/admit/admission.hpp"
#include "cli/commands.hpp"
#include "cli/common/json_fields.hpp"
#include "cli/observe/status_text.hpp"
#include "cli/operate/promotion.hpp"
#include "config/daemon/daemon_config.hpp"
#include "config/model/approval.hpp"
#include "config/model/model_file.hpp"
#include "config/toml/toml_reader.hpp"
#include "daemon/history/replay/replay.hpp"
#include "daemon/socket/status_client.hpp"
#include "report/files.hpp"
#include "status/status.hpp"

namespace thermocomp::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::uintmax_t offer_bytes_max = 2 * model_bytes_max;

struct AdmitSettings {
  std::string machine;
  fs::path config;     ///< of the daemon
  fs::path offer;      ///< file written by the uplink
  fs::path folder;     ///< holds the candidate and the decisions
  fs::path approvers;  ///< folder of public keys; empty: an operator here approves
  double days{3.0};
  AdmissionRules rules;
};

AdmitSettings load_settings(const fs::path& file) {
  const TomlDocument document = TomlDocument::from_file(file);
  const TomlTable root = document.root();
  const auto path = [&](const char* key, const char* otherwise) {
    return (file.parent_path() / root.text(key, otherwise)).lexically_normal();
  };
  static_cast<void>(root.integer("format", 1, 1));
  AdmitSettings settings;
  settings.machine = root.text("machine");
  settings.config = path("config", "thermocompd.toml");
  settings.offer = path("offer", "/var/lib/thermocomp-uplink/offer.json");
  settings.folder = path("folder", "/var/lib/thermocomp-admit");
  if (root.has("approvers")) settings.approvers = path("approvers", "");
  settings.days = root.number("days", Range::between(0.01, 31), settings.days);
  settings.rules.probings_min =
      root.integer<std::size_t>("probings_min", 2, 1000, settings.rules.probings_min);
  document.finish();
  return settings;
}

/// The uplink's file: {"release", "machine", "model", "content", "withdrawn", "approved",
/// "rollback"}; "approved" and "rollback" are signatures.
struct Offer {
  ReleaseOrder order;
  std::string content;
  std::string approval;
  std::string rollback;
  bool withdrawn{false};
};

Offer read_offer(const fs::path& file) {
  const json read = json::parse(read_text_file(file, offer_bytes_max), nullptr, false);
  if (!read.is_object() || !read.contains("content") || !read["content"].is_string())
    throw Failure(file.string() + ": is not a whole offer");
  return {{text_of(read, "machine"), count_of(read, "release"), text_of(read, "model"), false},
          read["content"].get<std::string>(),
          text_of(read, "approved"),
          text_of(read, "rollback"),
          flag_of(read, "withdrawn")};
}

/// Log of the decisions about the newest release; the uplink sends it to the store.
class Steps {
 public:
  explicit Steps(fs::path file) : file_(std::move(file)) {
    std::error_code error;
    if (!fs::exists(file_, error)) return;
    kept_ = json::parse(read_text_file(file_), nullptr, false);
    if (!kept_.is_object())
      throw Failure(file_.string() + ": cannot be read, so which releases were seen is not known");
  }
  [[nodiscard]] std::uint64_t release() const { return count_of(kept_, "release"); }
  [[nodiscard]] std::string last() const {
    const json& steps = list_of(kept_, "steps");
    return steps.empty() ? "" : text_of(steps.back(), "step");
  }
  [[nodiscard]] std::string last_detail() const {
    const json& steps = list_of(kept_, "steps");
    return steps.empty() ? "" : text_of(steps.back(), "detail");
  }
  void begin(const Offer& offer) {
    kept_ = {{"release", offer.order.release},
             {"model", offer.order.checksum},
             {"steps", json::array()}};
  }
  /// The step is on disk when this returns.
  void add(const std::string& step, const std::string& detail) {
    const std::chrono::nanoseconds now = std::chrono::system_clock::now().time_since_epoch();
    kept_["steps"].push_back({{"step", step}, {"at", utc_text(now.count())}, {"detail", detail}});
    write_file(file_.string(), kept_.dump(1) + "\n");
    std::cout << "release " << release() << ": " << step << (detail.empty() ? "" : ": ") << detail
              << '\n';
  }

 private:
  fs::path file_;
  json kept_ = json::object();
};

class Admission {
 public:
  explicit Admission(const AdmitSettings& settings)
      : settings_(settings),
        config_(load_daemon_config(settings.config)),
        offer_(read_offer(settings.offer)),
        steps_(settings.folder / "steps.json") {}

  int run() {
    if (offer_.order.release < steps_.release())
      throw Failure(fmt::format("release {} is older than {}, which was seen here already",
                                offer_.order.release, steps_.release()));
    if (offer_.order.release > steps_.release()) receive();
    if (steps_.last() == "checked") {
      start_candidate(config_.socket.path, candidate_file());
      steps_.add("candidate", score_text({}));
    }
    if (steps_.last() == "candidate") look_at_candidate();
    if (steps_.last() == "promoted") look_at_promoted();
    return steps_.last() == "refused" ? exit_no : exit_success;
  }

 private:
  [[nodiscard]] fs::path candidate_file() const { return settings_.folder / "candidate.toml"; }
  [[nodiscard]] std::string checksum_in_use() const {
    return text_of(
        object_of(StatusClient(config_.socket.path).call("status", json::object()), "model"),
        "checksum");
  }

  void receive() {
    std::string found;
    const std::string why = why_refused(found);
    steps_.begin(offer_);
    if (!why.empty()) return steps_.add("refused", why);
    write_file(candidate_file().string(), offer_.content);
    steps_.add("checked", found);
  }

  std::string why_refused(std::string& found) {
    if (offer_.withdrawn) return "withdrawn";
    if (offer_.order.machine != settings_.machine)
      return "is for machine " + offer_.order.machine + ", this is " + settings_.machine;
    if (sha256_hex(offer_.content) != offer_.order.checksum)
      return fmt::format("the model is not whole: its {} bytes do not have the SHA-256 {}",
                         offer_.content.size(), offer_.order.checksum);
    const fs::path received = settings_.folder / "received.toml";
    write_file(received.string(), offer_.content);
    set_candidate(config_, received);
    std::ostringstream text;
    const std::string history = config_.history.file.string();
    const auto from = parse_history_time(fmt::format("-{}h", 24.0 * settings_.days));
    const ExportSummary days = export_run(history, from, std::nullopt, text);
    if (days.rows == 0) return history + ": has no rows to compare the models on";
    return why_not_admitted(config_, parse_run(text.str(), history), settings_.rules, found);
  }

  /// @return owner of the key that signed the order; empty: none of `approvers`
  [[nodiscard]] std::string signer(bool takes_back) const {
    const std::string& signature = takes_back ? offer_.rollback : offer_.approval;
    if (settings_.approvers.empty() || signature.empty()) return "";
    ReleaseOrder order = offer_.order;
    order.takes_back = takes_back;
    return signer_of(order, signature, settings_.approvers);
  }
  /// Origin of a change not made by this run: an interrupted signed order, or an operator.
  [[nodiscard]] std::string done_by(bool takes_back) const {
    const std::string name = signer(takes_back);
    return name.empty() ? "by an operator at the machine" : "as ordered by " + name;
  }
  [[nodiscard]] std::string missing_signature(const char* what) const {
    return fmt::format("the {} is not signed by a key in {}", what, settings_.approvers.string());
  }

  /// An operator may have promoted the candidate, or the daemon may have restarted without it.
  void look_at_candidate() {
    if (checksum_in_use() == offer_.order.checksum) return steps_.add("promoted", done_by(false));
    if (offer_.withdrawn) return end_candidate("withdrawn");
    const auto status =
        part_from<Status>(StatusClient(config_.socket.path).call("status", json::object()));
    if (!status.candidate || status.candidate->file != candidate_file())
      start_candidate(config_.socket.path, candidate_file());
    else if (const std::string score = score_text(*status.candidate); score != steps_.last_detail())
      steps_.add("candidate", score);  // the score on which it is approved
    if (settings_.approvers.empty() || offer_.approval.empty()) return;
    const std::string name = signer(false);
    if (name.empty()) return end_candidate(missing_signature("approval"));
    constexpr double worse_probability_max = 0.5;
    if (status.candidate && status.candidate->worse_probability > worse_probability_max)
      return end_candidate(fmt::format("is worse at {} probings here with {:.0f} %",
                                       status.candidate->probings,
                                       100.0 * status.candidate->worse_probability));
    static_cast<void>(promote(config_.socket.path, offer_.order.checksum));
    steps_.add("promoted", "as ordered by " + name);
  }

  void end_candidate(const std::string& why) {
    start_candidate(config_.socket.path, {});
    steps_.add("refused", why);
  }

  void look_at_promoted() {
    if (checksum_in_use() != offer_.order.checksum) return steps_.add("rolled_back", done_by(true));
    if (settings_.approvers.empty() || offer_.rollback.empty()) return;
    const std::string name = signer(true);
    if (name.empty()) throw Failure(missing_signature("order to take the release back"));
    static_cast<void>(take_back(config_.socket.path, offer_.order.checksum));
    steps_.add("rolled_back", "as ordered by " + name);
  }

  const AdmitSettings& settings_;
  DaemonConfig config_;
  Offer offer_;
  Steps steps_;
};

int run_admit(const std::string& file) {
  const AdmitSettings settings = load_settings(file);
  std::error_code error;
  if (!fs::exists(settings.offer, error)) {
    std::cout << settings.offer.string() << ": no model is offered\n";
    return exit_success;
  }
  return Admission(settings).run();
}

}  // namespace

void add_admit_command(CLI::App& app, Action& action) {
  CLI::App* sub =
      app.add_subcommand("admit",
                         "checks a model offered by the office on this machine's recent days, runs "
                         "it as the candidate, and promotes it or rolls it back as approved");
  const auto file = std::make_shared<std::string>();
  sub->add_option("RELEASES", *file, "configuration, such as /etc/thermocomp/releases.toml")
      ->type_name("FILE")
      ->required();
  sub->callback([&action, file] { action = [file] { return run_admit(*file); }; });
}

}  // namespace thermocomp::cli
