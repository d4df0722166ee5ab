#pragma once
/// The fuzz targets as functions of one program, which runs each on its seeds without libFuzzer.
#include <cstddef>
#include <cstdint>
#include <map>
#include <string_view>

namespace thermocomp::fuzz {

using Target = int (*)(const std::uint8_t* data, std::size_t size);
extern const std::map<std::string_view, Target> targets;  ///< by name

}  // namespace thermocomp::fuzz
