#include "daemon/operations.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <malloc.h>
#include <utility>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "daemon/controller_lock.hpp"
#include "daemon/status/status_view.hpp"
#include "daemon/system/log_setup.hpp"

namespace thermocomp {
namespace {

using nlohmann::json;

/// Clients are answered within 2 s, also when the disk hangs.
constexpr auto disk_patience = std::chrono::milliseconds(1500);

constexpr auto patience_s =
    std::chrono::duration_cast<std::chrono::seconds>(CycleHandle::patience).count();

bool is_kept(CommandKind kind) {
  return kind == CommandKind::enable || kind == CommandKind::disable ||
         kind == CommandKind::reference;
}

/// @param asked  name of the request, for the error text
/// @return true if it is done
bool is_done(Outcome outcome, const char* asked) {
  switch (outcome) {
    case Outcome::waiting:
      return false;
    case Outcome::done:
      return true;
    case Outcome::withdrawn:
      throw RpcError(rpc::internal_error,
                     fmt::format("the cycle does not answer: the {} was not taken within {} s and "
                                 "is withdrawn, nothing has changed",
                                 asked, patience_s));
    case Outcome::overdue:
      break;
  }
  throw RpcError(
      rpc::internal_error,
      fmt::format(
          "the cycle does not respond: it has begun the {} and not finished it; see the status",
          asked));
}

/// Names the model and the candidate if a reload changed them: "model SHA-256 3f..., candidate
/// FILE".
std::string changes_of(const DaemonConfig& before, const DaemonConfig& after) {
  std::string text;
  if (after.model_checksum != before.model_checksum)
    text = "model SHA-256 " + after.model_checksum.substr(0, 16);
  const auto candidate = [](const DaemonConfig& config) {
    return config.candidate ? "candidate " + config.candidate->file.string()
                            : std::string("no candidate");
  };
  if (candidate(after) != candidate(before))
    text.append(text.empty() ? "" : ", ").append(candidate(after));
  return text;
}

void add_recorder(CycleParts& parts, const DaemonConfig& config, HistoryWriter* history) {
  if (history != nullptr)
    parts.recorder = history->make_recorder({config.text, config.model_text, config.model_checksum},
                                            parts.estimator);
}

/// First digits of both checksums, as a number that a JSON double holds exactly.
double pair_of(const DaemonConfig& config) {
  constexpr std::size_t digits = 6;
  return static_cast<double>(std::stoull(
      config.model_checksum.substr(0, digits) + config.candidate->checksum.substr(0, digits),
      nullptr, 16));
}

std::unique_ptr<CycleParts> parts_of(const DaemonConfig& config) {
  auto parts = std::make_unique<CycleParts>(Estimator(config.estimator, config.model));
  const std::optional<CandidateModel>& candidate = config.candidate;
  // A promoted candidate is the model itself.
  if (candidate && candidate->problem.empty() && candidate->checksum != config.model_checksum)
    parts->candidate =
        std::make_unique<Candidate>(candidate->estimator, candidate->model, pair_of(config));
  return parts;
}

bool is_reference_whole(const Report& report) {
  return std::all_of(report.inputs.begin(), report.inputs.end(), [](const InputReport& input) {
    return input.good && std::isfinite(input.reference_degC);
  });
}

}  // namespace

std::unique_ptr<CycleParts> make_cycle_parts(const DaemonConfig& config, HistoryWriter* history) {
  auto parts = parts_of(config);
  add_recorder(*parts, config, history);
  return parts;
}

/// Configuration and parts, loaded on a side thread, since this takes time and the disk may hang.
struct Operations::Loaded {
  DaemonConfig config;
  std::unique_ptr<CycleParts> parts;
  std::exception_ptr error;  ///< set: config and parts are unusable

