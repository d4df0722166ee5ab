#include "config/bus_files/eds_file.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdio>
#include <map>
#include <tuple>

#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t flaw_letters_max = 60;  // characters of a value in a flaw
constexpr std::uint64_t object_variable = 0x7;
constexpr std::uint64_t object_domain = 0x2;
constexpr std::uint64_t sub_max = 0xFE;  // sub-index FF describes the structure

std::string_view without_blanks(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

std::string printed(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (c < 0x20 || c > 0x7E) c = '?';
  }
  return result;
}

/// C syntax: 0x hexadecimal, 0 octal, else decimal.
std::optional<std::uint64_t> number(std::string_view text) {
  int base = 10;
  if (text.size() > 2 && text[0] == '0' && (text[1] == 'x' || text[1] == 'X')) {
    base = 16;
    text.remove_prefix(2);
  } else if (text.size() > 1 && text[0] == '0') {
    base = 8;
  }
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// The numeric data types of CiA 301.
std::optional<ObjectType> type_of(std::uint64_t code) {
  switch (code) {
    case 0x01:
      return ObjectType{1, false, false};
    case 0x02:
      return ObjectType{8, true, false};
    case 0x03:
      return ObjectType{16, true, false};
    case 0x04:
      return ObjectType{32, true, false};
    case 0x05:
      return ObjectType{8, false, false};
    case 0x06:
      return ObjectType{16, false, false};
    case 0x07:
      return ObjectType{32, false, false};
    case 0x08:
      return ObjectType{32, true, true};
    case 0x10:
      return ObjectType{24, true, false};
    case 0x11:
      return ObjectType{64, true, true};
    case 0x15:
      return ObjectType{64, true, false};
    case 0x16:
      return ObjectType{24, false, false};
    case 0x1B:
      return ObjectType{64, false, false};
    default:
      return std::nullopt;
  }
}

struct Entry {
  std::string value;
  int line{0};
};
struct Section {
  std::string name;  ///< as written
  int line{0};
  std::map<std::string, Entry> entries;  ///< by key in lower case
};

class EdsReader {
 public:
  explicit EdsReader(std::string name) : name_(std::move(name)) {}

  EdsFile read(std::string_view text) {
    read_lines(text);
    for (const auto& [key, section] : sections_) {
      about_ = address_of(key);
      read_object(key, section);
    }
    about_.reset();
    if (flaws_.size() >= flaws_max) objects_.clear();
    if (objects_.empty()) flaw(0, "", "", "is not an electronic data sheet: it has no objects");
    EdsFile file;
    for (auto& [address, object] : objects_) file.objects.push_back(std::move(object));
    file.flaws = std::move(flaws_);
    return file;
  }

 private:
  using Key = std::pair<std::uint16_t, std::uint8_t>;

  void flaw(int line, const std::string& key, std::string_view value, const std::string& rule) {
    const std::string_view shown = value.empty() && !key.empty() ? "(missing)" : value;
    EdsFlaw& made = flaws_.emplace_back();
    made.problem = {name_, line, printed(key.substr(0, flaw_letters_max)),
                    printed(shown.substr(0, flaw_letters_max)), rule};
    if (about_) made.object = ObjectAddress{about_->first, about_->second};
  }

  void read_lines(std::string_view text) {
    if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
    Section* section = nullptr;
    int line = 0;
    while (!text.empty() && flaws_.size() < flaws_max) {
      ++line;
      const std::size_t end = text.find('\n');
      const std::string_view content = without_blanks(text.substr(0, end));
      text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
      if (content.empty() || content.front() == ';') continue;
      if (content.front() == '[') {
        about_.reset();
        section = begin_section(content, line);
      } else {
        read_entry(section, content, line);
      }
    }
  }

  Section* begin_section(std::string_view content, int line) {
    if (content.back() != ']' || content.size() < 3) {
      flaw(line, "", content, "must be a section's name in brackets");
      return &nowhere_;
    }
    const std::string name(without_blanks(content.substr(1, content.size() - 2)));
    about_ = address_of(lower(name));
    const auto [found, is_new] = sections_.try_emplace(lower(name), Section{name, line, {}});
    if (is_new) return &found->second;
    flaw(line, "", name, "appears twice, first in line " + std::to_string(found->second.line));
    nowhere_ = {};
    return &nowhere_;
  }

  void read_entry(Section* section, std::string_view content, int line) {
    const std::size_t equal = content.find('=');
    if (equal == std::string_view::npos || equal == 0) {
      flaw(line, "", content, "must be a section, an entry KEY=VALUE or a comment");
      return;
    }
    if (section == nullptr) {
      flaw(line, "", content, "must be in a section");
      return;
    }
    const std::string key(without_blanks(content.substr(0, equal)));
    const std::string value(without_blanks(content.substr(equal + 1)));
    const bool is_new = section->entries.try_emplace(lower(key), Entry{value, line}).second;
    if (!is_new) flaw(line, key, value, "appears twice in its section");
  }

  /// The object of a section name; nullopt: another section.
  static std::optional<Key> address_of(const std::string& key) {
    constexpr std::size_t index_digits = 4;
    const auto hexadecimal = [](std::string_view digits) -> std::optional<unsigned> {
      unsigned value = 0;
      const auto [end, error] =
          std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
      if (error != std::errc{} || end != digits.data() + digits.size()) return std::nullopt;
      return value;
    };
    if (key.size() < index_digits) return std::nullopt;
    const auto index = hexadecimal(std::string_view(key).substr(0, index_digits));
    if (!index) return std::nullopt;
    const std::string_view rest = std::string_view(key).substr(index_digits);
    if (rest.empty()) return Key{static_cast<std::uint16_t>(*index), 0};
    if (!rest.starts_with("sub")) return std::nullopt;
    const auto sub = hexadecimal(rest.substr(3));
    if (!sub || *sub > sub_max) return std::nullopt;
    return Key{static_cast<std::uint16_t>(*index), static_cast<std::uint8_t>(*sub)};
  }

  std::optional<std::uint64_t> number_of(const Section& section, const char* key,
                                         std::uint64_t otherwise) {
    const auto found = section.entries.find(lower(key));
    if (found == section.entries.end() || found->second.value.empty()) return otherwise;
    const auto value = number(found->second.value);
    if (!value) {
      flaw(found->second.line, section.name + "." + key, found->second.value,
           "must be a whole number");
    }
    return value;
  }

  std::string text_of(const Section& section, const char* key) {
    const auto found = section.entries.find(lower(key));
    return found == section.entries.end() ? std::string() : printed(found->second.value);
  }

  void read_object(const std::string& key, const Section& section) {
    const std::optional<Key> address = address_of(key);
    if (!address) return;
    const std::string own = text_of(section, "ParameterName");
    if (own.empty()) flaw(section.line, section.name + ".ParameterName", "", "must be given");
    const auto kind = number_of(section, "ObjectType", object_variable);
    const bool is_sub = key.size() > 4;
    const auto parent = sections_.find(key.substr(0, 4));
    if (is_sub && parent == sections_.end())
      flaw(section.line, "", section.name, "is part of a missing object");
    if (kind && *kind != object_variable && *kind != object_domain) {
      if (const auto compact = number_of(section, "CompactSubObj", 0)) {
        add_compact(*address, section, own, *compact);
      }
      return;  // an array or record: its sub-objects have the values
    }
    const bool has_whole = is_sub && !own.empty() && parent != sections_.end();
    add(section, *address, has_whole ? text_of(parent->second, "ParameterName") + "/" + own : own);
  }

  void add(const Section& section, Key address, const std::string& name) {
    const auto type = number_of(section, "DataType", 0);
    EdsObject object{{address.first, address.second}, name, std::nullopt};
    if (type) object.type = type_of(*type);
    // 1018sub1 and 1018sub01 are the same address.
    if (!objects_.try_emplace(address, std::move(object)).second) {
      flaw(section.line, "", section.name, "is a duplicate object");
    }
  }

  /// CompactSubObj: identical sub-objects 1 to count, described once.
  void add_compact(Key address, const Section& section, const std::string& name,
                   std::uint64_t count) {
    if (count > sub_max) {
      flaw(section.line, section.name + ".CompactSubObj", std::to_string(count),
           "must be at most 254");
      return;
    }
    const auto names = sections_.find(lower(section.name) + "name");
    for (std::uint64_t sub = 1; sub <= count; ++sub) {
      std::string own = std::string(name).append(std::to_string(sub));
      if (names != sections_.end()) {
        const std::string given = text_of(names->second, std::to_string(sub).c_str());
        if (!given.empty()) own = given;
      }
      add(section, {address.first, static_cast<std::uint8_t>(sub)},
          std::string(name).append("/").append(own));
    }
  }

  std::string name_;
  std::map<std::string, Section> sections_;  ///< by name in lower case
  Section nowhere_;                          ///< collects entries of a refused section
  std::map<Key, EdsObject> objects_;
  std::vector<EdsFlaw> flaws_;
  std::optional<Key> about_;  ///< the present object
};

}  // namespace

const EdsObject* EdsFile::find(const ObjectAddress& address) const noexcept {
  const auto found = std::find_if(objects.begin(), objects.end(),
                                  [&](const EdsObject& each) { return each.address == address; });
  return found == objects.end() ? nullptr : &*found;
}

std::vector<const EdsObject*> EdsFile::find(std::string_view name) const {
  std::vector<const EdsObject*> found;
  for (const EdsObject& object : objects) {
    const std::string_view whole = object.name;
    const bool is_part = whole.size() > name.size() && whole.ends_with(name) &&
                         whole[whole.size() - name.size() - 1] == '/';
    if (whole == name) return {&object};
    if (is_part) found.push_back(&object);
  }
  return found;
}

std::vector<std::string> EdsFile::names() const {
  std::vector<std::string> names;
  names.reserve(objects.size());
  for (const EdsObject& object : objects) names.push_back(object.name);
  return names;
}

EdsFile read_eds_text(std::string_view text, const std::string& name) {
  return EdsReader(name).read(text);
}

}  // namespace thermocomp
