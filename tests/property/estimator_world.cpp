#include "estimator_world.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "../invariant_list.hpp"
#include "random_machine.hpp"

namespace thermocomp::property {
namespace {

constexpr double step_s_usual_max = 0.5;
constexpr double tiny_um = 1e-9;
constexpr double register_rounding_um = 0.1;
// First read-backs of a new link may be late or missing; until then an axis may be held.
constexpr int reads_until_written = 6;
constexpr double nothing_um = 0.3;  // largest read-back counted as zero

nanoseconds from_seconds(double seconds) {
  return std::chrono::duration_cast<nanoseconds>(seconds_d(seconds));
}

/// A controller with its link: applies valid offsets of its epoch and reports them.
struct Controller {
  std::array<double, axes_count> applied_um{};
  std::array<double, axes_count> read_back_um{};  ///< last read-back in the epoch; NaN: none
  std::uint32_t epoch{0};
  bool connected{false};
  bool exchanging{false};  ///< reads and writes in this step
  bool rejecting{false};
  /// Axes whose applied offset may differ from the sent one by the tolerance.
  std::array<bool, axes_count> disturbed{};
};

class World {
 public:
  World(std::uint64_t seed, const WorldOptions& options)
      : options_(options),
        shape_(seed, 1),
        time_(seed, 2),
        heat_(seed, 3),
        sensors_(seed, 4),
        link_(seed, 5),
        operator_(seed, 6),
        config_(random_config(shape_)),
        model_(random_model(shape_)) {
    if (options_.lost_from) config_.compensation.on_loss = LossPolicy::hold;
    if (options_.travel) lay_out_travel(shape_, config_, model_);
    remember_comparison();
    estimator_ = std::make_unique<Estimator>(planted(config_), model_);
    report_ = estimator_->make_report();
    readings_.resize(sensors_count);
  }

  Outcome live() {
    for (step_ = 0; step_ < options_.steps && !outcome_.violation; ++step_) {
      pass_time();
      change_estimator();
      operate();
      sense();
      exchange();
      step();
      check_offsets();
      deliver();
    }
    return outcome_;
  }

 private:
  [[nodiscard]] EstimatorConfig planted(EstimatorConfig config) const {
    for (AxisConfig& axis : config.axes) {
      if (options_.planted == Planted::double_rate) axis.limiter.rate_um_per_s_max *= 2;
      if (options_.planted == Planted::larger_bound) axis.limiter.offset_um_max *= 2;
    }
    if (options_.planted == Planted::domain_ignored)
      config.compensation.outside_domain = OutsidePolicy::warn;
    return config;
  }

  void pass_time() {
    double step_s = time_.between(0.05, step_s_usual_max);
    if (time_.one_in(20)) step_s = 0.0;
    if (time_.one_in(30)) step_s = time_.between(1.0, 15.0);
    now_ += from_seconds(step_s);
    busy_s_ += std::min(step_s, step_s_usual_max);
    // Rounded to nanoseconds, as in the estimator.
    dt_s_ = estimator_stepped_ ? 1e-9 * static_cast<double>(from_seconds(step_s).count()) : 0.0;
    for (double& temp_degC : temps_degC_) temp_degC += heat_.between(-0.05, 0.06);
  }

  void change_estimator() {
    if (options_.reload_state_at && *options_.reload_state_at == step_) load_saved_state();
    if (shape_.one_in(60)) reload();
    if (options_.promotion_every > 0 && step_ % options_.promotion_every == 0) promote();
    const bool restart_now = shape_.one_in(150);
    if (restart_now && !options_.lost_from) restart();
  }

  void load_saved_state() {
    std::vector<std::byte> state(estimator_->state_size_bytes());
    estimator_->save_state(state);
    auto next = std::make_unique<Estimator>(planted(config_), model_);
    if (options_.planted != Planted::forgotten_state) next->load_state(state);
    estimator_ = std::move(next);
  }

