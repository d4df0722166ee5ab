#include "machine.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace thermocomp::faults {
namespace {

constexpr nanoseconds conversion_period = std::chrono::milliseconds(500);
/// Longest time between separate requests for a value and its status.
constexpr nanoseconds status_apart_max = std::chrono::seconds(12);

}  // namespace

Thermocouples::Thermocouples(std::uint64_t seed, const FaultSchedule& schedule)
    : seed_(seed), schedule_(schedule) {
  Chance chance(seed, 2);
  for (Course& course : courses_)
    course = {chance.between(19.0, 30.0), chance.between(0.5, 6.0),
              6.283 / chance.between(3600.0, 18000.0), chance.between(0.0, 6.283)};
  last_good_.fill(nanoseconds{-1});
}

double Thermocouples::true_degC(std::size_t sensor, nanoseconds time) const noexcept {
  const Course& course = courses_[sensor];
  return course.mean_degC +
         course.swing_K * std::sin(course.rate_per_s * to_s(time) + course.phase);
}

/// Sensor that comes loose at a rate that screening accepts, and is pressed back.
double Thermocouples::error_K(std::size_t sensor, nanoseconds time) const noexcept {
  constexpr double rate_K_per_s = 0.3;
  constexpr double error_K_max = 4.0;
  if (!judges_sensors(seed_) || sensor != seed_ / 3 % sensors_count) return 0.0;
  const double in_period_s = std::fmod(to_s(time), 7200.0);
  return std::clamp(rate_K_per_s * std::min(in_period_s - 1800.0, 5400.0 - in_period_s), 0.0,
                    error_K_max);
}

double Thermocouples::creep_K(std::size_t sensor, nanoseconds at) const noexcept {
  const FaultEvent* drift = schedule_.find(FaultKind::sensor_drifting, at, sensor, sensors_count);
  const double drift_K =
      drift == nullptr ? 0.0 : (drift->strength - 0.5) * 0.05 * to_s(at - drift->begin);
  return drift_K + error_K(sensor, at);
}

double Thermocouples::plausible_degC(std::size_t sensor, nanoseconds time) const noexcept {
  return true_degC(sensor, time) + creep_K(sensor, time);
}

/// A module with a wrong unit or decimal point, or one that answers before its first conversion.
double Thermocouples::through_unit(std::size_t sensor, double temp_degC,
                                   nanoseconds time) const noexcept {
  const auto has = [&, unit = unit_of(sensor)](FaultKind kind) {
    return schedule_.find(kind, time, unit, units_count) != nullptr;
  };
  if (has(FaultKind::unit_not_ready)) return 0.0;
  if (has(FaultKind::unit_in_fahrenheit)) return 32.0 + 1.8 * temp_degC;
  return has(FaultKind::unit_tenfold_too_low) ? 0.1 * temp_degC : temp_degC;
}

Sample Thermocouples::convert(std::size_t sensor, nanoseconds time) const noexcept {
  Sample sample;
  sample.given_at = time;
  const FaultEvent* stuck = schedule_.find(FaultKind::sensor_stuck, time, sensor, sensors_count);
  const nanoseconds at = stuck != nullptr ? stuck->begin : time;
  std::size_t seen = sensor;  // the wire connected to this channel
  const FaultEvent* swapped = schedule_.find(FaultKind::sensors_swapped, at);
  if (swapped != nullptr) {
    const std::size_t a = swapped->subject % sensors_count;
    const std::size_t b = (a + 1) % sensors_count;
    if (sensor == a || sensor == b) seen = sensor == a ? b : a;
  }
  const std::int64_t conversion = at / conversion_period;
  sample.converted_at = conversion * conversion_period;
  const std::uint64_t noise =
      scramble(seed_ + static_cast<std::uint64_t>(conversion) * 97u + sensor);
  sample.temp_degC = true_degC(seen, sample.converted_at) +
                     0.04 * (static_cast<double>(noise >> 11) * 0x1p-53 - 0.5);
  sample.temp_degC += creep_K(sensor, at);
  const FaultEvent* spikes = schedule_.find(FaultKind::sensor_spiking, at, sensor, sensors_count);
  // A value stuck at a spike would be a step.
  if (spikes != nullptr && stuck == nullptr && at >= spikes_from_ && noise % 3 == 0) {
    // Consecutive spikes differ in height: two equal ones would be a step.
    sample.temp_degC += (spikes->strength < 0.5 ? 55.0 : 300.0) +
                        3.0 * static_cast<double>(conversion % 13) +
                        0.01 * static_cast<double>(noise % 100);
    sample.impossible = true;
  }
  const double shown_degC = through_unit(sensor, sample.temp_degC, time);
  // A unit in tenths shows 33 for 330 degC, which is possible.
  sample.impossible = sample.impossible && shown_degC == sample.temp_degC;
  sample.temp_degC = shown_degC;
  sample.good = whole(sensor, time);
  return sample;
}

