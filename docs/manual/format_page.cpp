#include "docs/manual/format_page.hpp"

#include <sstream>

#include "docs/manual/roff.hpp"

namespace thermocomp::manual {
namespace {

/// The heading of a line such as "# ------------ sensors"; empty: it is none.
std::string heading(const std::string& line) {
  if (!line.starts_with("# ---") && !line.starts_with("# ===")) return {};
  const std::size_t begin = line.find_first_not_of("#-= ");
  return begin == std::string::npos ? std::string() : line.substr(begin);
}

std::string example_section(const FormatPage::Example& example) {
  std::string text = ".SH " + escaped(example.title) + '\n';
  std::string part;
  const auto end_part = [&] {
    const std::size_t last = part.find_last_not_of('\n');
    if (last != std::string::npos) text += verbatim(part.substr(0, last + 1));
    part.clear();
  };
  std::istringstream lines(example.toml);
  for (std::string line; std::getline(lines, line);) {
    const std::string title = heading(line);
    if (title.empty()) {
      part += line + '\n';
      continue;
    }
    end_part();
    text += ".SS " + escaped(title) + '\n';
  }
  end_part();
  return text;
}

}  // namespace

std::string format_page(const FormatPage& page) {
  std::string text = page_head(page.name, 5, "File formats", page.what);
  text += ".SH DESCRIPTION\n" + paragraphs(page.text);
  for (const FormatPage::Example& example : page.examples) text += example_section(example);
  return text + see_also(page.see_also);
}

}  // namespace thermocomp::manual