  void reload() {
    ++outcome_.reloads;
    config_ = random_config(shape_);
    remember_comparison();
    if (options_.lost_from) config_.compensation.on_loss = LossPolicy::hold;
    if (shape_.one_in(2)) model_ = random_model(shape_);
    if (options_.travel) lay_out_travel(shape_, config_, model_);
    is_promoted_ = false;
    go_over();
  }

  void go_over() {
    auto next = std::make_unique<Estimator>(planted(config_), model_);
    if (options_.planted != Planted::reload_from_nothing) {
      next->plan_adoption(*estimator_);
      next->adopt(*estimator_);
    }
    estimator_ = std::move(next);
    report_ = estimator_->make_report();
  }

  /// Promotes another model, alternately back to the first; bound and slew limit are unchanged.
  void promote() {
    ThermalModel next_model = model_;
    for (auto& row : next_model.matrix_um_per_K)
      for (double& gain : row) gain *= is_promoted_ ? -1.0 / 3.0 : -3.0;
    is_promoted_ = !is_promoted_;
    model_ = next_model;
    go_over();
  }

  /// Restarts the daemon with its state file, possibly an old one, and a new link.
  void restart() {
    ++outcome_.restarts;
    PersistentState state = estimator_->persistent_state(report_);
    for (std::size_t i = 0; i < axes_count; ++i) {
      double offset_um = command_.offset_um[i];
      if (shape_.one_in(3)) offset_um = shape_.between(-1.0, 1.0) * 60.0;
      if (shape_.one_in(20)) offset_um = 1e6;
      state.offset_um[config_.axes[i].name] = offset_um;
      before_um_[i] = std::abs(offset_um) <= offset_um_max_of_any_axis ? offset_um : 0.0;
    }
    estimator_ = std::make_unique<Estimator>(planted(config_), model_);
    demand("state_survives_restart", "a state that was kept is taken",
           estimator_->restore(state).empty(), 0, 0);
    report_ = estimator_->make_report();
    estimator_stepped_ = false;
    dt_s_ = 0.0;
    connect();
  }

  void operate() {
    // Only an operator releases a latched axis, sometimes before the cause has ended.
    for (std::uint32_t axis = 0; axis < axes_count; ++axis)
      if (report_.axes.size() > axis && report_.axes[axis].latched && operator_.one_in(8)) {
        estimator_->apply({CommandKind::release, axis, 0.0});
        released_[axis] = true;
        if (options_.travel && axis > 0)
          for (std::size_t node = 1; node < axes_count; ++node)
            released_[node] = released_[node] || report_.axes[node].latched;
      }
    for (std::uint32_t i = 0; i < report_.sensors.size(); ++i)
      if (report_.sensors[i].waiting && operator_.one_in(200))
        estimator_->apply({CommandKind::accept, i, 0.0});
    if (!operator_.one_in(15)) return;
    const std::array<double, 5> values{operator_.between(-10, 10), operator_.between(-200, 200),
                                       not_a_number, 1e300, 0.5};
    estimator_->apply({static_cast<CommandKind>(operator_.below(6)),
                       static_cast<std::uint32_t>(operator_.below(5)),
                       values[operator_.below(values.size())]});
  }

  void sense() {
    const bool lost = options_.lost_from && step_ >= *options_.lost_from;
    for (std::size_t i = 0; i < sensors_count; ++i) {
      if (lost) {
        if (!options_.lost_are_withheld) readings_[i] = useless_reading(i);
      } else if (!sensors_.one_in(5)) {  // else: no new reading
        readings_[i] = random_reading(i);
      }
    }
  }

  Reading random_reading(std::size_t sensor) {
    const double noise_K = sensors_.between(-0.02, 0.02);
    Reading reading{temps_degC_[sensor] + noise_K, now_ - from_seconds(sensors_.between(0, 0.04)),
                    Fault::none};
    if (frozen_until_[sensor] > step_)
      return readings_[sensor].fault == Fault::none
                 ? Reading{readings_[sensor].temp_degC, reading.taken_at, Fault::none}
                 : reading;
    if (sensors_.one_in(100)) frozen_until_[sensor] = step_ + 5 + sensors_.below(100);
    if (sensors_.one_in(25)) reading.temp_degC += sensors_.between(-15, 15);
    if (sensors_.one_in(15)) return useless_reading(sensor);
    return reading;
  }

