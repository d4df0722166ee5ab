// thermocomp-uplink: sends the daemon's history to the store of a series of machines.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "fleet/uplink/command_line.hpp"
#include "fleet/uplink/uplink.hpp"
#include "report/command.hpp"

namespace thermocomp::fleet {
namespace {

constexpr std::chrono::seconds first_wait(2);
constexpr std::chrono::seconds longest_wait(300);

/// First line; the rest of a server's answer repeats the statement.
std::string first_line(const std::string& text) {
  return text.substr(0, text.find('\n'));
}

/// @return the exit status
int run_once(Uplink& uplink) {
  try {
    while (uplink.send_new()) {
    }
    return uplink.all_readable() ? 0 : 1;
  } catch (const std::exception& error) {
    spdlog::error("{}", first_line(error.what()));
    return 1;
  }
}

/// Runs until a signal. Retries an unreachable server after 2 s, 4 s, ... 5 min.
void run_on(Uplink& uplink, const UplinkSettings& settings, const Pace& pace) {
  std::chrono::duration<double> wait = first_wait;
  std::string reported;
  for (;;) {
    try {
      uplink.send_new();
      if (!reported.empty()) spdlog::info("sending again");
      reported.clear();
      wait = first_wait;
      pace.sleep(std::chrono::duration<double>(settings.period_s));
    } catch (const std::exception& error) {
      uplink.hang_up();
      if (const std::string why = first_line(error.what()); why != reported) {
        spdlog::warn("not sent: {}", why);
        reported = why;
      }
      pace.sleep(wait);
      wait = std::min<std::chrono::duration<double>>(2.0 * wait, longest_wait);
    }
  }
}

int run(const UplinkOptions& options) {
  const UplinkSettings settings = load_uplink_settings(options.config_file);
  spdlog::set_default_logger(spdlog::stderr_color_mt("thermocomp-uplink"));
  sigset_t ending;
  sigemptyset(&ending);
  sigaddset(&ending, SIGTERM);
  sigaddset(&ending, SIGINT);
  pthread_sigmask(SIG_BLOCK, &ending, nullptr);
  Pace pace(settings.cpu_percent_max, ending);
  Uplink uplink(settings, pace);
  try {
    if (options.once) return run_once(uplink);
    run_on(uplink, settings, pace);
  } catch (const Stopped&) {
    spdlog::info("stopped on request");
  }
  return 0;
}

}  // namespace
}  // namespace thermocomp::fleet

int main(int argc, char** argv) {
  using namespace thermocomp;
  fleet::UplinkOptions options;
  return cli::run_program(argc, argv, "thermocomp-uplink", [&](CLI::App& app, cli::Action& action) {
    fleet::declare_uplink_command_line(app, options);
    action = [&] { return fleet::run(options); };
  });
}
