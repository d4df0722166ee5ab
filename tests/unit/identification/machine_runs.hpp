/// Simulated recordings of a machine with two temperatures and a speed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/identification/families/families.hpp"
#include "synthetic_places.hpp"

namespace thermocomp::identification {

inline constexpr std::size_t hours = 6;

/// Two temperatures and a speed; the displacement is `moved` of them, with noise.
template <class Moved>
[[nodiscard]] RunFile machine_run(const std::string& name, std::uint64_t seed, Moved moved) {
  std::mt19937_64 engine(seed);
  RunFile run;
  run.name = name;
  run.columns = {"time_s", "t1_degC", "t2_degC", "spindle_rpm", "z_um"};
  run.values.resize(5);
  double quick = 0.0;
  double slow = 0.0;
  double late = 0.0;
  for (std::size_t minute = 0; minute < 60 * hours; ++minute) {
    const double rpm = (minute + 37 * seed) % 110 < 70 ? 2000.0 + 500.0 * double(seed % 4) : 0.0;
    quick += (rpm / 400.0 - quick) / 15.0;
    slow += (0.5 * quick - slow) / 60.0;
    late += (quick - late) / 40.0;
    run.values[0].push_back(60.0 * double(minute));
    run.values[1].push_back(21.0 + quick + 0.02 * gaussian(engine));
    run.values[2].push_back(20.0 + slow + 0.02 * gaussian(engine));
    run.values[3].push_back(rpm);
    run.values[4].push_back(moved(quick, slow, late, rpm) + 0.2 * gaussian(engine));
  }
  run.selected_end = run.values[0].size();
  return run;
}

template <class Moved>
[[nodiscard]] MeasuredTests machine_tests(std::size_t runs, Moved moved) {
  std::vector<RunFile> files;
  for (std::size_t i = 0; i < runs; ++i)
    files.push_back(machine_run(std::string("run").append(std::to_string(i)), i + 1, moved));
  TestOptions options;
  options.outputs = {"z_um"};
  options.folds_of_one_run = 8;
  options.signals = true;
  return measured_tests(files, options);
}

[[nodiscard]] inline FamiliesFit fitted(const MeasuredTests& tests,
                                        std::optional<Family> forced = std::nullopt) {
  return fit_families(tests, {}, forced, [](double) {});
}

}  // namespace thermocomp::identification
