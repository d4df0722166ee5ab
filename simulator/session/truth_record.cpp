#include "simulator/session/truth_record.hpp"

#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"

namespace thermocomp {
namespace {

/// x_um -> x_offset_um
std::string with_part(const std::string& output, const std::string& part) {
  const std::string suffix(unit_of(output).suffix);
  return output.substr(0, output.size() - suffix.size()) + "_" + part + suffix;
}

}  // namespace

TruthRecord::TruthRecord(const std::vector<std::string>& columns, const std::filesystem::path& file)
    : path_(file) {
  std::string header = "time_s";
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (is_temperature(columns[i]) || kind_of(columns[i]) == QuantityKind::position) {
      beside_.push_back(i);
      header += "," + columns[i];
    } else if (is_output(columns[i])) {
      outputs_.push_back({columns[i], i, 0.0, unit_of(columns[i]).suffix == "_um"});
    }
  }
  for (const Output& output : outputs_) {
    header += "," + output.name + "," + with_part(output.name, "offset") + "," +
              with_part(output.name, "error");
  }
  error_um_.resize(outputs_.size(), 0.0);
  if (path_.empty()) return;
  file_.open(path_);
  if (!file_) throw std::runtime_error(path_.string() + ": cannot be written");
  file_ << header << '\n';
}

void TruthRecord::add(double time_s, std::span<const double> row, const Applied& applied_um) {
  std::string line = number_text(time_s);
  for (const std::size_t column : beside_) {
    line += ',';
    append_number(line, row[column]);
  }
  double uncompensated = 0.0;
  double compensated = 0.0;
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    Output& output = outputs_[i];
    const double displacement = row[output.column];
    if (rows_ == 0) output.start = displacement;
    const double applied = applied_um(output.name);
    error_um_[i] = displacement - output.start + applied;
    for (const double value : {displacement, applied, error_um_[i]}) {
      line += ',';
      append_number(line, value);
    }
    if (!output.counts || std::isnan(displacement)) continue;
    uncompensated += (displacement - output.start) * (displacement - output.start);
    compensated += error_um_[i] * error_um_[i];
  }
  ++rows_;
  uncompensated_squares_um2_ += uncompensated;
  compensated_squares_um2_ += compensated;
  if (file_.is_open()) file_ << line << '\n';
}

void TruthRecord::close() {
  if (!file_.is_open()) return;
  file_.close();
  if (!file_) throw std::runtime_error(path_.string() + ": could not be written to its end");
}

double TruthRecord::uncompensated_rms_um() const {
  return rows_ == 0 ? 0.0 : std::sqrt(uncompensated_squares_um2_ / static_cast<double>(rows_));
}

double TruthRecord::compensated_rms_um() const {
  return rows_ == 0 ? 0.0 : std::sqrt(compensated_squares_um2_ / static_cast<double>(rows_));
}

std::string TruthRecord::summary() const {
  char text[160];
  std::snprintf(text, sizeof text,
                "error rms at the tool: uncompensated %.2f um, compensated %.2f um",
                uncompensated_rms_um(), compensated_rms_um());
  return text;
}

}  // namespace thermocomp
