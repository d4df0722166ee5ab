/// Modes, reasons and faults for people: each has its meaning, remedy and severity in one table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "estimator/pipeline/mode.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

enum class Severity : std::uint8_t {
  normal,    ///< nothing to mend
  intended,  ///< an operator or the machine wants it so
  warning,   ///< compensation goes on
  fault      ///< an axis, or the whole machine, is not compensated as it should be
};

struct CodeText {
  std::string_view name;     ///< as in JSON
  std::string_view meaning;  ///< what it is
  std::string_view remedy;   ///< what to do; empty: nothing
  Severity severity{Severity::fault};
  std::string_view command{};  ///< that does or shows it, for a terminal; empty: none
};

[[nodiscard]] CodeText code_text(Reason reason) noexcept;
[[nodiscard]] CodeText code_text(Fault fault) noexcept;
/// In a dry run the mode `compensating` is called "dry_run": nothing is compensated.
[[nodiscard]] CodeText code_text(Mode mode, bool dry_run) noexcept;
/// The fault `out_of_range` where the value is NaN.
[[nodiscard]] CodeText nan_text() noexcept;

/// "mend the sensor or its bus: thermocomp sensors"
[[nodiscard]] std::string with_command(std::string_view remedy, std::string_view command);

/// The codes with these names; nullopt: no code has that name.
[[nodiscard]] std::optional<Reason> reason_named(std::string_view name) noexcept;
[[nodiscard]] std::optional<Fault> fault_named(std::string_view name) noexcept;
/// "dry_run" is `compensating`.
[[nodiscard]] std::optional<Mode> mode_named(std::string_view name) noexcept;

/// The members of a set of reasons (Report::reasons), faults first, then warnings, then the rest.
[[nodiscard]] std::vector<Reason> by_severity(std::uint32_t reasons);
/// In the order of their bits.
[[nodiscard]] std::vector<Reason> members_of(std::uint32_t reasons);

}  // namespace thermocomp
