/// Means over 10 s of a history, continued while a daemon writes it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/history/reading/history_reader.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// A position in a history: cycles before it are finished.
struct HistoryPosition {
  std::int64_t segment{0};  ///< 0: the beginning
  std::int64_t wall_ns{0};  ///< of the segment's first cycle; identifies the file
  std::uint64_t cycle{0};
};

inline constexpr std::int64_t mean_s = 10;

struct MeanRow {
  std::int64_t at_s{0};     ///< start of the interval, since 1970, a multiple of mean_s
  std::vector<float> mean;  ///< NaN: no good value was recorded
};

struct RecordedProbing {
  std::string output;  ///< of the model
  int number{0};       ///< counts probings of this output at the same time
  std::int64_t wall_ns{0};
  double measured_um{not_a_number};      ///< as entered
  double displacement_um{not_a_number};  ///< without the offset in effect
  double modelled_um{not_a_number};      ///< model without correction; NaN: unknown
  double claimed_um{not_a_number};       ///< standard deviation claimed by the model; NaN: none
  double sd_um{not_a_number};            ///< NaN: as configured
  std::string source;
};

/// Rows of one configuration.
struct MeansBatch {
  SegmentSetup setup;
  std::string program_version;
  std::vector<std::string> columns;  ///< as in a run file
  std::vector<MeanRow> rows;
  std::vector<RecordedProbing> probings;
  HistoryPosition after;
};

/// Columns: the model's inputs as used by the daemon, sensors without a block, signals, and the
/// sent and applied offset of each axis.
class HistoryMeans {
 public:
  /// @param from  if not in the file (any more): begins at the start
  HistoryMeans(std::filesystem::path history, const HistoryPosition& from);
  ~HistoryMeans();
  HistoryMeans(HistoryMeans&&) noexcept;

  /// True if the file contains `from`.
  [[nodiscard]] bool is_continued() const noexcept;
  /// Number of parts of the file that could not be read so far.
  [[nodiscard]] std::uint64_t damaged() const noexcept;

  /// The next rows, at most about `rows_max`. The last interval is held back until a later row is
  /// recorded or `settled_s` have passed.
  /// @param wall_s  wall clock, since 1970 [s]
  /// @param rest    called often; may throw to abort
  /// @return nullopt if there is nothing new yet
  /// @throws HistoryError when the file cannot be read at all
  [[nodiscard]] std::optional<MeansBatch> next(std::size_t rows_max, std::int64_t wall_s,
                                               const std::function<void()>& rest);
  static constexpr std::int64_t settled_s = 300;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
