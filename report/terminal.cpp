#include "report/terminal.hpp"

#include <cmath>
#include <cstdio>
#include <unistd.h>
#include <utility>

#include "config/text/clean_output.hpp"

namespace thermocomp::cli {

namespace {

using std::chrono::steady_clock;

const char* code_of(Colour colour) {
  switch (colour) {
    case Colour::green:
      return "[32m";
    case Colour::yellow:
      return "[33m";
    case Colour::red:
      return "[31m";
    case Colour::bold:
      return "[1m";
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
  return terminal_code(code_of(colour)).append(text).append(terminal_code("[0m"));
}

std::string rewritten_line(std::string_view text) {
  return terminal_code("[G").append(terminal_code("[K")).append(text);
}

Progress::Progress(std::string what)
    : what_(std::move(what)),
      began_(steady_clock::now()),
      shown_(began_),
      on_terminal_(stderr_is_terminal()) {}

Progress::~Progress() {
  if (visible_) std::fputs(rewritten_line("").c_str(), stderr);
}

void Progress::update(double fraction) {
  if (!on_terminal_) return;
  const auto now = steady_clock::now();
  if (now - began_ < std::chrono::seconds(2)) return;
  if (now - shown_ < std::chrono::milliseconds(200)) return;
  shown_ = now;
  visible_ = true;
  if (fraction >= 0.0 && fraction <= 1.0) {
    std::fprintf(stderr, "%s: %.0f %%", rewritten_line(what_).c_str(), 100.0 * fraction);
  } else {
    const std::chrono::duration<double> elapsed = now - began_;
    std::fprintf(stderr, "%s: %.0f s", rewritten_line(what_).c_str(), elapsed.count());
  }
  std::fflush(stderr);
}

void ProgressLines::print(std::string_view what) const {
  const double seconds = std::chrono::duration<double>(steady_clock::now() - began_).count();
  std::fprintf(stderr, "%7.1f s  %.*s\n", seconds, static_cast<int>(what.size()), what.data());
}

}  // namespace thermocomp::cli
