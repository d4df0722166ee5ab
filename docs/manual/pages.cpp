#include "docs/manual/pages.hpp"

#include <algorithm>
#include <cctype>
#include <sstream>
#include <string_view>

#include <CLI/CLI.hpp>

namespace thermocomp::manual {
namespace {

/// Nothing in `text` is an instruction to the formatter any more; hyphens stay hyphens when copied.
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

/// The text unchanged, in a fixed font.
std::string verbatim(std::string_view text) {
  std::string out = ".nf\n\\f(CW" + escaped(text);
  if (!out.ends_with('\n')) out += '\n';
  return out + "\\fP\n.fi\n";
}

/// Paragraphs separated by blank lines; lines that begin with a blank stay unchanged.
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

/// .TH and the section NAME. The date is left out: the same sources give the same page.
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

std::string pair_list(const char* title,
                      const std::vector<std::pair<std::string, std::string>>& pairs) {
  if (pairs.empty()) return {};
  std::string text = std::string(".SH ") + title + '\n';
  for (const auto& [name, what] : pairs) text += ".TP\n" + bold(name) + '\n' + escaped(what) + '\n';
  return text;
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

/// The --help of each command and its subcommands.
std::string commands_text(const CLI::App& app, const std::string& program) {
  std::string text;
  for (const CLI::App* command : commands_of(app)) {
    const std::string name = program + " " + command->get_name();
    text +=
        ".SS " + bold(name.substr(name.find(' ') + 1)) + '\n' + verbatim(command->help(program));
    text += commands_text(*command, name);
  }
  return text;
}

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

std::string command_page(const CLI::App& app, const PageExtras& extras) {
  constexpr std::string_view status_mark = "Exit status: ";
  const std::string& name = app.get_name();
  std::string text = page_head(name, extras.section,
                               extras.section == 8 ? "System administration" : "User commands",
                               app.get_description());
  text += ".SH DESCRIPTION\n" + verbatim(app.help());
  if (!commands_of(app).empty()) text += ".SH COMMANDS\n" + commands_text(app, name);
  const std::string footer = app.get_footer();
  if (const std::size_t at = footer.find(status_mark); at != std::string::npos) {
    const std::size_t begin = at + status_mark.size();
    text += ".SH EXIT STATUS\n" + escaped(footer.substr(begin, footer.find('\n', begin) - begin));
    text += '\n';
  }
  text += pair_list("ENVIRONMENT", extras.environment) + pair_list("FILES", extras.files);
  return text + see_also(extras.see_also);
}

std::string format_page(const FormatPage& page) {
  std::string text = page_head(page.name, 5, "File formats", page.what);
  text += ".SH DESCRIPTION\n" + paragraphs(page.text);
  for (const FormatPage::Example& example : page.examples) text += example_section(example);
  return text + see_also(page.see_also);
}

}  // namespace thermocomp::manual
