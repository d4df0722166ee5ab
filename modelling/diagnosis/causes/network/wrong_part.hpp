/// What the causes that change the strength of a part of a thermal network have in common.
#pragma once

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis::causes {

/// A strength is sought between these shares of what the file says. None is 1.
inline constexpr CauseParameter factor_of_part{"factor", "1", 0.15, 7.0,
                                               "times what the model has:"};

/// The part has another strength.
/// @pre the subject is a part
[[nodiscard]] std::vector<NetworkHypothesis> of_wrong_part(const NetworkMaterial& material,
                                                           const NetworkSubject& subject,
                                                           const char* cause);

}  // namespace thermocomp::diagnosis::causes
