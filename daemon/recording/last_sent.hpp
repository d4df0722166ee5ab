/// The last-sent record: a memory-mapped file that outlives the process.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// By axis [um].
using Offsets = std::map<std::string, double>;

/// Two slots, written alternately, each with a number and a checksum: a process that ends during a
/// write leaves the other slot intact. The checksum covers boot ID, controller and the axes' names
/// and signs, so that other offsets are never mistaken for these. The file belongs in a folder in
/// memory (/run): on a disk, a store may block.
///
/// A record of another format is not read. It is replaced when the first offset is sent, which
/// makes it obsolete.
class LastSent {
 public:
  /// @param file        created if missing
  /// @param controller  to which the offsets are sent
  /// @throws std::runtime_error
  LastSent(const std::filesystem::path& file, const std::string& controller,
           const std::vector<AxisConfig>& axes);
  ~LastSent();
  LastSent(const LastSent&) = delete;
  LastSent& operator=(const LastSent&) = delete;

  /// The previous process' offsets for this boot, controller and axes. NaN: lost by the controller.
  [[nodiscard]] const Offsets& before() const noexcept { return before_; }

  /// Reason why an existing record is not read; else empty.
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  /// Call before a command is offered to the controller: plain stores, no system call. An axis that
  /// is not driven keeps its last offset.
  /// @param forgotten  bit mask of axes whose offset the controller has lost
  void note(const OffsetCommand& command, std::uint32_t forgotten) noexcept;

 private:
  struct Place {
    std::uint64_t number{0};  ///< 0: never written
    std::array<double, axes_max> offset_um{};
    std::uint64_t known{0};      ///< bit mask of axes
    std::uint64_t forgotten{0};  ///< bit mask of axes whose offset the controller has lost
    std::uint64_t checksum{0};
  };
  struct File {
    std::uint64_t magic{0};
    std::uint64_t format{0};
    std::array<Place, 2> places{};
  };
  [[nodiscard]] std::uint64_t checksum_of(const Place& place) const noexcept;

  const std::uint64_t key_;
  std::size_t axes_;
  File* file_;  ///< in memory
  Place now_;
  Offsets before_;
  std::string problem_;
};

}  // namespace thermocomp
