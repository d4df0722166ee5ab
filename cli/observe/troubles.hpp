/// What the daemon's status means, in words, and what to do: for a terminal, a page, an alarm.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

/// Whether offsets reach the machine now: mode "compensating", and every axis driven.
/// @param status  result of the method `status`, here and below
[[nodiscard]] bool is_compensating(const nlohmann::json& status);

struct Verdict {
  bool compensating{false};
  bool intended{false};  ///< it does not, but somebody wants it so: switched off, dry run
  std::string answer;    ///< "yes", "no", "no: DRY RUN"
  std::string detail;    ///< what follows: ", for 2 h 10 min", " (data lost: ...)"
};
[[nodiscard]] Verdict verdict(const nlohmann::json& status);

struct Trouble {
  std::string what;
  std::string remedy;  ///< empty: none that is known
};
/// Everything that is wrong, worst first.
[[nodiscard]] std::vector<Trouble> troubles(const nlohmann::json& status);

/// "block head is estimated from 5 others, +-0.40 K (1 sd)", one line a block, then the offsets.
/// @param answer  of `status` or `sensors`
[[nodiscard]] std::vector<std::string> estimate_lines(const nlohmann::json& answer);

/// "off by +2.0 K against its neighbours since 2026-03-01 08:30:11.1, used all the same"
/// @param suspected  of the answer of `sensors`, or one of `sensors_suspected` of `status`
[[nodiscard]] std::string suspicion_text(const nlohmann::json& suspected);

/// What to do about a bus that is not connected.
/// @param kind  of the bus, as in the configuration
[[nodiscard]] std::string_view bus_remedy(std::string_view kind);

[[nodiscard]] bool has_reason(const nlohmann::json& status, const char* name);
[[nodiscard]] std::vector<std::string> axes_not_driven(const nlohmann::json& status);
/// "a, b, c"
[[nodiscard]] std::string joined(const std::vector<std::string>& words);

}  // namespace thermocomp::cli
