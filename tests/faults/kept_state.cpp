#include "kept_state.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "config/daemon/daemon_config.hpp"
#include "daemon/controller_lock.hpp"
#include "daemon/state/state_file.hpp"

namespace thermocomp::faults {
namespace {

constexpr nanoseconds offsets_saved_every = std::chrono::seconds(10);

}  // namespace

KeptState::KeptState(std::filesystem::path folder, std::uint64_t seed,
                     const FaultSchedule& schedule)
    : folder_(std::move(folder)), chance_(seed, 14), schedule_(schedule) {
  std::filesystem::remove_all(folder_);
  std::filesystem::create_directories(folder_);
}

KeptState::~KeptState() {
  record_.reset();
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

StartState KeptState::boot(const MachineShape& shape) {
  DaemonConfig config;
  config.state_file = folder_ / "state.json";
  config.estimator = shape.estimator;
  config.model = shape.model;
  config.controller = shape.controller;
  config.history.enabled = false;
  record_ = std::make_unique<LastSent>(folder_ / "sent", "cnc", shape.estimator.axes);
  StartState start = find_start_state(config, record_->before());
  on_disk_ = start.state;
  is_on_disk_ = start.is_on_disk;
  writing_.reset();
  waiting_.reset();
  return start;
}

std::vector<Command> KeptState::note(const PersistentState& now_is, const MachineShape& shape,
                                     nanoseconds now, bool is_waited_for) {
  PersistentState state = now_is;
  state.controller = controller_identity(shape.controller);
  std::vector<Command> saved;
  if (writing_ && writing_->done_at <= now) {
    const Save done = *std::exchange(writing_, std::nullopt);
    if (schedule_.find(FaultKind::history_disk_full, now) == nullptr) {
      write(done.state);
      saved = saved_commands(shape.estimator, on_disk_);
    }
    if (waiting_) begin(*std::exchange(waiting_, std::nullopt), now);
  }
  const PersistentState& newest = waiting_ ? *waiting_ : writing_ ? writing_->state : on_disk_;
  if (!is_on_disk_ || must_be_saved(state, newest) ||
      (now >= next_offsets_ && state.offset_um != newest.offset_um)) {
    next_offsets_ = now + offsets_saved_every;
    if (writing_)
      waiting_ = state;
    else
      begin(state, now);
  } else if (!writing_ && is_waited_for) {
    saved = saved_commands(shape.estimator, on_disk_);
  }
  return saved;
}

void KeptState::begin(PersistentState state, nanoseconds now) {
  const double takes_s = chance_.one_in(4) ? chance_.between(1.0, 60.0) : chance_.between(0.0, 0.3);
  writing_ = {std::move(state), now + nanoseconds{static_cast<nanoseconds::rep>(1e9 * takes_s)}};
}

void KeptState::write(const PersistentState& state) {
  const std::string problem = save_state_file(folder_ / "state.json", state);
  if (!problem.empty()) throw std::runtime_error(problem);
  on_disk_ = state;
  is_on_disk_ = true;
}

void KeptState::kill() {
  // A write in progress either completes or never began.
  if (writing_ && chance_.one_in(2)) write(writing_->state);
  record_.reset();
}

void KeptState::cut_power() {
  kill();
  std::filesystem::remove(folder_ / "sent");
}

bool KeptState::is_behind(const PersistentState& then, const std::string& axis) const {
  const auto width = then.corridor_um.find(axis);
  if (width == then.corridor_um.end()) return on_disk_.corridor_um.contains(axis);
  const auto on_disk = on_disk_.offset_um.find(axis);
  return on_disk != on_disk_.offset_um.end() &&
         std::abs(on_disk->second - then.offset_um.at(axis)) > width->second;
}

void KeptState::end(const PersistentState& state) {
  if (writing_) write(writing_->state);
  PersistentState last = state;
  last.controller = on_disk_.controller;  // exists since the first run
  write(last);
  record_.reset();
}

}  // namespace thermocomp::faults
