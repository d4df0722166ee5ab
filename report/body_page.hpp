/// A body in three dimensions as a page that needs nothing else: its surface coloured by
/// temperature or displacement, its sensors, axes and scale. Drawn by Debian's libjs-three, which
/// the page holds.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace thermocomp {

/// Temperature and displacement of every node of the surface at a moment.
struct BodyState {
  std::string group;               ///< states of one group are shown in their order: a load case
  std::string name;                ///< of the group's states where they differ by more than time
  double time_s{0.0};              ///< NaN: the state has no time
  std::string input;               ///< of the model, where that is 1 K warm and all else as it was
  std::vector<double> rise_K;      ///< shape (nodes)
  std::vector<double> moved_um;    ///< shape (3 nodes)
  std::vector<double> outputs_um;  ///< tool against work, one an output of the picture
};

struct BodyPoint {
  std::string name;
  bool is_sensor{false};  ///< else a point that an output is taken at
  std::array<double, 3> at_mm{};
};

struct BodyPicture {
  std::string title;
  std::string note;              ///< a sentence under the title; empty: none
  std::vector<double> nodes_mm;  ///< shape (3 nodes)
  /// Numbers of nodes, counterclockwise as seen from outside; shape (3 triangles).
  std::vector<std::uint32_t> triangles;
  std::vector<std::string> outputs;
  std::vector<BodyState> states;
  std::vector<BodyPoint> points;
};

/// Numbers are written with four digits that count.
/// @throws std::runtime_error  libjs-three is not installed
[[nodiscard]] std::string body_page(const BodyPicture& picture);

}  // namespace thermocomp
