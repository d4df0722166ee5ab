#include "life.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <memory>

#include "estimator/checks.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "history_disk.hpp"
#include "kept_state.hpp"
#include "recorded_twin.hpp"
#include "simulated_daemon.hpp"

namespace thermocomp::faults {
namespace {

constexpr nanoseconds life_begin = std::chrono::hours(1);
constexpr nanoseconds saved_every = std::chrono::seconds(10);
/// WatchdogSec and RestartSec of the service.
constexpr nanoseconds watchdog = std::chrono::seconds(5);
constexpr nanoseconds restarted_after = std::chrono::seconds(2);

class Life {
 public:
  explicit Life(const LifeOptions& options)
      : options_(options),
        shape_(options.seed, options.cycle_hz),
        schedule_(options.seed,
                  {life_begin, nanoseconds{static_cast<nanoseconds::rep>(options.hours * 3600e9)},
                   1.0, static_cast<std::size_t>(options.seed * 17 % fault_pairs), options.only}),
        world_(options.seed, shape_, schedule_),
        chance_(options.seed, 5),
        probings_(options.seed, 6),
        releases_(options.seed, 8),
        power_cuts_(options.seed, 15),
        offers_(options.seed, 16),
        gains_{probings_.between(0.4, 2.0), probings_.between(0.4, 2.0)},
        judge_(shape_, schedule_, world_.thermocouples),
        end_(life_begin + nanoseconds{static_cast<nanoseconds::rep>(options.hours * 3600e9)}) {
    world_.now = life_begin;
    saved_.enabled = true;
    if (!options.history_folder.empty())
      disk_ = std::make_unique<HistoryDisk>(options.history_folder, options.seed, schedule_);
    if (!reads_back(options.seed))
      kept_ = std::make_unique<KeptState>(options.state_folder, options.seed, schedule_);
  }

  LifeResult live() {
    while (world_.now < end_ && !judge_.broken()) run_daemon();
    if (disk_ && !judge_.broken()) {
      const std::string lost = disk_->verify();
      judge_.demand(lost.empty(), "no_committed_history_lost", world_.now, lost);
      result_.commits = disk_->commits();
    }
    result_.machine_hours = to_s(world_.now - life_begin) / 3600.0;
    result_.faults = schedule_.counts();
    result_.pairs = schedule_.pairs();
    result_.broken = judge_.broken();
    return result_;
  }

 private:
  void run_daemon() {
    const nanoseconds period{static_cast<nanoseconds::rep>(1e9 / options_.cycle_hz)};
    grid_ = {world_.now, period};
    for (nanoseconds& clock : world_.clocks) clock = std::max(clock, world_.now);
    twin_ = disk_ ? nullptr : std::make_unique<RecordedTwin>(grid_);
    if (disk_) disk_->boot(grid_, world_.now);
    auto parts = make_cycle_parts();
    world_.controller.daemon_starts();
    double leap_um = 0.0;
    if (kept_ && restarted_) {
      saved_ = kept_->boot(shape_).state;
      if (power_was_cut_ && !shows_registers(options_.seed))
        leap_um = shape_.estimator.compensation.restart_leap_um_max;
    } else if (kept_) {
      static_cast<void>(kept_->boot(shape_));
    }
    const auto refused = parts->estimator.restore(saved_);
    judge_.demand(refused.empty(), "state_survives_restart", world_.now, "a reference was refused");
    report_ = parts->estimator.make_report();
    judge_.booted(world_.now, leap_um);
    // The first value becomes the reference; later starts already have one.
    if (!restarted_) world_.thermocouples.no_spikes_before(world_.now + std::chrono::seconds(15));
    if (restarted_)
      judge_.restored(saved_, report_, shape_.model.temperature_columns(), world_.now);
    SimulatedDaemon daemon(shape_, world_, grid_, std::move(parts),
                           kept_ ? kept_->record() : nullptr);
    daemon_ = &daemon;
    std::uint64_t cycle = daemon.cycle().begin(world_.now);
    while (!judge_.broken()) {
      world_.now = grid_.time_of(cycle);
      if (world_.now >= end_ || killed()) break;
      step(cycle);
      cycle = daemon.cycle().next_after(cycle, done_at());
    }
    finish();
    daemon_ = nullptr;
    restarted_ = true;
    ++result_.restarts;
    wait_for_restart();
  }