bool Thermocouples::whole(std::size_t sensor, nanoseconds time) const noexcept {
  return schedule_.find(FaultKind::sensor_open, time, sensor, sensors_count) == nullptr &&
         schedule_.find(FaultKind::sensor_short, time, sensor, sensors_count) == nullptr;
}

void Thermocouples::put(const UnitPlace& place, std::span<std::uint16_t> value,
                        const Sample& sample) const {
  if (place.floats) {
    const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(sample.temp_degC));
    const auto high = static_cast<std::uint16_t>(bits >> 16);
    const auto low = static_cast<std::uint16_t>(bits & 0xFFFFu);
    value[0] = place.words_low_first ? low : high;
    value[1] = place.words_low_first ? high : low;
  } else {
    value[0] = static_cast<std::uint16_t>(static_cast<std::int16_t>(
        std::clamp(std::lround(sample.temp_degC * 100.0), -32000L, 32000L)));
  }
}

void Thermocouples::read(std::size_t unit, std::size_t address, std::span<std::uint16_t> words,
                         nanoseconds time) {
  const UnitPlace& place = unit_places()[unit];
  std::array<std::uint16_t, 32> image{};
  image[0] = static_cast<std::uint16_t>((time / conversion_period) & 0xFFFF);
  for (std::size_t i = 0; i < place.sensors.size(); ++i) {
    const std::size_t sensor = place.sensors[i];
    const std::size_t at = 10 + 4 * i;
    const bool open =
        schedule_.find(FaultKind::sensor_open, time, sensor, sensors_count) != nullptr;
    if (place.has_status && !whole(sensor, time)) image[at + 2] = open ? 1 : 2;
    if (address > at || address + words.size() <= at) continue;
    Sample sample = convert(sensor, time);
    const std::span<std::uint16_t> value = std::span(image).subspan(at, 2);
    put(place, value, sample);
    if (place.floats)
      sample.temp_degC = static_cast<double>(static_cast<float>(sample.temp_degC));
    else
      sample.temp_degC = 0.01 * static_cast<double>(static_cast<std::int16_t>(value[0]));
    if (!sample.good && place.floats)
      put(place, value, {.temp_degC = open ? 3000.0 : -3000.0});
    else if (!sample.good && !place.has_status)
      value[0] = open ? 0x7FFF : 0x8000;
    // A separately requested status may be from before or after the fault.
    if (place.has_status && address + words.size() <= at + 2)
      sample.good = sample.good || whole(sensor, time - status_apart_max) ||
                    whole(sensor, time + status_apart_max);
    record(sensor, sample);
  }
  for (std::size_t i = 0; i < words.size(); ++i)
    words[i] = address + i < image.size() ? image[address + i] : std::uint16_t{0};
}

void Thermocouples::record(std::size_t sensor, const Sample& sample) noexcept {
  samples_[sensor][given_[sensor]++ % kept] = sample;
  if (sample.good) last_good_[sensor] = std::max(last_good_[sensor], sample.given_at);
}

const Sample* Thermocouples::given(std::size_t sensor, double temp_degC, nanoseconds from,
                                   nanoseconds to) const noexcept {
  const Sample* found = nullptr;
  for (std::size_t back = 1; back <= std::min(kept, given_[sensor]); ++back) {
    const Sample& sample = samples_[sensor][(given_[sensor] - back) % kept];
    if (sample.given_at > to) continue;
    if (sample.given_at < from) break;
    if (!sample.good || !(std::abs(sample.temp_degC - temp_degC) < 1e-6)) continue;
    if (found == nullptr || !sample.impossible) found = &sample;
    if (!sample.impossible) break;
  }
  return found;
}

// ---- the controller

SimulatedController::SimulatedController(std::uint64_t seed, const FaultSchedule& schedule,
                                         bool floats)
    : seed_(seed), schedule_(schedule), floats_(floats) {}

bool SimulatedController::powered(nanoseconds time) const noexcept {
  return schedule_.find(FaultKind::controller_off, time) == nullptr;
}

