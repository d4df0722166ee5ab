#include "docs/manual/roff.hpp"

#include <algorithm>
#include <cctype>
#include <sstream>

namespace thermocomp::manual {

std::string escaped(std::string_view text) {
  std::string out;
  bool line_begins = true;
  for (const char c : text) {
    // A dot or an apostrophe at the beginning of a line would be a macro.
    if (line_begins && (c == '.' || c == '\'')) out += "\\&";
    line_begins = c == '\n';
    switch (c) {
      case '\\':
        out += "\\e";
        break;
      case '-':
        out += "\\-";
        break;
      case '\'':
        out += "\\(aq";
        break;
      case '`':
        out += "\\(ga";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '~':
        out += "\\(ti";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string verbatim(std::string_view text) {
  std::string out = ".nf\n\\f(CW" + escaped(text);
  if (!out.ends_with('\n')) out += '\n';
  return out + "\\fP\n.fi\n";
}

std::string paragraphs(std::string_view text) {
  std::string out;
  std::string shown;
  bool separated = true;
  std::istringstream lines{std::string(text)};
  const auto end_verbatim = [&] {
    if (!shown.empty()) out += ".PP\n.RS 4\n" + verbatim(shown) + ".RE\n.PP\n";
    shown.clear();
  };
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.front() == ' ') {
      shown += line.substr(line.find_first_not_of(' ')) + '\n';
      continue;
    }
    end_verbatim();
    if (line.empty()) {
      if (!separated) out += ".PP\n";
      separated = true;
      continue;
    }
    out += escaped(line) + '\n';
    separated = false;
  }
  end_verbatim();
  return out;
}

std::string bold(std::string_view text) {
  return "\\fB" + escaped(text) + "\\fP";
}

std::string italic(std::string_view text) {
  return "\\fI" + escaped(text) + "\\fP";
}

std::string page_head(const std::string& name, int section, const std::string& manual,
                      const std::string& what) {
  std::string title = name;
  std::transform(title.begin(), title.end(), title.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  std::string lower = what;
  if (lower.size() > 1 && std::islower(static_cast<unsigned char>(lower[1])) != 0)
    lower[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(lower[0])));
  return ".TH " + escaped(title) + " " + std::to_string(section) + " \"\" \"thermocomp " +
         THERMOCOMP_VERSION + "\" \"" + manual + "\"\n.SH NAME\n" + escaped(name) + " \\- " +
         escaped(lower) + '\n';
}

std::string see_also(const std::vector<std::string>& pages) {
  std::string text;
  for (const std::string& page : pages) {
    const std::size_t bracket = page.find('(');
    text += text.empty() ? ".SH SEE ALSO\n" : ",\n";
    text += bold(page.substr(0, bracket)) + page.substr(bracket);
  }
  return text.empty() ? text : text + '\n';
}

}  // namespace thermocomp::manual
