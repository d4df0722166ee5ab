/// A test part, or a probed artefact, cold and warm: how far heat moves its features.
///
///   shift of a feature = mean over repeats of (deviation warm - deviation cold)
///
/// What a feature deviates by itself, its clamping and the probe's calibration stand in both and go
/// out. The repeats differ by all that differs from one warming to the next, so their scatter is
/// the uncertainty: +- t(0.975, repeats - 1) * s / sqrt(repeats), s pooled over the features of an
/// axis. Features of one repeat share its thermal state, so more of them give no more freedom.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "modelling/thermal_test/drift_figures.hpp"

namespace thermocomp::thermal_test {

struct PartShift {
  std::string feature;
  std::string axis;  ///< "X"
  Figure shift_um;   ///< warm less cold, with its 95 % interval
};

struct PartAxis {
  std::string axis;
  std::size_t repeats{0};  ///< the fewest of a feature
  double repeat_sd_um{0};  ///< s: of one repeat's warm less cold
  Figure rms_um;           ///< over the features
};

/// What the rows of one filled-in sheet give.
struct PartFigures {
  std::string file;
  std::vector<PartShift> shifts;
  std::vector<PartAxis> axes;
};

/// Whether every shift is within +-`tolerance_um`: kept where every interval is, exceeded where an
/// interval lies outside as a whole, else undecided.
enum class Tolerance { kept, exceeded, undecided };
[[nodiscard]] Tolerance tolerance_of(const PartFigures& figures, double tolerance_um);

/// Reads columns repeat, state (cold or warm), feature and x_um, y_um, z_um as far as they are
/// there; empty values are left out, and with them the feature's repeat.
/// @throws ConfigurationError naming file, line and rule
[[nodiscard]] PartFigures part_figures(const std::string& path);

struct PartSheet {
  int features{6};
  int repeats{3};
  double hours{2.0};  ///< of warming
};

/// A sheet to be filled in, which part_figures() reads; `as_page` for paper.
/// @throws ConfigurationError naming the option
[[nodiscard]] std::string part_sheet(const PartSheet& sheet, bool as_page);

/// The two filled-in sheets, and the tolerance that they are judged by.
struct PartTest {
  PartFigures before;
  std::optional<PartFigures> after;  ///< with compensation
  std::optional<double> tolerance_um;
};

/// One page to be signed: without and, where there is one, with compensation.
[[nodiscard]] std::string part_html(const PartTest& test);
[[nodiscard]] std::string part_json(const PartTest& test);
/// "Z: heat moves the 6 features by 21.3 um RMS (18.0 to 24.6); with compensation 3.1 ..."; first
/// of all the verdicts by the tolerance.
[[nodiscard]] std::vector<std::string> part_sentences(const PartTest& test);

}  // namespace thermocomp::thermal_test
