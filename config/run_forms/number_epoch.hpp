/// Times that are numbers since an epoch.
#pragma once

#include <vector>

namespace thermocomp {

struct Epoch {
  const char* name;
  double low;  ///< the range is the years 2001 to about 2050
  double high;
  double per_second;
  double zero_s;    ///< since 1970
  bool only_named;  ///< small, hence ambiguous: the column must be called date or time
  bool is_utc;
};

/// The epoch that the size of a column's numbers shows.
/// @param is_named  the column is called date or time, or has a unit of time
/// @param has_unit  else numbers of which no two are within an hour may be a counter of another
/// unit
/// @return nullptr: none
[[nodiscard]] const Epoch* epoch_of(const std::vector<double>& numbers, bool is_named,
                                    bool has_unit);

}  // namespace thermocomp
