/// The text of a log: decoding of its bytes, its lines, and their fields.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace thermocomp {

struct RunText {
  std::string text;  ///< UTF-8, without a byte order mark
  bool from_latin1{false};
};

/// UTF-8, UTF-16, else Latin-1.
/// @param encoding  a name of iconv(3); empty: one of these
/// @throws ConfigurationError when the bytes are not text (a workbook, an archive, a database), or
///         text of several bytes a letter in no known encoding
[[nodiscard]] RunText run_text(std::string_view bytes, const std::string& name,
                               const std::string& encoding = {});

/// Whether bytes are an Excel workbook or a similar archive.
[[nodiscard]] bool is_workbook(std::string_view bytes);

struct TextLine {
  int number{0};  ///< counted from 1
  std::string_view text;
};

struct TextLines {
  std::vector<TextLine> lines;    ///< without empty lines, comments and drawn frames
  std::vector<int> references;    ///< numbers of the comments "command reference" of an export
  TextLine last_comment;          ///< of those above the first line
  std::optional<char> separator;  ///< stated by Excel's "sep=;"
};

/// Also spells signs and groups of digits plainly, and joins the lines of a quoted name.
/// @param lines_above  lines of the file before `text`
/// @param first_line  earlier ones are left out
[[nodiscard]] TextLines find_lines(std::string& text, int lines_above, int first_line);

/// Splits at blanks and tabs.
[[nodiscard]] std::vector<std::string_view> words_of(std::string_view line);

/// A quoted field may contain the separator and doubled quotes. A quote with text behind it is a
/// part of its field: "AI".Bed.
/// @return false for an unclosed quote
bool split_line(std::string_view line, char separator, std::vector<std::string_view>& fields);

/// Replaces each doubled quote by one.
[[nodiscard]] std::string unquoted(std::string_view field);

}  // namespace thermocomp
