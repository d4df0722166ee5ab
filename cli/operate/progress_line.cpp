#include "cli/operate/progress_line.hpp"

#include <cstdio>
#include <utility>

#include "report/terminal.hpp"

namespace thermocomp::cli {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto line_period = 2s;

}  // namespace

ProgressLine::ProgressLine(std::string what)
    : what_(std::move(what)), on_terminal_(stderr_is_terminal()), last_(Clock::now()) {}

ProgressLine::~ProgressLine() {
  if (shown_ && on_terminal_) std::fputs(rewritten_line("").c_str(), stderr);
}

void ProgressLine::update(const std::string& text) {
  const auto now = Clock::now();
  if (!on_terminal_ && now - last_ < line_period) return;
  last_ = now;
  shown_ = true;
  const std::string line = what_ + ": " + text;
  std::fputs((on_terminal_ ? rewritten_line(line) : line + "\n").c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace thermocomp::cli