bool SimulatedController::reports_cutting(nanoseconds time) const noexcept {
  const bool cuts = (time / std::chrono::seconds(1)) % 60 < 40;
  const std::int64_t moment = time / std::chrono::seconds(2);
  const bool wrong = corrects_itself(seed_) &&
                     scramble(seed_ * 37u + static_cast<std::uint64_t>(moment)) % 64 == 0;
  return cuts != wrong;
}

bool SimulatedController::switched_off(nanoseconds time) const noexcept {
  const std::int64_t slot = time / std::chrono::minutes(2);
  return scramble(seed_ * 31u + static_cast<std::uint64_t>(slot)) % 24 == 0;
}

bool SimulatedController::has_wrong_read_back(nanoseconds time) const noexcept {
  static constexpr std::array kinds{FaultKind::controller_applies_other,
                                    FaultKind::read_back_scaled,
                                    FaultKind::read_back_negated,
                                    FaultKind::read_back_shifted,
                                    FaultKind::read_back_drifting,
                                    FaultKind::read_back_jumped,
                                    FaultKind::read_back_frozen,
                                    FaultKind::controller_ignoring,
                                    FaultKind::second_writer};
  return std::any_of(kinds.begin(), kinds.end(),
                     [&](FaultKind kind) { return schedule_.find(kind, time) != nullptr; });
}

/// The active fault of this kind for this axis or all axes.
const FaultEvent* SimulatedController::read_back_fault(FaultKind kind, std::size_t axis,
                                                       nanoseconds time) const {
  const FaultEvent* found = schedule_.find(kind, time);
  return found != nullptr && (found->subject % 4 == 3 || found->subject % 4 == axis) ? found
                                                                                     : nullptr;
}

/// The read-back of an axis.
double SimulatedController::shown_um(std::size_t axis, nanoseconds time) {
  double shown = applied_um_[axis];
  if (const FaultEvent* scaled = read_back_fault(FaultKind::read_back_scaled, axis, time))
    shown *= scaled->strength < 0.5 ? 2.0 : 0.5;
  if (read_back_fault(FaultKind::read_back_negated, axis, time) != nullptr) shown = -shown;
  if (const FaultEvent* shifted = read_back_fault(FaultKind::read_back_shifted, axis, time))
    shown += (shifted->strength < 0.5 ? -1.0 : 1.0) * (3.0 + 20.0 * shifted->strength);
  if (const FaultEvent* drift = read_back_fault(FaultKind::read_back_drifting, axis, time))
    shown += (drift->strength - 0.5) * to_s(time - drift->begin);
  if (const FaultEvent* jumped = read_back_fault(FaultKind::read_back_jumped, axis, time))
    shown += jumped->strength < 0.5 ? -1000.0 : 1000.0;
  if (const FaultEvent* frozen = read_back_fault(FaultKind::read_back_frozen, axis, time)) {
    if (frozen_by_[axis] != frozen->number) frozen_um_[axis] = shown;
    frozen_by_[axis] = frozen->number;
    shown = frozen_um_[axis];
  }
  return shown;
}

void SimulatedController::restart() {
  restart_is_noticed_ = is_in_contact_;
  if (!reads_back(seed_)) written_ = {};
  for (std::size_t axis = 0; axis < axes_count; ++axis) {
    applied_um_[axis] = 0.0;
    disturbed_[axis] = true;
    seen_[axis] = false;
  }
}

void SimulatedController::set_to_zero(std::size_t axis) {
  if (reads_back(seed_)) return disturb(axis, 0.0);
  applied_um_[axis] = 0.0;
  for (std::size_t word = 0; word < words_an_offset(); ++word) written_[offset_at(axis) + word] = 0;
}

void SimulatedController::disturb(std::size_t axis, double applied_um) {
  if (!reads_back(seed_)) return;
  applied_um_[axis] = applied_um;
  disturbed_[axis] = true;
  seen_[axis] = false;
}

void SimulatedController::advance(nanoseconds time) {
  const bool on = powered(time);
  if (on && !on_ && scramble(seed_ + static_cast<std::uint64_t>(time.count() / 1000000000)) % 2)
    restart();
  on_ = on;
  const FaultEvent* rehoming = schedule_.find(FaultKind::controller_rehomed, time);
  if (rehoming == nullptr || rehoming->number == last_rehoming_) return;
  // Every other one occurs at the worst time: right after the first read of a new link.
  if (rehoming->subject / 4 % 2 == 1 && reads_since_break_ != 1) return;
  last_rehoming_ = rehoming->number;
  for (std::size_t axis = 0; axis < axes_count; ++axis) {
    if (rehoming->subject % 4 != 3 && rehoming->subject % 4 != axis) continue;
    disturb(axis, rehoming->strength < 0.6 ? 0.0 : 100.0 * (rehoming->strength - 0.8));
  }
}

