#include "cli/common/terminal.hpp"

#include <cmath>
#include <cstdio>
#include <unistd.h>
#include <utility>

namespace thermocomp::cli {

namespace {

using std::chrono::steady_clock;

const char* code_of(Colour colour) {
  switch (colour) {
    case Colour::green:
      return "\033[32m";
    case Colour::yellow:
      return "\033[33m";
    case Colour::red:
      return "\033[31m";
    case Colour::bold:
      return "\033[1m";
    case Colour::none:
      break;
  }
  return "";
}

}  // namespace

bool stdout_is_terminal() noexcept {
  return ::isatty(STDOUT_FILENO) == 1;
}
bool stderr_is_terminal() noexcept {
  return ::isatty(STDERR_FILENO) == 1;
}

std::string coloured(std::string_view text, Colour colour, bool on) {
  if (!on || colour == Colour::none) return std::string(text);
  return std::string(code_of(colour)) + std::string(text) + "\033[0m";
}

Progress::Progress(std::string what)
    : what_(std::move(what)),
      began_(steady_clock::now()),
      shown_(began_),
      on_terminal_(stderr_is_terminal()) {}

Progress::~Progress() {
  if (visible_) std::fputs("\r\033[K", stderr);
}

void Progress::update(double fraction) {
  if (!on_terminal_) return;
  const auto now = steady_clock::now();
  if (now - began_ < std::chrono::seconds(2)) return;
  if (now - shown_ < std::chrono::milliseconds(200)) return;
  shown_ = now;
  visible_ = true;
  if (fraction >= 0.0 && fraction <= 1.0) {
    std::fprintf(stderr, "\r%s: %.0f %%\033[K", what_.c_str(), 100.0 * fraction);
  } else {
    const std::chrono::duration<double> elapsed = now - began_;
    std::fprintf(stderr, "\r%s: %.0f s\033[K", what_.c_str(), elapsed.count());
  }
  std::fflush(stderr);
}

}  // namespace thermocomp::cli
