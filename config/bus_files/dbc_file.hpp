/// Parser of DBC files: the messages of a CAN bus and the places of their signals.
///
/// A statement that breaks the grammar, has an invalid reference or does not fit into a frame is a
/// flaw of its message or signal, with file, line and rule; the others are read. Only the syntax of
/// comments, nodes, environment variables and attributes is checked, except for VFrameFormat, the
/// cycle time and long names. Ranges and value tables are read as far as they can be.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/text/problems.hpp"
#include "drivers/can/can_config.hpp"

namespace thermocomp {

struct DbcSignal {
  std::string name;
  std::string long_name;  ///< if `name` had to be shortened; else empty
  std::string unit;       ///< bytes as in the file; often not UTF-8
  CanSignal place;        ///< with multiplexors; sentinels empty
  double min{0.0};        ///< of the value in `unit`
  double max{0.0};        ///< not above `min`: not given
  std::vector<std::pair<std::int64_t, std::string>> value_names{};  ///< by raw value
  int line{0};
};

struct DbcMessage {
  std::string name;
  std::string long_name;
  std::uint32_t id{0};
  bool extended{false};
  std::uint64_t bytes{0};           ///< above 64: sent in several frames by a transport protocol
  std::optional<bool> declared_fd;  ///< from VFrameFormat; none: not given
  double cycle_s{0.0};              ///< from GenMsgCycleTime; 0: not given
  /// The message is a J1939 group from any sender: see id_mask of the signals.
  bool is_group{false};
  std::vector<DbcSignal> signals;
  int line{0};

  /// By name or long name; nullptr: unknown.
  [[nodiscard]] const DbcSignal* find(std::string_view signal) const noexcept;
  [[nodiscard]] std::vector<std::string> signal_names() const;
};

/// An error in the file.
struct DbcFlaw {
  Problem problem;
  std::string message;  ///< message concerned; empty: unknown
  std::string signal;   ///< signal concerned; empty: the message as a whole
  /// Configuration keys that override the wrong value.
  std::vector<std::string_view> keys;
  bool in_use{false};  ///< the configuration uses the message or signal
};

struct DbcFile {
  std::vector<DbcMessage> messages;  ///< without the pseudo message VECTOR__INDEPENDENT_SIG_MSG
  std::vector<DbcFlaw> flaws;

  /// By name or long name; of several, the one with identifier `id`.
  [[nodiscard]] const DbcMessage* find(std::string_view message,
                                       std::optional<std::uint32_t> id = {}) const noexcept;
  [[nodiscard]] std::vector<std::string> message_names() const;
};

/// @param name  file name in flaws
[[nodiscard]] DbcFile read_dbc_text(std::string_view text, const std::string& name);

}  // namespace thermocomp
