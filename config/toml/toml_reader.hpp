/// Strict reading of a TOML file: every key has a type and a rule, every problem is collected with
/// file, line, key, value and rule, and an unknown key is an error.
///
///     TomlDocument document = TomlDocument::from_file("machine.toml");
///     const TomlTable root = document.root();
///     machine.seed = root.integer("seed", 0, 1'000'000, 1);            // default 1
///     const TomlTable room = root.table("room");                        // [room], required
///     machine.room_degC = room.number("temp_degC", Range::between(-20, 60));
///     machine.form = room.choice<Form>("form", {{"sine", Form::sine}, {"step", Form::step}});
///     for (const TomlTable& block : root.tables("block")) {             // [[block]]
///       const std::string name = block.text("name");
///       if (known.contains(name)) block.problem("name", "is used twice");
///       const double mass_kg = block.number("mass_kg", Range::above(0));
///       if (block.has("fan")) read_fan(block.table("fan"));
///     }
///     document.finish();  // throws ConfigurationError with all problems, unknown keys among them
///
/// A getter without a default requires its key. After a problem a getter returns its default or
/// another valid value, so that reading can continue; finish() then throws.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/text/problems.hpp"

namespace thermocomp {

/// Range of valid numbers; always finite.
struct Range {
  double min{-std::numeric_limits<double>::max()};
  double max{std::numeric_limits<double>::max()};
  bool min_excluded{false};

  [[nodiscard]] static Range any() { return {}; }
  [[nodiscard]] static Range between(double low, double high) { return {low, high, false}; }
  [[nodiscard]] static Range at_least(double low) { return {low, any().max, false}; }
  /// (low, high]
  [[nodiscard]] static Range above(double low, double high = any().max) {
    return {low, high, true};
  }
  [[nodiscard]] bool contains(double value) const;
  [[nodiscard]] std::string rule() const;  ///< "must be in (0, 500]"
};

/// The names of an enumeration's values, in the order shown to the user.
template <class E>
using Names = std::vector<std::pair<std::string_view, E>>;

namespace detail {
struct TomlState;
}

/// One table of a document; cheap to copy, valid while any copy of the document exists. Reading a
/// key marks it as known, even if it is absent.
class TomlTable {
 public:
  [[nodiscard]] double number(std::string_view key, Range range = {}) const;
  [[nodiscard]] double number(std::string_view key, Range range, double otherwise) const;
  /// An integer in [low, high]; `6.0` is not one.
  template <class T = int>
  [[nodiscard]] T integer(std::string_view key, T low, T high) const {
    return static_cast<T>(integer_value(key, static_cast<std::int64_t>(low),
                                        static_cast<std::int64_t>(high), std::nullopt));
  }
  template <class T = int>
  [[nodiscard]] T integer(std::string_view key, T low, T high, T otherwise) const {
    return static_cast<T>(integer_value(key, static_cast<std::int64_t>(low),
                                        static_cast<std::int64_t>(high),
                                        static_cast<std::int64_t>(otherwise)));
  }
  /// A non-empty string.
  [[nodiscard]] std::string text(std::string_view key) const;
  [[nodiscard]] std::string text(std::string_view key, std::string_view otherwise) const;
  [[nodiscard]] bool flag(std::string_view key) const;
  [[nodiscard]] bool flag(std::string_view key, bool otherwise) const;
  template <class E>
  [[nodiscard]] E choice(std::string_view key, const Names<E>& names) const {
    return names.at(choice_index(key, only_names(names), std::nullopt)).second;
  }
  template <class E>
  [[nodiscard]] E choice(std::string_view key, const Names<E>& names, E otherwise) const {
    const auto index = choice_index(key, only_names(names), names.size());
    return index == names.size() ? otherwise : names[index].second;
  }

  /// Lists. Without `otherwise` the key is required. Each invalid element is a problem and is
  /// replaced by a valid value, so that counts stay correct.
  [[nodiscard]] std::vector<double> numbers(std::string_view key, Range range = {}) const;
  [[nodiscard]] std::vector<double> numbers(std::string_view key, Range range,
                                            std::vector<double> otherwise) const;
  [[nodiscard]] std::vector<std::int64_t> integers(std::string_view key, std::int64_t low,
                                                   std::int64_t high) const;
  [[nodiscard]] std::vector<std::int64_t> integers(std::string_view key, std::int64_t low,
                                                   std::int64_t high,
                                                   std::vector<std::int64_t> otherwise) const;
  [[nodiscard]] std::vector<std::string> texts(std::string_view key) const;
  /// @param takes_empty  whether an element may be ""
  [[nodiscard]] std::vector<std::string> texts(std::string_view key,
                                               std::vector<std::string> otherwise,
                                               bool takes_empty = false) const;
  /// A required matrix of finite numbers, shape (rows, columns); empty after a problem.
  [[nodiscard]] std::vector<std::vector<double>> matrix(std::string_view key, std::size_t rows,
                                                        std::size_t columns) const;

  /// A required table. After a problem, the result reports no further ones.
  [[nodiscard]] TomlTable table(std::string_view key) const;
  /// An optional table; if absent, an empty one.
  [[nodiscard]] TomlTable table_or_empty(std::string_view key) const;
  /// `[[key]]`; empty if absent.
  [[nodiscard]] std::vector<TomlTable> tables(std::string_view key) const;
  /// `[[key]]`, at least one.
  [[nodiscard]] std::vector<TomlTable> tables_required(std::string_view key) const;

