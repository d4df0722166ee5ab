// Messages and signals of a DBC file by their names.
#include <algorithm>

#include "config/bus_files/dbc_file.hpp"

namespace thermocomp {
namespace {

/// Finds by name, else by long name.
template <class Entries>
auto* find_by_name(Entries& entries, std::string_view name) noexcept {
  auto found = std::find_if(entries.begin(), entries.end(),
                            [name](const auto& entry) { return entry.name == name; });
  if (found == entries.end() && !name.empty()) {
    found = std::find_if(entries.begin(), entries.end(),
                         [name](const auto& entry) { return entry.long_name == name; });
  }
  return found == entries.end() ? nullptr : &*found;
}

std::vector<std::string> names_in(const auto& entries) {
  std::vector<std::string> names;
  for (const auto& entry : entries) {
    names.push_back(entry.name);
    if (!entry.long_name.empty()) names.push_back(entry.long_name);
  }
  return names;
}

}  // namespace

const DbcSignal* DbcMessage::find(std::string_view signal) const noexcept {
  return find_by_name(signals, signal);
}

std::vector<std::string> DbcMessage::signal_names() const {
  return names_in(signals);
}

const DbcMessage* DbcFile::find(std::string_view message,
                                std::optional<std::uint32_t> id) const noexcept {
  const auto numbered = std::find_if(messages.begin(), messages.end(), [&](const DbcMessage& each) {
    return each.id == id && (each.name == message || each.long_name == message);
  });
  return numbered == messages.end() ? find_by_name(messages, message) : &*numbered;
}

std::vector<std::string> DbcFile::message_names() const {
  return names_in(messages);
}

}  // namespace thermocomp
