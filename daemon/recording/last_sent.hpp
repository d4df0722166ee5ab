/// The offsets sent last, where they outlive the process: a small file that is mapped into memory.
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

/// Two places, written in turn, each with a number and a checksum: a process that ends while it
/// writes one leaves the other. The checksum holds the boot of the system, the controller, names
/// and signs of the axes, so that nobody else's offsets are taken for these. The file belongs into
/// a folder in memory (/run): on a disk the system may keep a store waiting.
///
/// A record of another format, which another version of the program wrote, is not read. It stays
/// until the first offset is sent: from then on what it says is wrong, and it is replaced.
class LastSent {
 public:
  /// @param file        made where there is none
  /// @param controller  to which the offsets are sent
  /// @throws std::runtime_error
  LastSent(const std::filesystem::path& file, const std::string& controller,
           const std::vector<AxisConfig>& axes);
  ~LastSent();
  LastSent(const LastSent&) = delete;
  LastSent& operator=(const LastSent&) = delete;

  /// As the process before left them, of this boot, controller and axes. NaN: that process knew
  /// that what it had sent last was worth nothing any more.
  [[nodiscard]] const Offsets& before() const noexcept { return before_; }

  /// Why what is there is not read; empty: it is, or nothing is there.
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  /// Before a command is offered to the controller: plain stores, no system call. An axis that is
  /// not driven keeps what it was sent last.
  /// @param forgotten  by bits, one an axis: what it was sent last is worth nothing any more
  void note(const OffsetCommand& command, std::uint32_t forgotten) noexcept;

 private:
  struct Place {
    std::uint64_t number{0};  ///< 0: never written
    std::array<double, axes_max> offset_um{};
    std::uint64_t known{0};      ///< by bits, one an axis
    std::uint64_t forgotten{0};  ///< by bits: the controller has lost it
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