  /// Readings that no estimator may accept, whatever came before.
  Reading useless_reading(std::size_t sensor) {
    Reading reading{temps_degC_[sensor] + sensors_.between(-50, 50), now_, Fault::none};
    switch (sensors_.below(6)) {
      case 0:
        reading.fault = static_cast<Fault>(1 + sensors_.below(faults_count - 1));
        break;
      case 1:
        reading.temp_degC = not_a_number;
        break;
      case 2:
        reading.temp_degC = std::numeric_limits<double>::infinity();
        break;
      case 3:
        reading.temp_degC = sensors_.one_in(2) ? -40.0 - sensors_.between(0, 1e6) : 1e4;
        break;
      case 4:
        reading.taken_at = now_ - from_seconds(sensors_.between(6.0, 1e6));
        break;
      default:
        reading.taken_at = now_ + from_seconds(sensors_.between(6.0, 1e6));
        break;
    }
    return reading;
  }

  void connect() {
    ++controller_.epoch;
    controller_.connected = true;
    // A read-back that agrees is taken for a late one, as on an existing link.
    controller_.disturbed.fill(true);
  }

  /// Changes at the controller and the link's reads in this step.
  void exchange() {
    if (link_.one_in(40)) {
      if (controller_.connected)
        controller_.connected = false;
      else
        connect();
    } else if (!controller_.connected && link_.one_in(8)) {
      connect();
    }
    if (controller_.connected && link_.one_in(50)) rehome();
    if (link_.one_in(40)) controller_.rejecting = !controller_.rejecting;
    controller_.exchanging = controller_.connected && !link_.one_in(15);
    if (!controller_.exchanging || controller_.rejecting) controller_.disturbed.fill(true);
    if (controller_.exchanging) read_controller();
    // A new epoch is published together with its first read-back.
    state_.online = controller_.connected && state_.link_epoch == controller_.epoch;
    state_.written = state_.online;
  }

  void rehome() {
    for (std::size_t i = 0; i < axes_count; ++i) {
      controller_.applied_um[i] = link_.one_in(2) ? 0.0 : link_.between(-100.0, 100.0);
      controller_.disturbed[i] = true;
    }
  }

  void read_controller() {
    state_.taken_at = now_;
    const bool is_first = state_.link_epoch != controller_.epoch;
    if (is_first) controller_.read_back_um.fill(not_a_number);
    reads_in_epoch_ = is_first ? 1 : reads_in_epoch_ + 1;
    state_.link_epoch = controller_.epoch;
    for (std::size_t i = 0; i < axes_count; ++i) {
      state_.applied_um[i] = controller_.applied_um[i];
      if (is_first && !controller_.rejecting && std::abs(controller_.applied_um[i]) <= nothing_um)
        controller_.disturbed[i] = false;  // restarted: starts from there
      // No nonsense right after re-homing, which could then not be noticed in time.
      if (link_.one_in(60) && !controller_.disturbed[i]) {
        const std::array<double, 5> nonsense{not_a_number, 1e30, -700.0, 501.0,
                                             std::numeric_limits<double>::infinity()};
        state_.applied_um[i] = nonsense[link_.below(nonsense.size())];
      }
      if (std::isfinite(state_.applied_um[i])) controller_.read_back_um[i] = state_.applied_um[i];
    }
    state_.signals[0] = link_.one_in(50) ? 1e200 : link_.between(0.0, 8000.0);
    state_.signals[1] = link_.one_in(50) ? not_a_number : link_.between(-100.0, 600.0);
    state_.signals[2] = link_.one_in(4) ? 1.0 : 0.0;
    if (link_.one_in(60)) switch_off_ = !switch_off_;
    state_.signals[3] = switch_off_ ? 1.0 : 0.0;
  }

