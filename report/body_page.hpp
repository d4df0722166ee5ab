/// A self-contained page of a body in three dimensions: surface coloured by temperature or
/// displacement, sensors, axes and scale. Drawn by Debian's libjs-three, included in the page.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace thermocomp {

/// Temperature rise and displacement of every surface node at one time.
struct BodyState {
  std::string group;               ///< states of one group (a load case) are shown in sequence
  std::string name;                ///< within the group, if states differ by more than time
  double time_s{0.0};              ///< NaN: no time
  std::string input;               ///< the only input that is 1 K warm
  std::vector<double> rise_K;      ///< shape (nodes)
  std::vector<double> moved_um;    ///< shape (3 nodes)
  std::vector<double> outputs_um;  ///< tool against work, one per output of the picture
};

struct BodyPoint {
  std::string name;
  bool is_sensor{false};  ///< else the point of an output
  std::array<double, 3> at_mm{};
};

struct BodyPicture {
  std::string title;
  std::string note;              ///< a sentence under the title; empty: none
  std::vector<double> nodes_mm;  ///< shape (3 nodes)
  /// Node indices, counterclockwise seen from outside; shape (3 triangles).
  std::vector<std::uint32_t> triangles;
  std::vector<std::string> outputs;
  std::vector<BodyState> states;
  std::vector<BodyPoint> points;
};

/// Numbers have four significant digits.
/// @throws std::runtime_error  if libjs-three is not installed
[[nodiscard]] std::string body_page(const BodyPicture& picture);

}  // namespace thermocomp
