/// Texts and remedies for a status: for a terminal, a page, an alarm. Pure functions.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "status/codes.hpp"
#include "status/status.hpp"

namespace thermocomp {

/// True if offsets reach the machine: mode `compensating`, no dry run, controller online, every
/// axis driven, a model with non-zero coefficients.
[[nodiscard]] bool is_compensating(const Status& status);

struct Verdict {
  bool compensating{false};
  bool intended{false};  ///< not compensating on purpose: switched off, dry run
  std::string answer;    ///< "yes", "no", "no: DRY RUN"
  std::string meaning;   ///< "offsets held"; may be empty
  double for_s{not_a_number};
  std::string advice{};  ///< may be empty
};
[[nodiscard]] Verdict verdict(const Status& status);
/// "for 2 h 10 min", "offsets held, for 3 s: the correction is frozen ..."
[[nodiscard]] std::string detail_of(const Verdict& verdict);
/// Answer and detail in one line: "yes, for 2 h 10 min", "no (offsets held: ...)".
[[nodiscard]] std::string verdict_text(const Verdict& verdict);

/// Reasons why `thermocomp status` exits with 1, one line each; empty: it exits with 0.
/// @param strict  includes degradations: a bound reached, a read-back that disagrees, a lost sensor
///                or unit, a state outside the domain, a history that is not written
[[nodiscard]] std::vector<std::string> why_not(const Status& status, bool strict);

struct Trouble {
  std::string what;
  std::string remedy;    ///< empty: none known
  std::string command;   ///< for a terminal; empty: none
  Subject subject{};     ///< for a link to more data
  std::string detail{};  ///< the driver's text; may be empty
};
/// All faults, one entry per cause, worst first: a silent module covers its sensors, and these
/// cover the model inputs made from them.
/// @param sensors  source of the sensors' faults; nullptr: names only
[[nodiscard]] std::vector<Trouble> troubles(const Status& status,
                                            const SensorsAnswer* sensors = nullptr);

/// "block head is estimated from 5 others, +-0.40 K (1 sd)", one line per block, then the offsets.
[[nodiscard]] std::vector<std::string> estimate_lines(const std::vector<InputStatus>& inputs,
                                                      const std::vector<AxisStatus>& axes);
/// Text of the sensor's fault; empty remedy if it only settles.
[[nodiscard]] CodeText fault_text(const SensorStatus& sensor);
/// True if the newest value is valid but not yet confirmed.
[[nodiscard]] bool settles(const SensorStatus& sensor);
/// "the same values for 1 min 15 s, up and down before: frozen?"
[[nodiscard]] std::string frozen_text(const FrozenModule& module);
inline constexpr std::string_view frozen_remedy =
    "compare with a hand-held thermometer, switch the device off and on";
/// "off by +2.0 K against its neighbours since 2026-03-01 08:30:11.1, used all the same"
[[nodiscard]] std::string suspicion_text(const SensorError& suspected);
/// The newest failed write, empty if there is none: "writes refused, function 16, address 100,
/// exception 1; last confirmed 12 s ago".
[[nodiscard]] std::string write_text(const WriteStatus& write);
/// Remedy for a bus that is not connected.
/// @param kind  of the bus, as in the configuration
[[nodiscard]] std::string_view bus_remedy(std::string_view kind);

}  // namespace thermocomp
