/// Strict reading of a TOML file: every key has a type and a rule, every problem is collected with
/// file, line, key, value and rule, and a key that nobody asked for is an error.
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
/// else something harmless inside the rule (so that reading can go on); finish() then throws.
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

/// Numbers a key may have; always finite.
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

/// The names of an enumeration's values, in the order in which they are shown to the user.
template <class E>
using Names = std::vector<std::pair<std::string_view, E>>;

namespace detail {
struct TomlState;
}

/// One table of a document; cheap to copy, valid for as long as some copy of the document is.
/// Reading a key marks it as known, even where it is absent.
class TomlTable {
 public:
  [[nodiscard]] double number(std::string_view key, Range range = {}) const;
  [[nodiscard]] double number(std::string_view key, Range range, double otherwise) const;
  /// A whole number in [low, high]; `6.0` is not one.
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
  /// A string that is not empty.
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

  /// Lists. Without `otherwise` the key is required. Each bad element is a problem of its own and
  /// is left in place with a harmless value, so that counts stay right.
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
  /// Rows of finite numbers, shape (rows, columns); empty after a problem. Required.
  [[nodiscard]] std::vector<std::vector<double>> matrix(std::string_view key, std::size_t rows,
                                                        std::size_t columns) const;

  /// A required table. After a problem the result is silent: nothing more is said about its keys.
  [[nodiscard]] TomlTable table(std::string_view key) const;
  /// A table that may be left out; then it is as if it were there and empty.
  [[nodiscard]] TomlTable table_or_empty(std::string_view key) const;
  /// `[[key]]`, none if absent.
  [[nodiscard]] std::vector<TomlTable> tables(std::string_view key) const;
  /// `[[key]]`, at least one.
  [[nodiscard]] std::vector<TomlTable> tables_required(std::string_view key) const;

  /// This table over `base`: a key that is not here is looked up there, and problems name the file
  /// and the line where it stands. Nested tables are not merged; keys() is as before.
  [[nodiscard]] TomlTable over(const TomlTable& base) const;

  /// Whether the key stands there. Marks it as known.
  [[nodiscard]] bool has(std::string_view key) const;
  /// Whether the value is of this sort; false if absent. Marks the key as known.
  [[nodiscard]] bool is_text(std::string_view key) const;
  /// ... or a list that begins with one.
  [[nodiscard]] bool is_list_of_numbers(std::string_view key) const;
  [[nodiscard]] bool is_table(std::string_view key) const;
  /// The keys that stand there, in the order of the file; marks none. For tables of free names.
  [[nodiscard]] std::vector<std::string> keys() const;

  /// A rule of the caller's own that `key` breaks; value and line are looked up.
  void problem(std::string_view key, std::string_view rule) const;
  /// The same, about one element of the key's list or about what is inside the value.
  void problem(std::string_view key, std::string_view value, std::string_view rule) const;
  /// `key` must not stand here: `rule` says why.
  void refuse(std::string_view key, std::string_view rule) const;
  /// Does not report keys of this table that nobody asked for (because their meaning depends on a
  /// key that has a problem).
  void ignore_rest() const;

  /// Line of the key, or of the table where the key is absent.
  [[nodiscard]] int line(std::string_view key) const;
  [[nodiscard]] int line() const noexcept { return line_; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }  ///< "bus[cabinet]"
  /// Whether it stands in the file (false: table_or_empty of an absent key, or after a problem).
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
  [[nodiscard]] const void* find(std::string_view key) const;  ///< marks; nullptr: absent
  [[nodiscard]] const void* find_own(std::string_view key) const;
  [[nodiscard]] const TomlTable& owner(std::string_view key) const;  ///< where it stands, or this
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
  /// @param name stands for the file in problems
  [[nodiscard]] static TomlDocument from_text(std::string text, std::string name);

  [[nodiscard]] TomlTable root() const;
  [[nodiscard]] const std::string& text() const noexcept;  ///< as read
  [[nodiscard]] const std::string& name() const noexcept;
  /// Everything found so far and, besides, every key that stands in the file but that nobody read.
  /// For those who have several files to report about; others call finish().
  [[nodiscard]] std::vector<Problem> all_problems() const;
  /// @throws ConfigurationError unless there is no problem at all
  void finish() const;

 private:
  explicit TomlDocument(std::shared_ptr<detail::TomlState> state);
  std::shared_ptr<detail::TomlState> state_;
};

/// The text of a regular file of at most 4 MB (config/toml/toml_reader.hpp has the limits).
/// @throws ConfigurationError
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path);

/// The name of `known` that is so near to `name` that it was probably meant; else empty, also where
/// another one may have been meant as well.
[[nodiscard]] std::string nearest_name(std::string_view name,
                                       const std::vector<std::string>& known);

/// How large a file that somebody wrote may be; it is refused before it is read.
inline constexpr std::uintmax_t bytes_per_MB = std::uintmax_t{1024} * 1024;
/// A configuration, a preset, what describes a machine, a structure, factors.
inline constexpr std::uintmax_t file_bytes_max = 4 * bytes_per_MB;
/// Models; tables of messages and objects (DBC, EDS), which others wrote.
inline constexpr std::uintmax_t model_bytes_max = 16 * bytes_per_MB;
inline constexpr std::uintmax_t bus_table_bytes_max = 16 * bytes_per_MB;
/// Run files.
inline constexpr std::uintmax_t run_bytes_max = 64 * bytes_per_MB;

/// The text of a regular file. @throws ConfigurationError
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path,
                                         std::uintmax_t bytes_max);

}  // namespace thermocomp
