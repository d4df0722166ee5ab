#include "cli/observe/truth_file.hpp"

#include <algorithm>
#include <charconv>
#include <limits>
#include <sstream>
#include <utility>

namespace thermocomp::cli {

namespace {

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream stream(line);
  for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
  return fields;
}

double number_in(const std::string& field) {
  double value = 0.0;
  const auto result = std::from_chars(field.data(), field.data() + field.size(), value);
  return result.ec == std::errc() ? value : std::numeric_limits<double>::quiet_NaN();
}

double value_of(const std::vector<std::string>& columns, const std::vector<double>& values,
                const std::string& column) {
  const auto found = std::find(columns.begin(), columns.end(), column);
  const auto index = static_cast<std::size_t>(found - columns.begin());
  return index < values.size() ? values[index] : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

double TruthRow::value(const std::string& column) const {
  return value_of(columns, values, column);
}

double TruthRow::change(const std::string& column) const {
  return value_of(columns, values, column) - value_of(columns, first, column);
}

TruthFile::TruthFile(std::filesystem::path path) : path_(std::move(path)) {}

const TruthRow* TruthFile::newest() {
  if (!file_.is_open()) file_.open(path_);
  file_.clear();
  char buffer[4096];
  while (file_.read(buffer, sizeof buffer), file_.gcount() > 0) {
    unfinished_.append(buffer, static_cast<std::size_t>(file_.gcount()));
  }
  for (auto end = unfinished_.find('\n'); end != std::string::npos; end = unfinished_.find('\n')) {
    take_line(unfinished_.substr(0, end));
    unfinished_.erase(0, end + 1);
  }
  return row_.values.empty() ? nullptr : &row_;
}

void TruthFile::take_line(const std::string& line) {
  if (line.empty() || line.front() == '#') return;
  const std::vector<std::string> fields = fields_of(line);
  if (row_.columns.empty()) {
    row_.columns = fields;
    return;
  }
  row_.values.clear();
  for (const std::string& field : fields) row_.values.push_back(number_in(field));
  if (row_.first.empty()) row_.first = row_.values;
}

}  // namespace thermocomp::cli
