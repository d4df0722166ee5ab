/// Memory for a search that makes and drops many panels.
#pragma once

namespace thermocomp::diagnosis {

/// From now on what this process frees stays with it, and its heap lies in large pages where the
/// system has them: a search would otherwise spend a tenth of its time on the first touch of small
/// ones. Nothing changes where the system offers none of this.
void use_large_pages();

}  // namespace thermocomp::diagnosis
