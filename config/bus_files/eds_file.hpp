/// Electronic data sheets (CiA 306): names and types of the objects of a CANopen device.
///
/// An EDS file is an INI file with comment lines that begin with ';'. INI libraries differ in ';'
/// inside a line, '#', quotes and indented lines, cut long lines or do not report the line of an
/// entry. Hence this strict parser: a line that is not a section, entry, comment or empty is a flaw
/// of its section, as is a repeated section or entry; the first one counts.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/text/problems.hpp"
#include "drivers/can/canopen/canopen_config.hpp"

namespace thermocomp {

/// Numeric type in an object dictionary.
struct ObjectType {
  int length_bits{16};
  bool is_signed{true};
  bool is_float{false};
  bool operator==(const ObjectType&) const = default;
};

struct EdsObject {
  ObjectAddress address;
  /// ParameterName; for a sub-object that of its object, a '/', and its own. Unprintable characters
  /// are replaced by '?'.
  std::string name;
  std::optional<ObjectType> type;  ///< none: not a number (text, domain)
};

/// An error in the file.
struct EdsFlaw {
  Problem problem;
  std::optional<ObjectAddress> object;  ///< none: not at an object
  bool in_use{false};                   ///< the configuration uses the object's type
};

struct EdsFile {
  std::vector<EdsObject> objects;  ///< objects with a value, by address
  std::vector<EdsFlaw> flaws;

  [[nodiscard]] const EdsObject* find(const ObjectAddress& address) const noexcept;
  /// By full name, or by the part after the '/'. More than one: the name is ambiguous.
  [[nodiscard]] std::vector<const EdsObject*> find(std::string_view name) const;
  [[nodiscard]] std::vector<std::string> names() const;
};

/// @param name  file name in flaws
[[nodiscard]] EdsFile read_eds_text(std::string_view text, const std::string& name);

}  // namespace thermocomp