  void step() {
    std::vector<Reading> readings = readings_;
    if (options_.planted == Planted::faults_hidden)
      for (Reading& reading : readings)
        reading = {reading.temp_degC > -30 && reading.temp_degC < 200 ? reading.temp_degC : 25.0,
                   now_, Fault::none};
    ControllerState reported = state_;
    if (options_.planted == Planted::read_back_hidden)
      std::copy(before_um_.begin(), before_um_.end(), reported.applied_um.begin());
    estimator_->step(now_, readings, reported, command_);
    estimator_stepped_ = true;
    estimator_->report(report_);
    if (options_.planted == Planted::always_valid) command_.valid.fill(true);
    if (report_.mode == Mode::compensating) ++outcome_.steps_compensating;
    for (std::size_t i = 0; i < axes_count; ++i) {
      outcome_.trace.push_back(std::bit_cast<std::uint64_t>(command_.offset_um[i]));
      outcome_.trace.push_back(std::bit_cast<std::uint64_t>(report_.axes[i].target_um));
      outcome_.trace.push_back(command_.valid[i] ? 1 : 0);
    }
  }

  void check_offsets() {
    sent_.push_back({busy_s_, command_.offset_um, command_.offset_um});
    // An offset started from a read-back counts as having been applied.
    for (std::size_t i = 0; i < axes_count; ++i)
      if (std::abs(command_.offset_um[i] - state_.applied_um[i]) <=
          step_um_max(i) + register_rounding_um)
        sent_.back().start_um[i] = state_.applied_um[i];
    check_estimates();
    check_domain();
    for (std::size_t i = 0; i < axes_count && !outcome_.violation; ++i) {
      check_offset(i);
      check_valid(i);
      before_um_[i] = command_.offset_um[i];
      outcome_.largest_offset_um = std::max(outcome_.largest_offset_um, std::abs(before_um_[i]));
    }
  }

  void check_estimates() {
    const bool estimating = has_reason(report_.reasons, Reason::block_estimated);
    if (estimating) ++outcome_.steps_estimating;
    demand("no_offset_from_invalid_model", "a lost block is either estimated or holds the offset",
           !(estimating && has_reason(report_.reasons, Reason::block_lost)), 0, 0);
    for (const InputReport& input : report_.inputs) {
      demand("only_finite_numbers",
             "the spread of an estimate is a finite number, none of what is measured",
             input.sd_K >= 0 && input.sd_K < 1e6 && !(input.good && input.sd_K > 0), input.sd_K, 0);
      demand("only_finite_numbers", "an estimate is a finite number",
             !input.estimated || std::isfinite(input.temp_degC), input.temp_degC, 0);
      demand("no_offset_from_invalid_model", "what is compensated with is measured or estimated",
             report_.mode != Mode::compensating || input.good || input.estimated, 0, 0);
    }
    const double most_um = config_.compensation.offset_sd_um_max;
    for (const AxisReport& axis : report_.axes)
      demand("no_offset_from_invalid_model", "what is too uncertain is not compensated with",
             axis.offset_sd_um >= 0 && !(estimating && axis.offset_sd_um > most_um),
             axis.offset_sd_um, most_um);
  }

  /// Leaving and re-entering the domain; check_offset() checks the slew limit.
  void check_domain() {
    const bool outside = model_.made_from && report_.domain.outside;
    if (outside) ++outcome_.steps_outside;
    if (was_outside_ && !outside) ++outcome_.returns;
    demand("domain_kept", "what is outside the domain is told",
           !outside || has_reason(report_.reasons, Reason::outside_domain), 0, 0);
    const bool stays = outside && was_outside_ && report_.mode == Mode::compensating &&
                       config_.compensation.outside_domain == OutsidePolicy::hold;
    for (std::size_t i = 0; i < axes_count && stays && mode_before_ == Mode::compensating; ++i)
      demand("domain_kept", "with hold, an offset outside the domain goes no further",
             !command_.valid[i] || !valid_before_[i] || report_.axes[i].proving ||
                 std::abs(command_.offset_um[i] - before_um_[i]) <= tiny_um ||
                 std::abs(before_um_[i]) > config_.axes[i].limiter.offset_um_max ||
                 std::abs(command_.offset_um[i] - state_.applied_um[i]) <=
                     step_um_max(i) + register_rounding_um,
             command_.offset_um[i] - before_um_[i], 0);
    was_outside_ = outside;
    mode_before_ = report_.mode;
    std::copy_n(command_.valid.begin(), axes_count, valid_before_.begin());
  }

