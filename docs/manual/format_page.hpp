/// The manual page of a file format: the commented example is the reference.
#pragma once

#include <string>
#include <vector>

namespace thermocomp::manual {

struct FormatPage {
  std::string name;  ///< "thermocompd.toml"
  std::string what;  ///< one line
  std::string text;  ///< paragraphs
  struct Example {
    std::string title;
    std::string toml;  ///< split at its lines "# ------- heading" and "# ======= heading"
  };
  std::vector<Example> examples;
  std::vector<std::string> see_also;
};

/// In man(7), section 5.
[[nodiscard]] std::string format_page(const FormatPage& page);

}  // namespace thermocomp::manual
