// dbc_values FILE.dbc: decodes frames from stdin, one per line in the form of candump -L (123#0102,
// 00000123#, 123##1FF), and prints for each the message's name and "NAME RAW VALUE" of every signal
// in it, tab separated, with a fault's name instead of a value. Exit status 2: the file has
// problems.
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "config/bus_files/dbc_file.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/can/signal_codec.hpp"

using namespace thermocomp;

namespace {

void print_values(const DbcMessage& message, const std::vector<std::uint8_t>& payload) {
  std::cout << message.name;
  for (const DbcSignal& signal : message.signals) {
    if (!carries(payload, signal.place)) continue;
    const CanValue decoded = decode(payload, signal.place);
    char value[64];
    std::snprintf(value, sizeof value, "%.17g", decoded.value);
    const bool whole = payload.size() >= bytes_needed(signal.place);
    std::cout << '\t' << signal.name << ' '
              << (whole ? extract_raw(payload, signal.place) : std::uint64_t{0}) << ' '
              << (decoded.fault == Fault::none ? value : to_string(decoded.fault));
  }
  std::cout << '\n';
}

void print_values(const DbcFile& file, const std::string& line) {
  const std::size_t mark = line.find('#');
  if (mark == std::string::npos) throw std::invalid_argument("no frame: " + line);
  const bool fd = line.compare(mark, 2, "##") == 0;
  const auto id = static_cast<std::uint32_t>(std::stoul(line.substr(0, mark), nullptr, 16));
  std::vector<std::uint8_t> payload;
  for (std::size_t i = mark + (fd ? 3 : 1); i + 1 < line.size(); i += 2) {
    payload.push_back(static_cast<std::uint8_t>(std::stoul(line.substr(i, 2), nullptr, 16)));
  }
  for (const DbcMessage& message : file.messages) {
    if (message.id != id || message.extended != (mark > 3)) continue;
    return print_values(message, payload);
  }
  std::cout << "no message\n";
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 2) throw std::invalid_argument("usage: dbc_values FILE.dbc");
    const DbcFile file = read_dbc_text(read_text_file(argv[1]), argv[1]);
    for (const DbcFlaw& flaw : file.flaws) std::cerr << to_string(flaw.problem) << '\n';
    if (!file.flaws.empty()) return 2;
    for (std::string line; std::getline(std::cin, line);) print_values(file, line);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 2;
  }
}
