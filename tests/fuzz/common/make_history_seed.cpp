/// Writes the history for the seeds of history_file: make_history_seed FILE
#include <cstdio>
#include <fstream>

#include "recorded_history.hpp"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: make_history_seed FILE\n");
    return 2;
  }
  const auto bytes = thermocomp::fuzz::recorded_history();
  std::ofstream out(argv[1], std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()),
            static_cast<std::streamsize>(bytes.size()));
  return out.good() ? 0 : 1;
}
