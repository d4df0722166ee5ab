/// Screening of readings before they can move an axis, and the temperature range of a model column
/// that follows from it.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// One sensor after a step, for reports.
struct SensorReport {
  double raw_degC{not_a_number};       ///< as the driver gave it
  double smoothed_degC{not_a_number};  ///< value for the block; a difference where configured
  nanoseconds taken_at{};
  Fault fault{Fault::never_read};     ///< after screening
  std::uint32_t clipped_in_a_row{0};  ///< consecutive values clipped by smoothing
  std::uint64_t clipped{0};
  std::uint64_t rejected{0};  ///< readings refused by screening since the start
  bool waiting{false};        ///< an unconfirmed value is present
  bool jumped{false};         ///< ... because it contradicts earlier or expected values
  double jump_K{0.0};         ///< ... by this much now
  double jumped_from_degC{not_a_number};
  nanoseconds jumped_at{};
  bool suspected{false};     ///< good values that the neighbours contradict
  bool weighed_down{false};  ///< ... and excluded from its blocks
  double suspected_size_K{0.0};
  nanoseconds suspected_since{};

  /// Unconfirmed only because it is new, as every sensor at the start: not a fault.
  [[nodiscard]] bool settles() const noexcept { return fault == Fault::unconfirmed && !jumped; }
};

/// Screens one sensor's readings, each once, when it is new. A refused reading counts as missing:
/// the last confirmed value is used until it is stale.
///
/// A value T follows the last confirmed one, T0, when
///
///     |T - T0| <= rate_allowance_K + max(rate min(t, 2 s), min(rate u, outage_K_max + 10 K/h u)),
///
/// where t is the time since T0 while T0 is in use, and u the time in which *nothing* was read.
/// Modules show a change late and as a step, hence the 2 s. A value that does not follow (a jump)
/// adds nothing to u, however long it lasts: it is confirmed by the expectation of its neighbours,
/// by an operator, or by its return to where T0 allows. After a jump J a return may miss by 10 K/h
/// since its start, up to J / 4.
///
/// After an outage, and at the start, a value is confirmed by consecutive readings over settle_s,
/// at least settle_readings of them. An exact 0 does not settle: devices send it while not ready.
class Screening {
 public:
  static constexpr std::uint32_t settle_readings = 3;

  explicit Screening(const ScreeningConfig& config);

  /// @return true for a new good reading, which good_degC() and good_at() then give
  bool look(nanoseconds now, const Reading& reading) noexcept {
    if (reading.taken_at == state_.seen_at && reading.fault == state_.seen_fault) return false;
    return take(now, reading);
  }

  /// Context of the next readings. The expectation is NaN if nothing independent of this sensor
  /// gives one.
  struct Surroundings {
    double expected_degC{not_a_number};
    double expected_sd_K{0.0};
    bool module_not_ready{false};
  };
  void surround(const Surroundings& surroundings) noexcept { surroundings_ = surroundings; }
  /// Before the first reading: the last confirmed value, of unknown age.
  void restore_jump(double from_degC) noexcept;
  /// Confirms the newest value in spite of all checks. @return true if one was waiting
  bool accept() noexcept;

  /// True if the last good reading may still be used at `now`.
  [[nodiscard]] bool usable(nanoseconds now) const noexcept {
    return state_.good.known && now - state_.good.at <= stale_after_;
  }
  /// Fault of the newest reading; none while it is good and fresh.
  [[nodiscard]] Fault fault(nanoseconds now) const noexcept {
    if (state_.verdict != Fault::none) return state_.verdict;
    return now - state_.good.at > stale_after_ ? Fault::stale : Fault::none;
  }
  [[nodiscard]] double good_degC() const noexcept { return state_.good.temp_degC; }
  [[nodiscard]] nanoseconds good_at() const noexcept { return state_.good.at; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return state_.rejected; }
  /// An unconfirmed value is present.
  [[nodiscard]] bool waiting() const noexcept { return state_.waiting; }
  [[nodiscard]] bool jumped() const noexcept { return state_.jumped; }
  [[nodiscard]] double jump_K() const noexcept {
    return state_.jumped ? state_.newest.temp_degC - state_.jump_from_degC : 0.0;
  }
  /// NaN: no jump.
  [[nodiscard]] double jumped_from_degC() const noexcept {
    return state_.jumped ? state_.jump_from_degC : not_a_number;
  }
  [[nodiscard]] nanoseconds jumped_at() const noexcept { return state_.jumped_at; }
  /// The last confirmed value ended a jump without return: the values before it were wrong.
  [[nodiscard]] bool refuted() const noexcept { return state_.refuted; }
  [[nodiscard]] double newest_degC() const noexcept { return state_.newest.temp_degC; }
  [[nodiscard]] bool has_good() const noexcept { return state_.good.known; }

