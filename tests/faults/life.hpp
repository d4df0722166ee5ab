/// A life of the daemon beside a machine, in virtual time and from one seed.
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
  /// Where the history is really written, with a disk that fills up and writes cut off by a kill;
  /// empty: it goes through the codec in memory, into a second estimator.
  std::filesystem::path history_folder;
  /// Where a life writes a state file, of which nothing is left at its end.
  std::filesystem::path state_folder;
  std::optional<FaultKind> only{};  ///< no other fault happens
  bool verbose{false};              ///< the faults and what becomes of them, on standard output
};

struct LifeResult {
  std::uint64_t cycles{0};
  double machine_hours{0.0};
  std::uint64_t replayed{0};  ///< cycles that a second estimator took again
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
