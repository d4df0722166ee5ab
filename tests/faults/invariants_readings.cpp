// Invariants of readings and of the sensors in use.
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "invariants.hpp"

namespace thermocomp::faults {
namespace {

const std::array<std::vector<std::size_t>, 3> blocks{{{0, 4}, {1, 2}, {3, 5, 6}}};

}  // namespace

void Invariants::check_readings(const CycleSeen& seen) {
  for (std::size_t i = 0; i < sensors_count; ++i) {
    const Reading& reading = seen.readings[i];
    Reading& before = last_readings_[i];
    const bool new_one = reading.taken_at != before.taken_at ||
                         reading.temp_degC != before.temp_degC || reading.fault != before.fault;
    if (!new_one) continue;
    before = reading;
    // Implausible values are left to screening.
    const bool believable = std::abs(reading.temp_degC) < 200.0 && reading.temp_degC > -30.0;
    if (reading.fault != Fault::none || !(believable || std::isnan(reading.temp_degC))) continue;
    demand(reading.taken_at <= seen.now, "reading_is_what_was_given", seen.now, [&] {
      return fmt::format("sensor {}: taken {:.3f} s ahead of the cycle", i + 1,
                         to_s(reading.taken_at - seen.now));
    });
    const nanoseconds to = stamped_earlier_[i] ? seen.now : reading.taken_at;
    const Sample* sample =
        thermocouples_.given(i, reading.temp_degC, reading.taken_at - slack_of(i), to);
    if (sample != nullptr) continue;
    demand(false, "reading_is_what_was_given", seen.now,
           fmt::format("sensor {}: {:.6f} degC, said to be of {:.3f} s before the cycle", i + 1,
                       reading.temp_degC, to_s(seen.now - reading.taken_at)));
  }
}

bool Invariants::fresh(std::size_t sensor, nanoseconds now) const {
  const nanoseconds given_at = thermocouples_.last_good(sensor);
  return given_at >= nanoseconds{0} && now - given_at <= stale_after_[sensor] + slack_of(sensor);
}

/// While each block has a sensor without fault, suspicion must not end compensation.
void Invariants::check_suspicion(const Report& report, nanoseconds now) {
  const bool all_there = std::all_of(blocks.begin(), blocks.end(), [&](const auto& block) {
    return std::any_of(block.begin(), block.end(), [&](std::size_t sensor) {
      return report.sensors[sensor].fault == Fault::none;
    });
  });
  const bool doubted = std::any_of(report.sensors.begin(), report.sensors.end(),
                                   [](const SensorReport& each) { return each.suspected; });
  demand(!(doubted && all_there && has_reason(report.reasons, Reason::block_lost)),
         "suspicion_never_holds", now,
         "a block without a sensor, though each has one that is good");
}

bool Invariants::any_block_lost(nanoseconds now) const {
  return std::any_of(blocks.begin(), blocks.end(), [&](const std::vector<std::size_t>& block) {
    return std::none_of(block.begin(), block.end(),
                        [&](std::size_t sensor) { return fresh(sensor, now); });
  });
}

void Invariants::check_sensors_used(const CycleSeen& seen) {
  for (std::size_t i = 0; i < sensors_count; ++i) {
    const SensorReport& sensor = seen.report->sensors[i];
    if (sensor.fault != Fault::none) continue;
    demand(fresh(i, seen.now), "no_stale_reading_used", seen.now, [&] {
      return fmt::format("sensor {}: last given out {:.3f} s ago", i + 1,
                         to_s(seen.now - thermocouples_.last_good(i)));
    });
    if (!smoothing_off_ || broken_) continue;
    const Sample* sample = thermocouples_.given(i, sensor.smoothed_degC,
                                                seen.now - stale_after_[i] - slack_of(i), seen.now);
    if (sample == nullptr) {
      demand(false, "no_faulty_reading_used", seen.now,
             fmt::format("sensor {}: {:.4f} degC was not given out of late", i + 1,
                         sensor.smoothed_degC));
      return;
    }
    constexpr double believable_after_s = 90.0;
    // The first value cannot be compared; the second may contradict it.
    if (first_used_[i] < nanoseconds{0}) first_used_[i] = seen.now;
    const bool first = to_s(seen.now - first_used_[i]) < 4.0;
    if (sample->impossible && !first && to_s(seen.now - last_used_[i]) < believable_after_s)
      demand(false, "no_faulty_reading_used", seen.now,
             fmt::format("sensor {}: a spike of {:.2f} degC is used", i + 1, sensor.smoothed_degC));
    if (!sample->impossible || !first) last_used_[i] = seen.now;
  }
}

/// A daemon started during a false reading cannot detect it; values during settling do not count.
void Invariants::check_truth(const CycleSeen& seen) {
  for (std::size_t i = 0; i < sensors_count; ++i) {
    const SensorReport& sensor = seen.report->sensors[i];
    const double off_K =
        std::abs(sensor.smoothed_degC - thermocouples_.plausible_degC(i, seen.now));
    const bool is_settled = seen.now - boot_ > settled_after_[i];
    if (sensor.fault == Fault::none && off_K <= false_K_max && is_settled) had_truth_[i] = true;
    if (sensor.fault != Fault::none || !(off_K > false_K_max) || !had_truth_[i])
      true_at_[i] = seen.now;
    demand(to_s(seen.now - true_at_[i]) <= false_s_max, "no_false_reading_used", seen.now, [&] {
      return fmt::format("sensor {}: {:.2f} degC is used, {:.2f} K off the machine, for {:.0f} s",
                         i + 1, sensor.smoothed_degC, off_K, to_s(seen.now - true_at_[i]));
    });
  }
}

}  // namespace thermocomp::faults
