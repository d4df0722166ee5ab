/// Texts of modes, reasons and faults: name, meaning, remedy and severity, in one table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "estimator/types.hpp"

namespace thermocomp {

enum class Severity : std::uint8_t {
  normal,    ///< no action needed
  intended,  ///< requested by an operator or the machine
  warning,   ///< compensation continues
  fault      ///< an axis, or the whole machine, is not compensated as intended
};

struct CodeText {
  std::string_view name;  ///< name in JSON
  std::string_view meaning;
  std::string_view remedy;  ///< empty: no action needed
  Severity severity{Severity::fault};
  std::string_view command{};  ///< terminal command for the remedy; empty: none
};

[[nodiscard]] CodeText code_text(Reason reason) noexcept;
[[nodiscard]] CodeText code_text(Fault fault) noexcept;
/// In a dry run the mode `compensating` has the name "dry_run".
[[nodiscard]] CodeText code_text(Mode mode, bool dry_run) noexcept;
/// Text of the fault `out_of_range` for a NaN value.
[[nodiscard]] CodeText nan_text() noexcept;

/// "repair the sensor or its bus: thermocomp sensors"
[[nodiscard]] std::string with_command(std::string_view remedy, std::string_view command);

/// The code with this name; nullopt: unknown.
[[nodiscard]] std::optional<Reason> reason_named(std::string_view name) noexcept;
[[nodiscard]] std::optional<Fault> fault_named(std::string_view name) noexcept;
/// "dry_run" is `compensating`.
[[nodiscard]] std::optional<Mode> mode_named(std::string_view name) noexcept;

/// The members of a set of reasons (Report::reasons): faults, then warnings, then others.
[[nodiscard]] std::vector<Reason> by_severity(std::uint32_t reasons);
/// The members in bit order.
[[nodiscard]] std::vector<Reason> members_of(std::uint32_t reasons);

}  // namespace thermocomp
