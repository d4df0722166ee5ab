/// What a status means, in words, and what to do: for a terminal, a page, an alarm. Pure.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "status/codes.hpp"
#include "status/status.hpp"

namespace thermocomp {

/// Whether offsets reach the machine now: mode "compensating", and every axis driven.
[[nodiscard]] bool is_compensating(const Status& status);

struct Verdict {
  bool compensating{false};
  bool intended{false};  ///< not compensating as wanted: switched off, dry run
  std::string answer;    ///< "yes", "no", "no: DRY RUN"
  std::string detail;    ///< "for 2 h 10 min", "data lost: the offsets stand still ..., for 3 s"
};
[[nodiscard]] Verdict verdict(const Status& status);
/// Answer and detail in one line: "yes, for 2 h 10 min", "no (data lost: ...)".
[[nodiscard]] std::string verdict_text(const Verdict& verdict);

/// Why `thermocomp status` exits with 1, one line each; empty: it exits with 0.
/// @param strict  also what does not stop the compensation: a bound reached, a read-back that
///                disagrees, a lost sensor or unit, an outside domain, a history that is not
///                written
[[nodiscard]] std::vector<std::string> why_not(const Status& status, bool strict);

struct Trouble {
  std::string what;
  std::string remedy;    ///< empty: none that is known
  std::string command;   ///< for a terminal; empty: none
  Subject subject{};     ///< where a view shows more of it
  std::string detail{};  ///< what was observed, in the driver's words; may be empty
};
/// Everything that is wrong, one entry a cause, worst first: a module that is silent stands for its
/// sensors, and these for the inputs of the model that they make.
/// @param sensors  whose faults are then named; nullptr: their names alone
[[nodiscard]] std::vector<Trouble> troubles(const Status& status,
                                            const SensorsAnswer* sensors = nullptr);

/// "block head is estimated from 5 others, +-0.40 K (1 sd)", one line a block, then the offsets.
[[nodiscard]] std::vector<std::string> estimate_lines(const std::vector<InputStatus>& inputs,
                                                      const std::vector<AxisStatus>& axes);
/// Of the sensor's fault: one that only settles has none to mend.
[[nodiscard]] CodeText fault_text(const SensorStatus& sensor);
/// Nothing contradicts its newest value, which has not lasted long enough to count.
[[nodiscard]] bool settles(const SensorStatus& sensor);
/// "off by +2.0 K against its neighbours since 2026-03-01 08:30:11.1, used all the same"
[[nodiscard]] std::string suspicion_text(const SensorError& suspected);
/// The newest write that failed: "refused (function 16, address 100, exception 1), last confirmed
/// 12 s ago"; empty where every write was confirmed.
[[nodiscard]] std::string write_text(const WriteStatus& write);
/// What to do about a bus that is not connected.
/// @param kind  of the bus, as in the configuration
[[nodiscard]] std::string_view bus_remedy(std::string_view kind);

}  // namespace thermocomp