  /// This table merged over `base`: missing keys are looked up there, and problems name the key's
  /// file and line. Nested tables are not merged; keys() is unchanged.
  [[nodiscard]] TomlTable over(const TomlTable& base) const;

  /// Whether the key is present. Marks it as known.
  [[nodiscard]] bool has(std::string_view key) const;
  /// Whether the value has this type; false if absent. Marks the key as known.
  [[nodiscard]] bool is_text(std::string_view key) const;
  /// ... or is a list that begins with a number.
  [[nodiscard]] bool is_list_of_numbers(std::string_view key) const;
  [[nodiscard]] bool is_table(std::string_view key) const;
  /// The present keys in file order; marks none. For tables with arbitrary keys.
  [[nodiscard]] std::vector<std::string> keys() const;

  /// Reports a rule of the caller that `key` breaks, with its value and line.
  void problem(std::string_view key, std::string_view rule) const;
  /// The same for an element of the key's list or a part of its value.
  void problem(std::string_view key, std::string_view value, std::string_view rule) const;
  /// Reports `key`, if present, as not allowed, with the reason `rule`.
  void refuse(std::string_view key, std::string_view rule) const;
  /// Suppresses problems for unknown keys of this table, whose meaning depends on a wrong key.
  void ignore_rest() const;

  /// Line of the key, or of the table if the key is absent.
  [[nodiscard]] int line(std::string_view key) const;
  [[nodiscard]] int line() const noexcept { return line_; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }  ///< "bus[cabinet]"
  /// Whether it is in the file (false: table_or_empty() of an absent key, or after a problem).
  [[nodiscard]] explicit operator bool() const noexcept { return node_ != nullptr; }

 private:
  friend class TomlDocument;
  TomlTable(std::shared_ptr<detail::TomlState> state, const void* node, std::string path, int line,
            bool silent);

  template <class E>
  static std::vector<std::string_view> only_names(const Names<E>& names) {
    std::vector<std::string_view> result;
    for (const auto& entry : names) result.push_back(entry.first);
    return result;
  }
  [[nodiscard]] std::int64_t integer_value(std::string_view key, std::int64_t low,
                                           std::int64_t high,
                                           std::optional<std::int64_t> otherwise) const;
  [[nodiscard]] std::size_t choice_index(std::string_view key,
                                         const std::vector<std::string_view>& names,
                                         std::optional<std::size_t> otherwise) const;
  [[nodiscard]] const void* find(std::string_view key) const;  ///< marks the key; nullptr: absent
  [[nodiscard]] const void* find_own(std::string_view key) const;
  [[nodiscard]] const TomlTable& owner(
      std::string_view key) const;  ///< the table that has the key, or this
  [[nodiscard]] std::string full(std::string_view key) const;
  [[nodiscard]] TomlTable child(std::string_view key, const void* node, std::string path) const;
  [[nodiscard]] TomlTable silent_child(std::string_view key) const;
  void missing(std::string_view key) const;
  /// Calls `each(element, position counted from 1)` for every element of a list.
  void for_each_element(std::string_view key, bool required, std::string_view what,
                        const std::function<void(const void*, std::size_t)>& each) const;

  std::shared_ptr<detail::TomlState> state_;
  const void* node_;  ///< a toml::table; nullptr: absent
  std::string path_;
  int line_;
  bool silent_;
  std::shared_ptr<const TomlTable> base_;  ///< of over()
};

class TomlDocument {
 public:
  /// @throws ConfigurationError when the file cannot be read or is not TOML (with the line)
  [[nodiscard]] static TomlDocument from_file(const std::filesystem::path& path);
  /// @param name  file name in problems
  [[nodiscard]] static TomlDocument from_text(std::string text, std::string name);

  [[nodiscard]] TomlTable root() const;
  [[nodiscard]] const std::string& text() const noexcept;  ///< as read
  [[nodiscard]] const std::string& name() const noexcept;
  /// All problems so far, and every key in the file that was not read. For callers with several
  /// files; others call finish().
  [[nodiscard]] std::vector<Problem> all_problems() const;
  /// @throws ConfigurationError if there is any problem
  void finish() const;

 private:
  explicit TomlDocument(std::shared_ptr<detail::TomlState> state);
  std::shared_ptr<detail::TomlState> state_;
};

/// Reads a regular file of at most 4 MB.
/// @throws ConfigurationError
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path);

/// The name in `known` closest to `name`, if close enough and unambiguous; else empty.
[[nodiscard]] std::string nearest_name(std::string_view name,
                                       const std::vector<std::string>& known);

/// Size limits of files, checked before reading.
inline constexpr std::uintmax_t bytes_per_MB = std::uintmax_t{1024} * 1024;
/// Configurations, presets, descriptions of machines, structures, factors.
inline constexpr std::uintmax_t file_bytes_max = 4 * bytes_per_MB;
/// Models; tables of messages and objects (DBC, EDS).
inline constexpr std::uintmax_t model_bytes_max = 16 * bytes_per_MB;
inline constexpr std::uintmax_t bus_table_bytes_max = 16 * bytes_per_MB;
/// Run files.
inline constexpr std::uintmax_t run_bytes_max = 64 * bytes_per_MB;

/// Reads a regular file. @throws ConfigurationError
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path,
                                         std::uintmax_t bytes_max);

}  // namespace thermocomp
