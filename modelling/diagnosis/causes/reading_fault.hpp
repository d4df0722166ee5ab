/// What the faults of one reading in one run have in common.
#pragma once

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {

/// Error of a reading with a fault of gain 1 over all rows of the run [K], shape (rows, onsets).
using ErrorOfReading = Panel (*)(const MeasuredData& data, const MeasuredRun& run,
                                 std::size_t input, const std::vector<double>& onsets_s);

struct ReadingFault {
  const char* cause;
  const char* onset;  ///< the shape's one parameter
  const char* gain;
  double first;  ///< of the onsets, as a share of the run
  std::size_t onsets;
  ErrorOfReading error;
};

/// The model misses what it makes of the error of the reading.
/// @pre the subject is an input in one run
[[nodiscard]] Hypothesis of_reading_fault(const Material& material, const Subject& subject,
                                          const ReadingFault& fault);

/// A fault of a sensor of a thermal network in one run: a displacement of its reading alone.
/// @param value  of gain 1, at a time
/// @pre the subject is a sensor in one run
[[nodiscard]] NetworkHypothesis of_reading_in_network(
    const NetworkMaterial& material, const NetworkSubject& subject, const char* cause,
    const char* gain, std::function<double(double time_s, const Shape& shape)> value);
/// `count` moments within a run, its ends not among them, in equal steps.
[[nodiscard]] std::vector<double> inner_times_s(const NetworkMaterial& material, std::size_t run,
                                                std::size_t count);

}  // namespace thermocomp::diagnosis::causes