  /// After a reload: the state of `previous` with our limits.
  void adopt(const Screening& previous) noexcept { state_ = previous.state_; }

  void visit_state(StateArchive& archive) { archive(state_); }

 private:
  struct Value {
    bool known{false};
    double temp_degC{0.0};
    nanoseconds at{};
    void visit_state(StateArchive& archive) { archive(known, temp_degC, at); }
  };
  struct State {
    nanoseconds seen_at{};
    Fault seen_fault{Fault::never_read};
    Fault verdict{Fault::never_read};
    bool waiting{false};
    bool jumped{false};
    bool refuted{false};
    Value good;               ///< last confirmed value
    Value newest;             ///< while waiting: the last value in range and fresh
    nanoseconds run_since{};  ///< start of the consecutive values of this kind
    std::uint32_t run_count{0};
    nanoseconds unread{};  ///< time since `good` without any value
    nanoseconds jumped_at{};
    double jump_from_degC{0.0};
    double jump_K_max{0.0};
    nanoseconds same_since{};  ///< since when `newest` has been unchanged to the last bit
    std::uint64_t rejected{0};
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = *this;
      archive(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p);
    }
  };

  [[nodiscard]] bool take(nanoseconds now, const Reading& reading) noexcept;
  [[nodiscard]] bool is_continuous(nanoseconds now, const Reading& reading) const noexcept;
  /// The last value in range and fresh, confirmed or not.
  [[nodiscard]] const Value& newest() const noexcept {
    return state_.waiting ? state_.newest : state_.good;
  }
  [[nodiscard]] Fault check(nanoseconds now, const Reading& reading) const noexcept;
  void note(const Reading& reading) noexcept;
  [[nodiscard]] Fault judge() noexcept;
  [[nodiscard]] Fault jump(double from_degC) noexcept;
  void count(bool refutes) noexcept;
  [[nodiscard]] double change_K(nanoseconds unread) const noexcept;
  [[nodiscard]] bool possible() const noexcept;
  [[nodiscard]] bool settled() const noexcept;
  [[nodiscard]] bool expected() const noexcept;
  [[nodiscard]] bool unexpected() const noexcept;

  const double min_degC_;
  const double max_degC_;
  const double rate_K_per_ns_;
  const double allowance_K_;
  const double outage_K_max_;
  const nanoseconds stale_after_;
  const nanoseconds settle_;
  const nanoseconds stuck_after_;  ///< 0: never

  State state_;
  Surroundings surroundings_;  ///< renewed each step while a value waits
};

/// Accepted temperatures of a column; a reference outside was never measured.
class TemperatureRange {
 public:
  /// From all sensors of the column's block; for a difference, the difference of two ranges. A
  /// column without sensors accepts any finite temperature.
  TemperatureRange(const EstimatorConfig& config, const std::string& column);

  [[nodiscard]] bool holds(double temp_degC) const noexcept;  ///< false for NaN
  [[nodiscard]] std::string rule() const;  ///< "must be in [-30, 200], what the screening ..."

 private:
  double degC_min_{not_a_number};
  double degC_max_{not_a_number};
};

/// Kept references outside the range of their column, as text: "reference_degC.t1_degC = 1e+300
/// must be in ...".
[[nodiscard]] std::vector<std::string> impossible_references(
    const EstimatorConfig& config, const std::vector<std::string>& columns,
    const std::map<std::string, double>& reference_degC);

/// Checks the reference of the model file. @throws InvalidValue with the key
void check_reference(const EstimatorConfig& config, const ThermalModel& model);

}  // namespace thermocomp