  [[nodiscard]] double step_um_max(std::size_t axis) const {
    return config_.axes[axis].limiter.rate_um_per_s_max * std::min(dt_s_, 1.0) + tiny_um;
  }

  void check_offset(std::size_t axis) {
    const double offset_um = command_.offset_um[axis];
    const double before_um = before_um_[axis];
    const double bound_um = config_.axes[axis].limiter.offset_um_max + tiny_um;
    const double step_um = step_um_max(axis);
    demand("only_finite_numbers", "offset is finite", std::isfinite(offset_um), offset_um, 0);
    demand("offset_within_bound", "no axis beyond what any configuration allows",
           std::abs(offset_um) <= offset_um_max_of_any_axis, offset_um, offset_um_max_of_any_axis);
    const bool may_start = state_.link_epoch != started_on_[axis] || released_[axis];
    // Exception: the offset starts from the read-back, only on a new link or after a release.
    if (!(std::abs(offset_um - before_um) <= step_um) ||
        !(std::abs(offset_um) <= std::max(bound_um, std::abs(before_um)))) {
      // A saved offset beyond the bound is ignored: offset 0, not yet sent.
      if (offset_um == 0.0 && !command_.valid[axis] && std::abs(before_um) > bound_um) return;
      ++outcome_.resyncs;
      const double from_applied_um = std::abs(offset_um - state_.applied_um[axis]);
      demand("slew_kept_by_command",
             "offset changes at the slew rate, or starts from the read-back",
             // While another node must be held nothing is sent, wherever this node starts from.
             state_.online && (command_.valid[axis] || is_node(axis)) && may_start &&
                 from_applied_um <= step_um + register_rounding_um,
             offset_um - before_um, step_um);
      note_started(axis);
      return;
    }
    const bool may_change = !config_.compensation.hold_while_cutting;
    if (command_.valid[axis] && may_change && reads_in_epoch_ > reads_until_written &&
        std::abs(before_um) > bound_um && std::abs(state_.applied_um[axis] - before_um) <= tiny_um)
      demand("offset_within_bound", "an offset outside a new bound comes in at the slew rate",
             std::abs(offset_um) <= std::max(bound_um, std::abs(before_um) - step_um + 3 * tiny_um),
             offset_um, bound_um);
  }

  [[nodiscard]] bool is_node(std::size_t axis) const { return options_.travel && axis > 0; }

  void note_started(std::size_t axis) {
    started_on_[axis] = state_.link_epoch;
    released_[axis] = false;
  }

  void check_valid(std::size_t axis) {
    demand("nodes_driven_together", "the nodes of a travel are driven together",
           !options_.travel || command_.valid[1] == command_.valid[2], 0, 0);
    demand("unexplained_is_latched", "a latched axis is not driven",
           !(command_.valid[axis] && report_.axes[axis].latched), 0, 0);
    demand("unexplained_is_latched", "a latched mismatch is told",
           !report_.axes[axis].latched || has_reason(report_.reasons, Reason::mismatch_latched), 0,
           0);
    if (!command_.valid[axis]) return;
    note_started(axis);
    const double read_back_um = controller_.read_back_um[axis];
    demand("first_offset_is_known", "an axis whose position is not known is not driven",
           controller_.epoch > 0 && std::isfinite(read_back_um), read_back_um, 0);
    demand("first_offset_is_known", "an axis at an impossible position is not driven",
           !(std::abs(read_back_um) > offset_um_max_of_any_axis + register_rounding_um),
           read_back_um, offset_um_max_of_any_axis);
  }

