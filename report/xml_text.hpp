/// Text inside SVG, HTML and VTU files.
#pragma once

#include <string>

namespace thermocomp {

/// `text` with &, <, > and " as references, for elements and for attributes in double quotes.
[[nodiscard]] std::string xml_text(const std::string& text);

}  // namespace thermocomp