  std::unique_ptr<CycleParts> make_cycle_parts() {
    auto parts = std::make_unique<CycleParts>(Estimator(shape_.estimator, shape_.model));
    parts->recorder =
        disk_ ? disk_->make_recorder(parts->estimator) : twin_->make_recorder(parts->estimator);
    return parts;
  }

  void step(std::uint64_t cycle) {
    print_faults();
    const bool main_works = stall() == nullptr;
    if (main_works) serve();
    daemon_->cycle().step(cycle);
    if (main_works) static_cast<void>(daemon_->cycle().take_retired());
    daemon_->cycle().parts().estimator.report(report_);
    world_.controller.advance(world_.now);
    const CycleSeen seen{world_.now,
                         daemon_->readings(),
                         &daemon_->link().seen(),
                         &daemon_->link().offered(),
                         &report_,
                         &shape_};
    if (options_.verbose) record(seen);
    judge_.check(seen, world_.controller.moves(), world_.controller);
    if (options_.verbose && judge_.broken()) print_last_cycles();
    if (main_works) save_state();
    if (report_.mode == Mode::compensating) ++result_.compensating;
    ++result_.cycles;
    if (disk_) {
      disk_->work(world_.now);
    } else if (const auto different = twin_->stepped(cycle, daemon_->link().offered())) {
      judge_.demand(false, "replay_is_exact", world_.now,
                    fmt::format("cycle {} came out different", *different));
    }
  }

  /// Work of the main thread between two cycles.
  void serve() {
    operate();
    release();
    accept();
    probe();
    if (!reload()) release_model();
  }

  /// The current stall of the main thread, except one already ended by a watchdog kill.
  [[nodiscard]] const FaultEvent* stall() const {
    const FaultEvent* found = schedule_.find(FaultKind::main_stands_still, world_.now);
    return found != nullptr && found->number != last_stall_ ? found : nullptr;
  }

  [[nodiscard]] bool killed() {
    // With offsets only in the state file, kills alone are too rare: add power cuts.
    power_was_cut_ =
        kept_ && power_cuts_.one_in(static_cast<std::uint64_t>(900 * options_.cycle_hz));
    if (power_was_cut_) return true;
    const FaultEvent* long_stall = stall();
    watchdog_bit_ = long_stall != nullptr && world_.now - long_stall->begin > watchdog;
    if (watchdog_bit_) last_stall_ = long_stall->number;
    if (watchdog_bit_) return true;
    const FaultEvent* kill = schedule_.find(FaultKind::daemon_killed, world_.now);
    if (kill == nullptr || kill->number == last_kill_) return false;
    last_kill_ = kill->number;
    return true;
  }

  void wait_for_restart() {
    if (world_.now >= end_) return;
    const FaultEvent* kill = schedule_.find(FaultKind::daemon_killed, world_.now);
    if (kill != nullptr) world_.now = kill->end;
    if (power_was_cut_) world_.now += std::chrono::seconds(20);
    if (watchdog_bit_) world_.now += restarted_after;
    if (options_.verbose)
      fmt::print("{:>10.1f} s  the daemon starts again{}\n", life_s(),
                 power_was_cut_ ? " after a power cut" : "");
  }

  /// Every other kill is an orderly end by the service manager.
  void finish() {
    const std::optional<std::uint64_t> ended =
        last_kill_ % 2 == 0 && !power_was_cut_ && !watchdog_bit_
            ? daemon_->cycle().finish_recording()
            : std::nullopt;
    if (disk_ && ended) {
      disk_->end(*ended, world_.now);
    } else if (disk_) {
      disk_->kill(world_.now);
    } else if (!judge_.broken()) {  // a twin that differs is not continued
      if (const auto different = twin_->finish())
        judge_.demand(
            false, "replay_is_exact", world_.now,
            fmt::format("cycle {} came out different or was recorded out of order", *different));
    }
    if (twin_) result_.replayed += twin_->replayed();
    twin_.reset();
    if (kept_) end_kept(ended.has_value());
  }

  void end_kept(bool in_order) {
    const PersistentState then = daemon_->cycle().parts().estimator.persistent_state(report_);
    if (in_order) return kept_->end(then);
    if (!power_was_cut_) return kept_->kill();
    kept_->cut_power();
    // The file of a driven axis is never outdated.
    for (std::size_t i = 0; i < axes_count; ++i)
      if (!report_.axes[i].driven && kept_->is_behind(then, shape_.estimator.axes[i].name))
        judge_.lost(i);
  }

