/// The quantity and unit of each column of a foreign table, by its name, its units, and the map of
/// --columns.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_table.hpp"
#include "config/text/units.hpp"

namespace thermocomp {

struct ColumnMeaning {
  std::size_t source{0};  ///< column of the table
  std::string name;       ///< in a run file of our own form: "T1_degC"
  UnitConversion conversion;
};

/// Its parameters must outlive it. Refused columns become problems; what was taken for granted is
/// added to `understood`.
class ColumnMeanings {
 public:
  /// @param map  may be nullptr
  /// @param units  as written, by column
  /// @param has_own_names  the table comes from a form whose names are ours
  ColumnMeanings(const TextTable& table, const ColumnMap* map,
                 const std::vector<std::string>& units, bool has_own_names, ProblemList& problems,
                 std::vector<std::string>& understood);

  /// @return nullopt: refused
  [[nodiscard]] std::optional<ColumnMeaning> of(std::size_t column) const;
  void note(const ColumnMeaning& meaning) const;

 private:
  [[nodiscard]] std::optional<ColumnMeaning> mapped(std::size_t column, const MappedColumn& mapped,
                                                    const SpelledName& spelled) const;
  [[nodiscard]] std::string unclear_unit(std::size_t column, const SpelledName& spelled) const;
  [[nodiscard]] bool is_mapped(const std::string& header) const;
  void refuse(std::size_t column, std::string rule) const;

  const TextTable& table_;
  const ColumnMap* map_;
  const std::vector<std::string>& units_;
  bool has_own_names_;
  ProblemList& problems_;
  std::vector<std::string>& understood_;
};

/// Whether a header is a name of ours with a unit: "T1_degC".
[[nodiscard]] bool has_own_unit(const std::string& header);

void refuse_column(const TextTable& table, std::size_t column, std::string rule,
                   ProblemList& problems);

}  // namespace thermocomp