  /// The link writes the offsets, unless it has just been lost and reconnected.
  void deliver() {
    const bool reconnected = controller_.connected && link_.one_in(50);
    if (reconnected) {
      connect();
      if (link_.one_in(2)) controller_.applied_um.fill(0.0);
    }
    const bool belongs =
        command_.link_epoch == controller_.epoch || options_.planted == Planted::epoch_ignored;
    if (!controller_.exchanging || controller_.rejecting || !belongs) return;
    for (std::size_t i = 0; i < axes_count && !outcome_.violation; ++i) {
      if (!command_.valid[i]) continue;
      const double change_um = std::abs(command_.offset_um[i] - controller_.applied_um[i]);
      double allowed_um = step_um_max(i) + register_rounding_um;
      if (controller_.disturbed[i]) allowed_um += undetected_um(i);
      demand("slew_kept_at_controller", "what the controller applies changes at the slew rate",
             change_um <= allowed_um, change_um, allowed_um);
      controller_.applied_um[i] = command_.offset_um[i];
      controller_.disturbed[i] = false;
    }
  }

  /// Largest unnoticed difference [um]: the applied offset is within tolerance of the range sent
  /// within the comparison window (or its last slots).
  [[nodiscard]] double undetected_um(std::size_t axis) const {
    // Each of the window's five slots ends with a step; a long step counts as an ordinary one.
    constexpr std::size_t slots = 8;
    const double window_s = 1.25 * window_s_ + 5 * step_s_usual_max;
    double low_um = before_um_[axis];
    double high_um = before_um_[axis];
    for (std::size_t i = sent_.size(); i > 0; --i) {
      if (sent_.size() - i > slots && busy_s_ - sent_[i - 1].busy_s > window_s) break;
      const Sent& sent = sent_[i - 1];
      low_um = std::min({low_um, sent.offset_um[axis], sent.start_um[axis]});
      high_um = std::max({high_um, sent.offset_um[axis], sent.start_um[axis]});
    }
    return tolerance_um_ + high_um - low_um;
  }

  /// After a reload the comparison may still use the previous configuration.
  void remember_comparison() {
    const CompensationConfig& compensation = config_.compensation;
    window_s_ = std::max(window_s_, compensation.mismatch_after_s);
    tolerance_um_ = std::max(tolerance_um_, compensation.mismatch_um);
  }

  void demand(invariants::Rule rule, const char* what, bool holds, double value, double allowed) {
    if (!holds && !outcome_.violation)
      outcome_.violation = Violation{rule.name(), what, step_, value, allowed};
  }

  WorldOptions options_;
  Chance shape_;
  Chance time_;
  Chance heat_;
  Chance sensors_;
  Chance link_;
  Chance operator_;
  EstimatorConfig config_;
  ThermalModel model_;
  bool is_promoted_{false};
  std::unique_ptr<Estimator> estimator_;
  bool estimator_stepped_{false};
  Report report_;
  std::size_t step_{0};
  double busy_s_{0.0};  ///< elapsed time with long steps counted as ordinary ones
  nanoseconds now_{std::chrono::hours(1)};
  double dt_s_{0.0};
  std::array<double, sensors_count> temps_degC_{20, 20, 21, 21, 21, 22};
  std::array<std::size_t, sensors_count> frozen_until_{};
  std::vector<Reading> readings_;
  Controller controller_;
  bool switch_off_{false};
  ControllerState state_;
  int reads_in_epoch_{0};
  OffsetCommand command_;
  struct Sent {
    double busy_s;
    std::array<double, axes_max> offset_um;
    std::array<double, axes_max> start_um;
  };
  std::vector<Sent> sent_;
  bool was_outside_{false};
  Mode mode_before_{Mode::holding};
  std::array<bool, axes_count> valid_before_{};
  std::array<double, axes_count> before_um_{};
  std::array<std::uint32_t, axes_count> started_on_{};  ///< link epoch
  std::array<bool, axes_count> released_{};
  double window_s_{0.0};
  double tolerance_um_{0.0};
  Outcome outcome_;
};

}  // namespace

Outcome live(std::uint64_t seed, const WorldOptions& options) {
  return World(seed, options).live();
}

}  // namespace thermocomp::property
