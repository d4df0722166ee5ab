#include "config/run_forms/log_form.hpp"

#include <array>
#include <utility>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_lines.hpp"
#include "config/text/problems.hpp"

namespace thermocomp {
namespace {

/// The first form that recognises the text is used.
constexpr std::array known_forms{forms::json_log,   forms::halscope, forms::lvm,
                                 forms::kw_watcher, forms::twincat,  forms::halsampler,
                                 forms::labelled};

}  // namespace

PlainTable plain_table(std::string text, const std::string& name, const ColumnMap& map) {
  const forms::Log log{text, name, map};
  if (trimmed(log.text.substr(0, 100)).starts_with('<'))
    log.refuse(1, "", shortened(log.text.substr(0, text.find('\n'))),
               "is XML, which is not a known table; write its values as CSV or JSON lines");
  for (const auto& form : known_forms)
    if (auto table = form(log)) return *std::move(table);
  return {std::move(text), {}};
}

namespace forms {

void Log::refuse(int line, const std::string& key, const std::string& value,
                 std::string rule) const {
  throw ConfigurationError({Problem{name, line, key, value, std::move(rule)}});
}

std::vector<std::string> fields_of(std::string_view line, char separator) {
  std::vector<std::string_view> parts;
  split_line(line, separator, parts);
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

std::size_t NamedColumns::add(const std::string& header) {
  headers_.push_back(header);
  return headers_.size() - 1;
}

std::size_t NamedColumns::find_or_add(const std::string& name) {
  const auto [found, is_new] = index_.emplace(name, headers_.size());
  return is_new ? add(with_unit(name, units_[name])) : found->second;
}

std::string& NamedColumns::cell(std::size_t row, std::size_t column) {
  if (row >= rows_.size()) rows_.resize(row + 1);
  if (column >= rows_[row].size()) rows_[row].resize(column + 1);
  return rows_[row][column];
}

std::string NamedColumns::text(const std::vector<int>& lines) const {
  std::string text;
  for (const std::string& header : headers_) text.append(text.empty() ? "" : ",").append(header);
  int line = 0;
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    // Empty lines keep the log's line numbers.
    const int next = lines.empty() ? line + 1 : lines[row];
    text.append(static_cast<std::size_t>(next - line), '\n');
    line = next;
    for (std::size_t i = 0; i < headers_.size(); ++i)
      text.append(i > 0 ? "," : "").append(i < rows_[row].size() ? rows_[row][i] : "");
  }
  return text + '\n';
}

}  // namespace forms

}  // namespace thermocomp
