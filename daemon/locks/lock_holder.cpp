#include "daemon/locks/lock_holder.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>

namespace thermocomp {

std::string describe_process(pid_t process) {
  constexpr std::size_t shown_max = 512;
  const std::string number = std::to_string(process);
  std::ifstream in("/proc/" + number + "/cmdline", std::ios::binary);
  std::string line{std::istreambuf_iterator<char>(in), {}};
  while (!line.empty() && line.back() == '\0') line.pop_back();
  std::replace_if(
      line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  line.resize(std::min(line.size(), shown_max));
  return "process " + number + (line.empty() ? "" : " (" + line + ")");
}

}  // namespace thermocomp
