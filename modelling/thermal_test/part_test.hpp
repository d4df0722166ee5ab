/// Test with a part or probed artefact, cold and warm: thermal shift of its features.
///
///   shift of a feature = mean over repeats of (deviation warm - deviation cold)
///
/// A feature's own deviation, its clamping and the probe's calibration cancel. The scatter of the
/// repeats includes all differences between warm-ups; the uncertainty is +- t(0.975, repeats - 1) *
/// s / sqrt(repeats), s pooled over the features of an axis. Features of one repeat share its
/// thermal state, so they add no degrees of freedom.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "modelling/thermal_test/drift_figures.hpp"

namespace thermocomp::thermal_test {

struct PartShift {
  std::string feature;
  std::string axis;  ///< "X"
  Figure shift_um;   ///< warm minus cold, with its 95 % interval
};

struct PartAxis {
  std::string axis;
  std::size_t repeats{0};  ///< smallest number of repeats of a feature
  double repeat_sd_um{0};  ///< s, of one repeat's warm minus cold
  Figure rms_um;           ///< over the features
};

/// Figures of one completed sheet.
struct PartFigures {
  std::string file;
  std::vector<PartShift> shifts;
  std::vector<PartAxis> axes;
};

/// Verdict on |shift| <= `tolerance_um`: kept if every interval is within, exceeded if one is
/// entirely outside, else undecided.
enum class Tolerance { kept, exceeded, undecided };
[[nodiscard]] Tolerance tolerance_of(const PartFigures& figures, double tolerance_um);

/// Reads columns repeat, state (cold or warm), feature and, if present, x_um, y_um, z_um; an empty
/// value excludes the feature's repeat.
/// @throws ConfigurationError naming file, line and rule
[[nodiscard]] PartFigures part_figures(const std::string& path);

struct PartSheet {
  int features{6};
  int repeats{3};
  double hours{2.0};  ///< duration of the warm-up
};

/// A blank sheet for part_figures(); `as_page` for paper.
/// @throws ConfigurationError naming the option
[[nodiscard]] std::string part_sheet(const PartSheet& sheet, bool as_page);

struct PartTest {
  PartFigures before;
  std::optional<PartFigures> after;  ///< with compensation
  std::optional<double> tolerance_um;
};

/// One page for signature: without and, if present, with compensation.
[[nodiscard]] std::string part_html(const PartTest& test);
[[nodiscard]] std::string part_json(const PartTest& test);
/// "Z: heat moves the 6 features by 21.3 um RMS (18.0 to 24.6); with compensation 3.1 ...";
/// verdicts first.
[[nodiscard]] std::vector<std::string> part_sentences(const PartTest& test);

}  // namespace thermocomp::thermal_test
