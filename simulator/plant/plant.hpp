/// Thermal and mechanical body of the simulated machine. Seeded; the time is an argument.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "simulator/plant/plant_config.hpp"

namespace thermocomp {

class Plant {
 public:
  /// All lumps start at room temperature. @pre indices in `config` are valid (checked)
  Plant(const PlantConfig& config, std::uint64_t seed);
  ~Plant();
  Plant(Plant&&) noexcept;
  Plant& operator=(Plant&&) noexcept;

  /// Values at a time do not depend on earlier calls.
  /// @pre time_s >= the last one (checked)
  void advance_to(double time_s);

  [[nodiscard]] double time_s() const noexcept;
  /// @pre the plant has lumps (checked)
  [[nodiscard]] double node_degC(std::size_t node) const;
  [[nodiscard]] double room_degC() const noexcept;
  [[nodiscard]] double signal(std::size_t signal) const;
  /// Heat of all sources into a lump [W].
  [[nodiscard]] double heat_W(std::size_t node) const;
  /// Reading of the thermocouple, with lag, noise, offset and resolution.
  [[nodiscard]] double thermocouple_degC(std::size_t thermocouple) const;
  /// True displacement of the tool since the start, positive in the axis' positive direction.
  [[nodiscard]] double displacement_um(std::size_t output) const;

  /// Columns of row(): signals, thermocouples as NAME_degC, outputs (true displacement).
  [[nodiscard]] std::vector<std::string> columns() const;
  void row(std::span<double> values) const;  ///< @pre values.size() == columns().size()

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Exact coefficients of a model with one temperature per block: the sums over the block's lumps.
/// Shape (outputs, blocks) [um/K], row by row.
/// @param blocks  block names in the wanted order; lumps of other blocks are ignored
[[nodiscard]] std::vector<std::vector<double>> block_matrix(const PlantConfig& config,
                                                            const std::vector<std::string>& blocks);

}  // namespace thermocomp
