/// Record of the true displacement at the tool, as a run file and two RMS figures.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace thermocomp {

/// For each displacement x_um: x_um itself, the applied x_offset_um, and x_error_um = displacement
/// since the first row + offset. Also temperatures and positions.
class TruthRecord {
 public:
  using Applied = std::function<double(const std::string& output)>;

  /// @param columns  of add()'s rows
  /// @param file  empty: figures only. @throws std::runtime_error
  TruthRecord(const std::vector<std::string>& columns, const std::filesystem::path& file);

  void add(double time_s, std::span<const double> row, const Applied& applied_um);
  /// @throws std::runtime_error if the file could not be written
  void close();

  /// RMS over the rows of the Euclidean norm over all outputs in um.
  [[nodiscard]] double uncompensated_rms_um() const;
  [[nodiscard]] double compensated_rms_um() const;
  [[nodiscard]] bool has_outputs() const noexcept { return !outputs_.empty(); }
  /// Of the last row, by output; for the status line.
  [[nodiscard]] const std::vector<double>& last_error_um() const noexcept { return error_um_; }
  /// "error rms at the tool: uncompensated A um, compensated B um"
  [[nodiscard]] std::string summary() const;

 private:
  struct Output {
    std::string name;
    std::size_t column;
    double start;
    bool counts;  ///< unit um: part of the norm
  };
  std::vector<Output> outputs_;
  std::vector<std::size_t> beside_;  ///< temperatures and positions
  std::vector<double> error_um_;
  std::filesystem::path path_;
  std::ofstream file_;
  std::size_t rows_{0};
  double uncompensated_squares_um2_{0.0};
  double compensated_squares_um2_{0.0};
};

}  // namespace thermocomp
