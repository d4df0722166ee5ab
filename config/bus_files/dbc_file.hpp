/// DBC files: which messages a CAN bus has and where the signals stand in them.
///
/// A statement that breaks the grammar, refers to nothing or does not fit into a frame is
/// a flaw of the message or signal that it stands at, with file, line and rule; the others are
/// read. Comments, nodes, value tables, environment variables and attributes other than
/// VFrameFormat and those of long names are checked for their form only.
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
  std::string long_name;  ///< in full, where `name` had to be cut; else empty
  std::string unit;       ///< bytes as they stand in the file; often not UTF-8
  CanSignal place;        ///< with multiplexors; sentinels empty
  int line{0};
};

struct DbcMessage {
  std::string name;
  std::string long_name;
  std::uint32_t id{0};
  bool extended{false};
  std::uint64_t bytes{0};  ///< more than 64: sent in several frames by a protocol above CAN
  std::optional<bool> declared_fd;  ///< what VFrameFormat says; none: nothing
  /// It stands for its J1939 group, whoever sends it: place.id_mask of the signals.
  bool is_group{false};
  std::vector<DbcSignal> signals;
  int line{0};

  /// By name or long name; nullptr: there is none.
  [[nodiscard]] const DbcSignal* find(std::string_view signal) const noexcept;
  [[nodiscard]] std::vector<std::string> signal_names() const;
};

/// Something wrong in the file.
struct DbcFlaw {
  Problem problem;
  std::string message;  ///< that it stands at; empty: not known
  std::string signal;   ///< of the message; empty: the message as a whole
  /// Keys of a configuration any of which says instead what is wrong here.
  std::vector<std::string_view> keys;
  bool in_use{false};  ///< a configuration names what it stands at
};

struct DbcFile {
  std::vector<DbcMessage> messages;  ///< without VECTOR__INDEPENDENT_SIG_MSG, which is not one
  std::vector<DbcFlaw> flaws;

  /// By name or long name; of several that with this number, if it is one of theirs.
  [[nodiscard]] const DbcMessage* find(std::string_view message,
                                       std::optional<std::uint32_t> id = {}) const noexcept;
  [[nodiscard]] std::vector<std::string> message_names() const;
};

/// @param name  stands for the file in flaws
[[nodiscard]] DbcFile read_dbc_text(std::string_view text, const std::string& name);

}  // namespace thermocomp
