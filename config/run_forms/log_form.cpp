#include "config/run_forms/log_form.hpp"

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_lines.hpp"
#include "config/text/problems.hpp"

namespace thermocomp {
namespace {

struct Form {
  bool (*is)(std::string_view text);
  PlainTable (*plain)(const forms::Log& log);
};
/// The first form that recognises the text is used.
constexpr Form known_forms[] = {
    {forms::is_json, forms::plain_json},        {forms::is_halscope, forms::plain_halscope},
    {forms::is_lvm, forms::plain_lvm},          {forms::is_kw_watcher, forms::plain_kw_watcher},
    {forms::is_twincat, forms::plain_twincat},  {forms::is_halsampler, forms::plain_halsampler},
    {forms::is_labelled, forms::plain_labelled}};

}  // namespace

PlainTable plain_table(std::string text, const std::string& name, const ColumnMap& map) {
  const forms::Log log{text, name, map};
  if (trimmed(log.text.substr(0, 100)).starts_with('<'))
    log.refuse(1, "", shortened(log.text.substr(0, text.find('\n'))),
               "is XML, which is not a known table; write its values as CSV or JSON lines");
  for (const Form& form : known_forms)
    if (form.is(text)) return form.plain(log);
  PlainTable table;
  table.text = std::move(text);
  return table;
}

namespace forms {

void Log::refuse(int line, const std::string& key, const std::string& value,
                 std::string rule) const {
  throw ConfigurationError({Problem{name, line, key, value, std::move(rule)}});
}

std::string_view take_line(std::string_view& text) {
  std::string_view line;
  static_cast<void>(take(text, '\n', line));
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

std::vector<std::string> fields_of(std::string_view line, char separator) {
  std::vector<std::string_view> parts;
  static_cast<void>(split_line(line, separator, parts));
  std::vector<std::string> fields;
  for (const std::string_view part : parts) fields.push_back(unquoted(part));
  if (fields.empty()) fields.emplace_back();  // an empty line, between blanks
  return fields;
}

std::string in_quotes(std::string_view field) {
  std::string text = "\"";
  for (const char c : field) text += c == '"' || c == '\n' || c == '\r' ? '\'' : c;
  return text + '"';
}

std::string with_unit(std::string_view name, std::string_view unit) {
  std::string header(name);
  if (!unit.empty() && spelled_name(header).known == nullptr)
    header.append(" [").append(unit).append("]");
  return in_quotes(header);
}

}  // namespace forms

}  // namespace thermocomp
