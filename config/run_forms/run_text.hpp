/// Decoding of a log's bytes.
#pragma once

#include <string>
#include <string_view>

namespace thermocomp {

struct RunText {
  std::string text;  ///< UTF-8, without a byte order mark
  bool from_latin1{false};
};

/// UTF-8, UTF-16 with a byte order mark, else Latin-1.
/// @throws ConfigurationError when the bytes are not text (a workbook, an archive, a database)
[[nodiscard]] RunText run_text(std::string_view bytes, const std::string& name);

/// Whether bytes are an Excel workbook or a similar archive.
[[nodiscard]] bool is_workbook(std::string_view bytes);

}  // namespace thermocomp
