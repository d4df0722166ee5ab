/// A life of the daemon with a simulated machine, in virtual time, from one seed.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "fault_schedule.hpp"
#include "invariants.hpp"

namespace thermocomp::faults {

struct LifeOptions {
  std::uint64_t seed{0};
  double hours{4.0};
  double cycle_hz{1.0};
  /// Folder for a real history, on a disk that fills up and with writes cut off by kills; empty:
  /// history passes through the codec in memory into a second estimator.
  std::filesystem::path history_folder;
  /// Parent folder of the state file; empty again at the end.
  std::filesystem::path state_folder;
  std::optional<FaultKind> only{};  ///< no other fault happens
  bool verbose{false};              ///< print faults and their effects
};

struct LifeResult {
  std::uint64_t cycles{0};
  double machine_hours{0.0};
  std::uint64_t replayed{0};  ///< cycles repeated by a second estimator
  std::uint64_t restarts{0};
  std::uint64_t reloads{0};
  std::uint64_t promotions{0};
  std::uint64_t taken_back{0};
  std::uint64_t commits{0};  ///< of the history on disk
  std::uint64_t compensating{0};
  std::array<std::uint64_t, fault_kinds> faults{};
  std::bitset<fault_pairs> pairs;
  std::optional<Broken> broken;
};

[[nodiscard]] LifeResult live(const LifeOptions& options);

}  // namespace thermocomp::faults