  [[nodiscard]] nanoseconds done_at() const {
    const FaultEvent* overrun = schedule_.find(FaultKind::cycle_overrun, world_.now);
    return overrun != nullptr ? overrun->end : world_.now + grid_.period / 100;
  }

  void operate() {
    if (!chance_.one_in(static_cast<std::uint64_t>(1500.0 * options_.cycle_hz))) return;
    Command command;
    command.kind = chance_.one_in(2)   ? CommandKind::measured
                   : chance_.one_in(2) ? CommandKind::cycle_end
                                       : CommandKind::prove;
    command.axis = static_cast<std::uint32_t>(chance_.below(axes_count));
    command.value_um = chance_.between(-8.0, 8.0);
    if (command.kind == CommandKind::measured) judge_.probed(command.axis);
    static_cast<void>(daemon_->cycle().send(command));
  }

  /// An operator releases a latched axis after the faults have ended, sometimes during them.
  void release() {
    const Episode* episode = schedule_.episode_at(world_.now);
    const bool well = episode == nullptr || world_.now < episode->begin;
    for (std::size_t axis = 0; axis < axes_count; ++axis) {
      set_to_zero(axis, well);
      if (!report_.axes[axis].latched || report_.axes[axis].releasing) continue;
      if (!releases_.one_in(static_cast<std::uint64_t>((well ? 5.0 : 60.0) * options_.cycle_hz)))
        continue;
      const Command command{CommandKind::release, static_cast<std::uint32_t>(axis), 0.0};
      if (!daemon_->cycle().send(command)) continue;
      // The nodes of a travel are released together.
      const AxisSpan released = span_of(shape_.estimator.axes, axis);
      for (std::size_t i = released.first; i < released.end(); ++i) judge_.released(i);
    }
  }

  /// An operator accepts a sensor that is right but unconfirmed.
  void accept() {
    for (std::size_t i = 0; i < sensors_count; ++i) {
      const double shown_degC = report_.sensors[i].raw_degC;
      const bool is_right =
          std::abs(shown_degC - world_.thermocouples.plausible_degC(i, world_.now)) < 0.5;
      if (report_.sensors[i].fault != Fault::unconfirmed || !is_right)
        unconfirmed_since_[i] = world_.now;
      if (to_s(world_.now - unconfirmed_since_[i]) < 30.0) continue;
      static_cast<void>(
          daemon_->cycle().send({CommandKind::accept, static_cast<std::uint32_t>(i), 0.0}));
    }
  }

  /// If the last sent offset is unknown, or the applied one exceeds the bound, the operator zeroes
  /// the offset at the controller and releases the axis.
  void set_to_zero(std::size_t axis, bool well) {
    const bool unknown = report_.axes[axis].start_unknown;
    const bool beyond =
        has_reason(report_.reasons, Reason::applied_out_of_bound) &&
        std::abs(world_.controller.applied_um(axis)) >
            shape_.estimator.axes[axis].limiter.offset_um_max + register_rounding_um;
    if (!well || !(unknown || beyond)) return;
    if (!releases_.one_in(static_cast<std::uint64_t>(8.0 * options_.cycle_hz))) return;
    const AxisSpan span = span_of(shape_.estimator.axes, axis);
    for (std::size_t i = span.first; i < span.end(); ++i) world_.controller.set_to_zero(i);
    const Command command{CommandKind::release, static_cast<std::uint32_t>(axis), 0.0};
    if (unknown) static_cast<void>(daemon_->cycle().send(command));
  }

  [[nodiscard]] bool once_in(double period_s) {
    return probings_.one_in(static_cast<std::uint64_t>(period_s * options_.cycle_hz));
  }

  /// Random, unreliable cycle ends, probings and new references: cycle ends are doubled or missing
  /// for long; probings are far off, minutes old, not numbers, doubled or missing.
  void probe() {
    if (!corrects_itself(options_.seed)) return;
    if (once_in(45.0)) {
      const bool twice = probings_.one_in(4);
      for (int i = 0; i <= static_cast<int>(twice); ++i)
        static_cast<void>(daemon_->cycle().send({CommandKind::cycle_end, 0, 0.0}));
    }
    if (once_in(1200.0)) {
      static_cast<void>(daemon_->cycle().send({CommandKind::reference, 0, 0.0}));
      judge_.referenced();
    }
    if (!once_in(60.0)) return;
    const std::size_t axis = probings_.below(axes_count);
    const double before_um = probed_um_[axis];
    probed_um_[axis] = measured_um(axis);
    switch (probings_.below(10)) {
      case 0:
        return;
      case 1:
        return send_probing(axis, 80.0 * probed_um_[axis]);
      case 2:
        return send_probing(axis, before_um);
      case 3:
        return send_probing(axis, not_a_number);
      case 4:
        send_probing(axis, probed_um_[axis]);
        [[fallthrough]];
      default:
        return send_probing(axis, probed_um_[axis]);
    }
  }

