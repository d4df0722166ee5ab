/// Electronic data sheets (CiA 306): names and types of the objects of a CANopen device.
///
/// An EDS file is an INI file whose comments begin a line with ';'. Libraries for INI files read
/// ';' inside a line, '#', quotes or indented lines otherwise than data sheets mean them, cut long
/// lines or do not give the line of an entry; so the form is read here, strictly: a line that is
/// neither a section, an entry, a comment nor empty is a flaw of its section, as is a section or
/// entry that stands there twice; the first one counts.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/text/problems.hpp"
#include "drivers/can/canopen/canopen_config.hpp"

namespace thermocomp {

/// A number in an object dictionary.
struct ObjectType {
  int length_bits{16};
  bool is_signed{true};
  bool is_float{false};
  bool operator==(const ObjectType&) const = default;
};

struct EdsObject {
  ObjectAddress address;
  /// ParameterName; of a sub-object that of its object, a '/', and its own. What is not printable
  /// ASCII is replaced by '?'.
  std::string name;
  std::optional<ObjectType> type;  ///< none: not a number (text, domain)
};

/// Something wrong in the file.
struct EdsFlaw {
  Problem problem;
  std::optional<ObjectAddress> object;  ///< none: of no object
  bool in_use{false};                   ///< a configuration takes the object's type from here
};

struct EdsFile {
  std::vector<EdsObject> objects;  ///< those that hold a value, by address
  std::vector<EdsFlaw> flaws;

  [[nodiscard]] const EdsObject* find(const ObjectAddress& address) const noexcept;
  /// By the whole name, or by the part behind the '/'. More than one: the name is ambiguous.
  [[nodiscard]] std::vector<const EdsObject*> find(std::string_view name) const;
  [[nodiscard]] std::vector<std::string> names() const;
};

/// @param name  stands for the file in flaws
[[nodiscard]] EdsFile read_eds_text(std::string_view text, const std::string& name);

}  // namespace thermocomp
