// thermocomp-gateway: what thermocompd does, for browsers, Prometheus, MQTT and MTConnect.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>

#include "config/text/clean_output.hpp"
#include "config/text/problems.hpp"
#include "gateway/command_line.hpp"
#include "gateway/gateway.hpp"
#include "gateway/http/password_file.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace {

using namespace thermocomp::gateway;

/// The journal when systemd started us, else standard error.
void set_up_log(const std::string& level) {
  const char* name = "thermocomp-gateway";
  std::shared_ptr<spdlog::logger> logger;
  if (std::getenv("JOURNAL_STREAM") != nullptr)
    logger = std::make_shared<spdlog::logger>(
        name, std::make_shared<spdlog::sinks::systemd_sink_mt>(name));
  else
    logger = std::make_shared<spdlog::logger>(
        name, std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
  spdlog::set_default_logger(logger);
  spdlog::set_level(spdlog::level::from_str(level));
}

int print_password_line(const std::string& user) {
  std::string password;
  std::getline(std::cin, password);
  std::printf("%s\n", password_line(user, password).c_str());
  return 0;
}

int run(const GatewayOptions& options) {
  if (!options.password_user.empty()) return print_password_line(options.password_user);
  const GatewaySettings settings = load_gateway_settings(options.config_file);
  if (options.device_file) {
    std::printf("%s", ask_device_file(settings).c_str());
    return 0;
  }
  set_up_log(settings.log_level);
  run_gateway(settings);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  thermocomp::clean_standard_output();
  CLI::App app;
  GatewayOptions options;
  declare_gateway_command_line(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return run(options);
  } catch (const thermocomp::ConfigurationError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "thermocomp-gateway: %s\n", error.what());
    return 1;
  }
}