  void send_probing(std::size_t axis, double value_um) {
    const Command command{CommandKind::measured, static_cast<std::uint32_t>(axis), value_um};
    static_cast<void>(daemon_->cycle().send(command));
    judge_.probed(axis);
  }

  /// Indicated displacement of a machine whose input groups have gains of their own.
  [[nodiscard]] double measured_um(std::size_t axis) {
    double total_um = report_.displacement_um[axis] + probings_.between(-1.0, 1.0);
    const std::array<double, 2> part_um = contributions_um(shape_, report_, axis);
    for (std::size_t g = 0; g < part_um.size(); ++g) total_um += (gains_[g] - 1.0) * part_um[g];
    if (shape_.estimator.correction.measured == MeasuredMeaning::total) return total_um;
    return total_um + shape_.estimator.axes[axis].sign * world_.controller.applied_um(axis);
  }

  /// A new configuration and model at the beginning of the fault; a broken model is refused.
  bool reload() {
    const FaultEvent* fault = schedule_.find(FaultKind::model_reload, world_.now);
    if (fault == nullptr || fault->number == last_reload_) return false;
    last_reload_ = fault->number;
    ++result_.reloads;
    refuse_broken_model();
    model_before_.reset();
    shape_.change_for_reload(chance_);
    judge_.reloaded(shape_);
    hand_over(make_cycle_parts());
    return true;
  }

  void hand_over(std::unique_ptr<CycleParts> parts) {
    parts->estimator.plan_adoption(daemon_->cycle().parts().estimator);
    if (parts->candidate) parts->candidate->plan_adoption(daemon_->cycle().parts().estimator);
    daemon_->cycle().hand_over(std::move(parts));
  }

  /// Release of another model at random times, one step each: it runs as candidate, is promoted,
  /// and taken back; or dropped if the daemon was restarted or reloaded meanwhile.
  void release_model() {
    if (!offers_.one_in(static_cast<std::uint64_t>(600.0 * options_.cycle_hz))) return;
    const bool runs_beside = daemon_->cycle().parts().candidate != nullptr;
    if (model_before_) {
      shape_.model = *std::exchange(model_before_, std::nullopt);
      ++result_.taken_back;
      return hand_over(make_cycle_parts());
    }
    if (runs_beside) {
      model_before_ = shape_.model;
      shape_.model = daemon_->cycle().parts().candidate->estimator().model();
      ++result_.promotions;
      auto parts = make_cycle_parts();
      parts->promotes = true;
      return hand_over(std::move(parts));
    }
    auto parts = make_cycle_parts();
    EstimatorConfig beside = shape_.estimator;
    beside.correction.form = CorrectionForm::off;
    parts->candidate = std::make_unique<Candidate>(beside, shape_.offered_model(offers_), 1.0);
    hand_over(std::move(parts));
  }

  void refuse_broken_model() {
    ThermalModel broken = shape_.model;
    switch (chance_.below(3)) {
      case 0:
        broken.matrix_um_per_K[1][2] = not_a_number;
        break;
      case 1:
        broken.matrix_um_per_K.pop_back();
        break;
      default:
        broken.outputs[1] = "b_um";
        break;
    }
    try {
      const Estimator estimator(shape_.estimator, broken);
      judge_.demand(false, "no_offset_from_invalid_model", world_.now,
                    "a model that cannot be was taken");
    } catch (const InvalidValue&) {
    }
  }

  /// Like the daemon: switches and references at once, offsets every 10 s.
  void save_state() {
    const PersistentState state = daemon_->cycle().parts().estimator.persistent_state(report_);
    if (kept_) {
      const bool waits = std::any_of(report_.axes.begin(), report_.axes.end(),
                                     [](const AxisReport& axis) { return axis.waits_for_disk; });
      for (const Command& saved : kept_->note(state, shape_, world_.now, waits))
        static_cast<void>(daemon_->cycle().send(saved));
      return;
    }
    if (world_.now < next_save_ && !must_be_saved(state, saved_)) return;
    next_save_ = world_.now + saved_every;
    saved_ = state;
  }