bool SimulatedController::read(std::size_t address, std::span<std::uint16_t> words,
                               nanoseconds time) {
  advance(time);
  const bool of_written = address >= 200;
  if (of_written && !shows_registers(seed_)) return false;
  std::array<std::uint16_t, 9> image{};
  for (std::size_t axis = 0; axis < axes_count; ++axis) {
    if (const FaultEvent* other = read_back_fault(FaultKind::second_writer, axis, time))
      disturb(axis, 60.0 * (other->strength - 0.5) + 0.02 * to_s(time - other->begin));
    const double shown = shown_um(axis, time);
    if (floats_) {
      const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(shown));
      image[2 * axis] = static_cast<std::uint16_t>(bits >> 16);
      image[2 * axis + 1] = static_cast<std::uint16_t>(bits & 0xFFFFu);
    } else {
      image[axis] =
          static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(shown * 10.0)));
    }
  }
  image[6] = reports_cutting(time) ? 1 : 0;
  image[7] = switched_off(time) ? 1 : 0;
  image[8] = static_cast<std::uint16_t>((time / std::chrono::milliseconds(10)) % 500);  // mm
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::size_t at = address + i;
    words[i] = 0;
    if (at >= 100 && at < 100 + image.size()) words[i] = image[at - 100];
    if (at >= 200 && at < 200 + written_.size()) words[i] = written_[at - 200];
  }
  // A restart is visible in registers, or as a long absence since the last contact with the daemon.
  const bool detects_restart =
      reads_back(seed_) || of_written || (!shows_registers(seed_) && restart_is_noticed_);
  is_in_contact_ = true;
  for (std::size_t axis = 0; detects_restart && axis < axes_count; ++axis)
    if (!seen_[axis]) seen_at_[axis] = time;
  if (detects_restart) seen_.fill(true);
  ++reads_since_break_;
  looked_at_ = time;
  return true;
}

/// True if the valid bit is set; for travel nodes the bit of their axis, with a complete set.
bool SimulatedController::is_ordered(std::size_t axis) const noexcept {
  const bool is_node = interpolates(seed_) && axis > 0;
  const std::size_t begin = words_an_offset();
  const std::size_t end = valid_at() - 1;
  return ((unsigned{written_[valid_at()]} >> (is_node ? 1 : axis)) & 1u) != 0 &&
         (!is_node || written_[begin] == written_[end]);
}

bool SimulatedController::write(std::size_t address, std::span<const std::uint16_t> words,
                                nanoseconds time) {
  advance(time);
  if (schedule_.find(FaultKind::controller_rejecting, time) != nullptr) return false;
  if (address < 200 || address + words.size() > 216) return false;
  std::copy(words.begin(), words.end(),
            written_.begin() + static_cast<std::ptrdiff_t>(address - 200));
  if (address + words.size() <= 200 + valid_at()) return true;  // valid bits follow
  written_at_ = time;
  for (std::size_t axis = 0; axis < axes_count; ++axis) {
    if (!is_ordered(axis)) continue;
    const std::size_t at = offset_at(axis);
    double reported_um = 0.1 * static_cast<double>(static_cast<std::int16_t>(written_[at]));
    if (floats_)
      reported_um = static_cast<double>(
          std::bit_cast<float>(static_cast<std::uint32_t>(written_[at]) << 16 | written_[at + 1]));
    moves_.push_back({axis, time, applied_um_[axis], reported_um, disturbed_[axis], seen_[axis],
                      breaks_, looked_at_, seen_at_[axis]});
    if (reads_back(seed_) &&
        read_back_fault(FaultKind::controller_ignoring, axis, time) != nullptr) {
      disturb(axis, applied_um_[axis]);
      continue;
    }
    applied_um_[axis] = reported_um;
    disturbed_[axis] = false;
    seen_[axis] = true;
    if (schedule_.find(FaultKind::controller_applies_other, time) != nullptr)
      disturb(axis, 0.6 * reported_um + 4.0);
  }
  return true;
}

}  // namespace thermocomp::faults
