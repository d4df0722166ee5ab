/// DBC files: which messages a CAN bus has and where the signals stand in them.
///
/// Read strictly: what breaks the grammar, refers to something that does not exist or does not fit
/// into a frame is a problem with file, line and rule. Comments, nodes, value tables, environment
/// variables and attributes other than VFrameFormat are checked for their form only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/text/problems.hpp"
#include "drivers/can/can_config.hpp"

namespace thermocomp {

struct DbcSignal {
  std::string name;
  std::string unit;  ///< bytes as they stand in the file; often not UTF-8
  CanSignal place;   ///< with multiplexors; sentinels empty
  int line{0};
};

struct DbcMessage {
  std::string name;
  std::uint32_t id{0};
  bool extended{false};
  std::uint64_t bytes{0};       ///< more than 64: sent in several frames by a protocol above CAN
  std::optional<bool> told_fd;  ///< what VFrameFormat says; none: nothing
  std::vector<DbcSignal> signals;
  int line{0};

  /// nullptr: there is none of that name
  [[nodiscard]] const DbcSignal* find(std::string_view signal) const noexcept;
  [[nodiscard]] std::vector<std::string> signal_names() const;
};

struct DbcFile {
  std::vector<DbcMessage> messages;  ///< without VECTOR__INDEPENDENT_SIG_MSG, which is not one

  [[nodiscard]] const DbcMessage* find(std::string_view message) const noexcept;
  [[nodiscard]] std::vector<std::string> message_names() const;
};

struct DbcReading {
  DbcFile file;
  std::vector<Problem> problems;  ///< at most 100; empty: the file is good
};

/// @param name  stands for the file in problems
[[nodiscard]] DbcReading read_dbc_text(std::string_view text, const std::string& name);

}  // namespace thermocomp
