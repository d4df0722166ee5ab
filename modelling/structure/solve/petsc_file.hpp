/// File from thermocomp-modelling to thermocomp-petsc: consecutive arrays in native representation,
/// since both run on one computer and come from one build.
///
///     SystemHeader
///     uint64 column_start[size + 1]   lower triangle by columns, rows increasing
///     uint32 row[entries]
///     double value[entries]
///     uint32 place[size]              3 node + component of each unknown, increasing
///     double coordinates_m[3 nodes]
#pragma once

#include <cstdint>

namespace thermocomp::structure {

struct SystemHeader {
  static constexpr std::uint64_t expected_magic = 0x314d45545359535aULL;
  std::uint64_t magic{expected_magic};
  std::uint64_t size{0};
  std::uint64_t entries{0};
  std::uint64_t nodes{0};
};

}  // namespace thermocomp::structure
