/// A history as means of 10 s, on and on while a daemon writes it.
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

/// A moment of a history: what is before this cycle is done with.
struct HistoryPosition {
  std::int64_t segment{0};  ///< 0: the beginning
  std::int64_t wall_ns{0};  ///< of the segment's first cycle: that it is still the same file
  std::uint64_t cycle{0};
};

inline constexpr std::int64_t mean_s = 10;

struct MeanRow {
  std::int64_t at_s{0};     ///< beginning, since 1970, a multiple of mean_s
  std::vector<float> mean;  ///< NaN: nothing good was recorded
};

struct RecordedProbing {
  std::string output;  ///< of the model
  int number{0};       ///< counts those of this output at the same moment
  std::int64_t wall_ns{0};
  double measured_um{not_a_number};      ///< as it was given
  double displacement_um{not_a_number};  ///< without the offset in effect
  double modelled_um{not_a_number};      ///< of the model alone; NaN: not known
  double claimed_um{not_a_number};       ///< standard deviation that the model states; NaN: none
  double sd_um{not_a_number};            ///< NaN: as configured
  std::string source;
};

/// What was recorded with one configuration.
struct MeansBatch {
  SegmentSetup setup;
  std::string program_version;
  std::vector<std::string> columns;  ///< as in a run file
  std::vector<MeanRow> rows;
  std::vector<RecordedProbing> probings;
  HistoryPosition after;
};

/// Columns: the model's inputs as the daemon computed with them, sensors of no block, signals, and
/// of each axis what was sent and applied.
class HistoryMeans {
 public:
  /// @param from  from the beginning where the file does not have it (any more)
  HistoryMeans(std::filesystem::path history, const HistoryPosition& from);
  ~HistoryMeans();
  HistoryMeans(HistoryMeans&&) noexcept;

  /// Whether the file has the position that it was to begin at.
  [[nodiscard]] bool is_continued() const noexcept;
  /// Parts of the file that could not be read so far.
  [[nodiscard]] std::uint64_t damaged() const noexcept;

  /// The next rows, as many as there are, up to about `rows_max`. Means of 10 s that have just
  /// passed wait until something later was recorded, or `settled_s` have passed.
  /// @param wall_s  the clock's time now
  /// @param rest    called often; may throw to end it
  /// @return nullopt: nothing new yet
  /// @throws HistoryError when nothing can be taken from the file
  [[nodiscard]] std::optional<MeansBatch> next(std::size_t rows_max, std::int64_t wall_s,
                                               const std::function<void()>& rest);
  static constexpr std::int64_t settled_s = 300;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