  void load(const std::filesystem::path& file,
            const std::optional<std::filesystem::path>& candidate) noexcept {
    try {
      config = load_daemon_config(file);
      if (candidate) set_candidate(config, *candidate);
      parts = parts_of(config);
    } catch (...) {
      error = std::current_exception();
    }
  }
};

Operations::Operations(Parts parts)
    : parts_(std::move(parts)),
      cycle_(parts_.cycle, [this](const Command& done) { carried_out(done); }) {}

Operations::~Operations() = default;

RpcPending Operations::command(const Command& asked) {
  if (has_index(asked.kind) && cycle_.replacing())
    throw RpcError(rpc::refused, "a reload is in progress: retry when it has finished");
  if (asked.kind == CommandKind::enable && parts_.keeper.is_reference_lost())
    throw RpcError(rpc::refused,
                   "the machine's reference is lost: give `thermocomp reference` first, when the "
                   "machine is cold and even");
  const CycleHandle::Tracked outcome = cycle_.send(asked, Clock::now());
  if (!outcome) throw RpcError(rpc::refused, "too many commands wait for the cycle");
  note_asked(asked, outcome);
  return [this, outcome, kind = asked.kind,
          save = std::optional<Save>()]() mutable -> std::optional<json> {
    poll();
    if (!is_done(*outcome, "command")) return std::nullopt;
    // carried_out() has handed the changed state to the keeper.
    if (!save) save = {parts_.keeper.serial(), Clock::now() + disk_patience};
    if (!is_settled(*save, kind)) return std::nullopt;
    return json{{"done", true}};
  };
}

/// True if the command's change is on disk or need not be. @throws RpcError if saving failed
bool Operations::is_settled(const Save& save, CommandKind kind) const {
  const StateKeeper::Saving saving = parts_.keeper.saving(save.serial);
  if (saving == StateKeeper::Saving::under_way && Clock::now() < save.deadline) return false;
  if (saving == StateKeeper::Saving::on_disk || !is_kept(kind)) return true;
  throw RpcError(rpc::internal_error,
                 "carried out, but not saved, so that a restart would undo it: " +
                     (saving == StateKeeper::Saving::under_way
                          ? std::string("the disk does not answer; it is saved as soon as it does")
                          : parts_.keeper.error()));
}

RpcPending Operations::reload(const std::optional<std::filesystem::path>& candidate) {
  begin_reload(candidate);
  reload_->by = asking();
  reload_->is_asked = true;
  return [this, answer = reload_->answer,
          late = Clock::now() + CycleHandle::patience]() -> std::optional<json> {
    poll();
    if (answer->error) std::rethrow_exception(answer->error);
    if (answer->outcome) {
      if (!is_done(*answer->outcome, "new configuration")) return std::nullopt;
      return json{{"done", true}};
    }
    if (Clock::now() < late) return std::nullopt;
    throw RpcError(
        rpc::internal_error,
        fmt::format(
            "reading the files and building the model takes more than {} s; the reload continues",
            patience_s));
  };
}

void Operations::reload_by_signal() {
  reload_again_ = reload_.has_value();
  if (reload_again_) return;
  try {
    begin_reload(std::nullopt);
  } catch (const std::exception& error) {
    spdlog::error("reload: {}", error.what());
  }
}

void Operations::begin_reload(const std::optional<std::filesystem::path>& candidate) {
  if (reload_) throw RpcError(rpc::refused, "a reload is in progress: retry when it has finished");
  Reload reload;
  reload.answer = std::make_shared<ReloadAnswer>();
  reload.loaded = std::make_shared<Loaded>();
  reload.thread = std::make_unique<SideThread>("reload");
  reload.candidate = candidate ? candidate : candidate_;
  reload.thread->start([loaded = reload.loaded, file = parts_.config.file,
                        named = reload.candidate] { loaded->load(file, named); });
  reload_ = std::move(reload);
  parts_.service.reloading();
}

/// Hands the new parts to the cycle once the files are read.
void Operations::finish_loading() {
  if (!reload_ || reload_->answer->outcome || reload_->thread->is_busy()) return;
  const std::shared_ptr<Loaded> loaded = std::exchange(reload_->loaded, nullptr);
  reload_->thread.reset();
  try {
    if (loaded->error) std::rethrow_exception(loaded->error);
    const std::vector<std::string> fixed = restart_needed(parts_.config, loaded->config);
    if (!fixed.empty())
      throw RpcError(rpc::refused,
                     fmt::format("nothing was taken, the running configuration stays: a "
                                 "restart is needed for a change of {}",
                                 fmt::join(fixed, ", ")));
    add_recorder(*loaded->parts, loaded->config, parts_.history);
    loaded->parts->estimator.plan_adoption(parts_.cycle.parts().estimator);
    if (loaded->parts->candidate)
      loaded->parts->candidate->plan_adoption(parts_.cycle.parts().estimator);
    loaded->parts->promotes = parts_.config.candidate &&
                              parts_.config.candidate->checksum == loaded->config.model_checksum;
    reload_->next = std::move(loaded->config);
    reload_->answer->outcome = cycle_.replace(std::move(loaded->parts), Clock::now());
  } catch (const std::exception& error) {
    note_refused(error.what());
    reload_->answer->error = std::current_exception();
    loaded->config = {};
    malloc_trim(0);  // locked memory of the refused parts is not returned otherwise
    end_reload();
  }
}

/// A client is answered; after a SIGHUP the log, an event and the status tell the reason.
void Operations::note_refused(const std::string& why) {
  const std::string line = why.substr(0, why.find('\n'));
  if (!reload_->is_asked) {
    spdlog::error("reload refused, the running configuration stays:\n{}", why);
    reload_problem_ = "the last reload was refused: " + line;
  }
  if (parts_.journal == nullptr) return;
  Event event = command_event("reload", reload_->by);
  event.detail = "refused: " + line;
  parts_.journal->command(std::move(event));
}

void Operations::end_reload() {
  reload_.reset();
  parts_.service.ready(parts_.status_line());
  if (std::exchange(reload_again_, false)) reload_by_signal();
}

void Operations::poll() {
  cycle_.poll(Clock::now());
  parts_.keeper.poll(Clock::now());
  report_saved(false);
  finish_loading();
  finish_reload();
}

void Operations::settle() {
  reload_again_ = false;
  cycle_.settle();
  finish_reload();
}

void Operations::finish_reload() {
  if (!reload_ || !reload_->answer->outcome) return;
  const Outcome outcome = *reload_->answer->outcome;
  if (outcome == Outcome::waiting) return;
  if (outcome == Outcome::overdue) {
    if (!std::exchange(reload_->is_overdue_reported, true))
      spdlog::error("reload: the cycle has the new configuration in hand and does not finish");
    return;
  }
  if (outcome == Outcome::done) {
    Event event = command_event("reload", reload_->by);
    event.detail = changes_of(parts_.config, reload_->next);
    parts_.config = std::move(reload_->next);
    candidate_ = reload_->candidate;
    reload_problem_.clear();
    set_log_level(parts_.config.log_level);
    note_reference(parts_.cycle.parts().estimator.persistent_state(parts_.cycle.report()),
                   ReferenceOrigin::reload);
    if (parts_.journal != nullptr) parts_.journal->command(std::move(event));
    spdlog::info("reloaded: model {} (SHA-256 {})", parts_.config.model_file.string(),
                 parts_.config.model_checksum);
  } else {
    spdlog::error(
        "reload: the cycle did not take the new configuration within {} s; the running "
        "one stays",
        patience_s);
  }
  end_reload();
}

void Operations::carried_out(const Command& done) {
  if (done.kind == CommandKind::stop || done.kind == CommandKind::saved)
    return;  // not from an operator
  Event event = command_event(to_string(done.kind), take_asking(done));
  if (names_axis(done.kind))
    event.subject = {SubjectKind::axis, parts_.config.estimator.axes[done.axis].name};
  if (done.kind == CommandKind::accept)
    event.subject = {SubjectKind::sensor, parts_.config.estimator.sensors[done.axis].name};
  if (done.kind == CommandKind::measured || done.kind == CommandKind::prove)
    event.value = done.value_um;
  if (const auto& beside = parts_.cycle.parts().candidate;
      beside && done.kind == CommandKind::measured)
    event.candidate = candidate_of(parts_.config, &beside->score());
  spdlog::info("operator: {}", what_text(event));
  if (parts_.journal != nullptr) parts_.journal->command(std::move(event));
  if (done.kind == CommandKind::reference && is_reference_whole(parts_.cycle.report())) {
    parts_.keeper.reference_taken();
    // Also recorded if the temperatures equal those of the previous reference.
    parts_.reference_before_degC.clear();
    note_reference(parts_.cycle.parts().estimator.persistent_state(parts_.cycle.report()),
                   ReferenceOrigin::command);
  }
  // The client is answered once this is on disk: is_settled().
  save_state(true);
}

void Operations::note_reference(const PersistentState& state, ReferenceOrigin origin) {
  if (state.reference_degC == parts_.reference_before_degC) return;
  parts_.reference_before_degC = state.reference_degC;
  parts_.keeper.note_reference({wall_now_s(), origin});
}

void Operations::doubt_reference(const std::string& changed) {
  ReferenceRecord record = parts_.keeper.reference();
  record.changed = changed;
  parts_.keeper.note_reference(record);
}

void Operations::note_asked(const Command& asked, const CycleHandle::Tracked& outcome) {
  std::erase_if(asked_, [](const Asked& old) { return *old.outcome == Outcome::withdrawn; });
  asked_.push_back({asked, outcome, asking()});
}

Event Operations::command_event(std::string_view code, const Asking& by) {
  Event event;
  event.kind = EventKind::command;
  event.code = code;
  event.user = by.user;
  event.asked_for = by.asked_for;
  return event;
}

/// The client that sent the command.
Operations::Asking Operations::take_asking(const Command& done) {
  const auto is_it = [&](const Asked& each) {
    return each.command.kind == done.kind && each.command.axis == done.axis &&
           each.command.value_um == done.value_um && *each.outcome != Outcome::withdrawn;
  };
  const auto found = std::find_if(asked_.begin(), asked_.end(), is_it);
  if (found == asked_.end()) return {};
  Asking by = found->by;
  asked_.erase(found);
  return by;
}

void Operations::save_state(bool at_once) {
  PersistentState state = parts_.cycle.parts().estimator.persistent_state(parts_.cycle.report());
  note_reference(state, ReferenceOrigin::first_values);
  if (const auto& candidate = parts_.cycle.parts().candidate) candidate->add_to(state.correction);
  state.controller = controller_identity(parts_.config.controller);
  if (parts_.config.dry_run) {
    // A dry run sends nothing: the saved offsets stay valid.
    const PersistentState& before = parts_.keeper.on_disk().state;
    state.offset_um = before.offset_um;
    state.corridor_um = before.corridor_um;
    state.sign = before.sign;
    state.controller = before.controller;
  }
  if (at_once)
    parts_.keeper.save(state, Clock::now());
  else
    parts_.keeper.note(state, Clock::now());
  report_saved(!at_once);
  const std::string& error = parts_.keeper.error();
  if (!error.empty() && error != reported_save_error_) spdlog::error("{}", error);
  reported_save_error_ = error;
}

/// Reports a newer state on disk to the estimator.
/// @param again  also reports an unchanged one if an axis waits and no write is under way
void Operations::report_saved(bool again) {
  const std::vector<AxisReport>& axes = parts_.cycle.report().axes;
  const bool is_waited_for = again && !parts_.keeper.is_busy() && parts_.keeper.error().empty() &&
                             std::any_of(axes.begin(), axes.end(), [](const AxisReport& axis) {
                               return axis.waits_for_disk;
                             });
  const SavedState& on_disk = parts_.keeper.on_disk();
  if (on_disk.serial == reported_serial_ && !is_waited_for) return;
  if (cycle_.replacing() || (saved_notice_ && *saved_notice_ == Outcome::waiting)) return;
  reported_serial_ = on_disk.serial;
  if (parts_.config.dry_run) return;
  for (const Command& saved : saved_commands(parts_.config.estimator, on_disk.state))
    saved_notice_ = cycle_.send(saved, Clock::now());
}

}  // namespace thermocomp