  [[nodiscard]] double life_s() const { return to_s(world_.now - life_begin); }

  void print_faults() {
    if (!options_.verbose) return;
    if (const Episode* episode = schedule_.episode_at(world_.now)) {
      for (const FaultEvent& fault : episode->faults) {
        if (fault.number <= printed_ || fault.begin > world_.now) continue;
        printed_ = fault.number;
        fmt::print("{:>10.1f} s  {} until {:.1f} s, subject {}\n", to_s(fault.begin - life_begin),
                   name_of(fault.kind), to_s(fault.end - life_begin), fault.subject);
      }
    }
    if (report_.mode == printed_mode_) return;
    printed_mode_ = report_.mode;
    fmt::print("{:>10.1f} s  mode {}, reasons {:#x}, offsets {:.3f} {:.3f} {:.3f} um\n", life_s(),
               to_string(report_.mode), report_.reasons, report_.axes[0].offset_um,
               report_.axes[1].offset_um, report_.axes[2].offset_um);
  }

  /// One cycle per line: reported, applied, sent; printed with a broken invariant.
  void record(const CycleSeen& seen) {
    std::string line =
        fmt::format("{:>10.2f} s  {:<15} epoch {}{}", life_s(), to_string(report_.mode),
                    seen.reported->link_epoch, seen.reported->online ? "" : " offline");
    for (std::size_t i = 0; i < axes_count; ++i)
      line +=
          fmt::format("  {:.4f}{}", seen.command->offset_um[i], seen.command->valid[i] ? "" : "!") +
          fmt::format(" (told {:.4f}, is {:.4f})", seen.reported->applied_um[i],
                      world_.controller.applied_um(i));
    for (std::size_t i = 0; i < sensors_count; ++i)
      if (seen.readings[i].fault != Fault::none || report_.sensors[i].fault != Fault::none)
        line += fmt::format("  s{} {}/{}", i + 1, to_string(seen.readings[i].fault),
                            to_string(report_.sensors[i].fault));
    for (const Move& move : world_.controller.moves())
      line += fmt::format("\n{:>16.3f} s  axis {} told {:.4f} where {:.4f}{}{}",
                          to_s(move.at - life_begin), move.axis, move.to_um, move.from_um,
                          move.disturbed ? " disturbed" : "", move.seen ? "" : " unseen");
    last_cycles_.push_back(std::move(line));
    if (last_cycles_.size() > 25) last_cycles_.erase(last_cycles_.begin());
  }

  void print_last_cycles() const {
    for (const std::string& line : last_cycles_) fmt::print("{}\n", line);
  }

  LifeOptions options_;
  MachineShape shape_;
  FaultSchedule schedule_;
  World world_;
  Chance chance_;
  Chance probings_;
  Chance releases_;
  Chance power_cuts_;
  Chance offers_;
  std::array<double, 2> gains_;                 ///< of the machine; those of the model are 1
  std::array<double, axes_count> probed_um_{};  ///< last measurement
  std::array<nanoseconds, sensors_count> unconfirmed_since_{};
  Invariants judge_;
  nanoseconds end_;
  Grid grid_;
  std::unique_ptr<RecordedTwin> twin_;
  std::unique_ptr<HistoryDisk> disk_;
  std::unique_ptr<KeptState> kept_;  ///< none: the controller has read-back
  bool power_was_cut_{false};
  bool watchdog_bit_{false};  ///< the main thread stalled for too long
  SimulatedDaemon* daemon_{nullptr};
  Report report_;
  PersistentState saved_;
  bool restarted_{false};
  nanoseconds next_save_{};
  std::uint64_t last_kill_{0};
  std::uint64_t last_stall_{0};  ///< the last one ended by the service manager
  std::uint64_t last_reload_{0};
  std::optional<ThermalModel> model_before_;  ///< since a promotion
  std::uint64_t printed_{0};
  Mode printed_mode_{Mode::starting};
  std::vector<std::string> last_cycles_;
  LifeResult result_;
};

}  // namespace

LifeResult live(const LifeOptions& options) {
  return Life(options).live();
}

}  // namespace thermocomp::faults
