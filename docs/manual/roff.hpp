/// Text as the man(7) macros want it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace thermocomp::manual {

/// Nothing in `text` is an instruction to the formatter any more; hyphens stay hyphens when copied.
[[nodiscard]] std::string escaped(std::string_view text);

/// A paragraph a line of blank text, and lines that begin with a blank as they stand.
[[nodiscard]] std::string paragraphs(std::string_view text);

/// As it stands, in a fixed font.
[[nodiscard]] std::string verbatim(std::string_view text);

[[nodiscard]] std::string bold(std::string_view text);
[[nodiscard]] std::string italic(std::string_view text);

/// .TH and the section NAME. The date is left out: the same sources give the same page.
[[nodiscard]] std::string page_head(const std::string& name, int section, const std::string& manual,
                                    const std::string& what);

/// @param pages  "thermocomp(1)"
[[nodiscard]] std::string see_also(const std::vector<std::string>& pages);

}  // namespace thermocomp::manual
