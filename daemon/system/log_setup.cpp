#include "daemon/system/log_setup.hpp"

#include <cstdlib>
#include <memory>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>

namespace thermocomp {

void set_up_log() {
  std::shared_ptr<spdlog::logger> logger;
  if (std::getenv("JOURNAL_STREAM") != nullptr)
    logger = std::make_shared<spdlog::logger>(
        "thermocompd", std::make_shared<spdlog::sinks::systemd_sink_mt>("thermocompd"));
  else
    logger = std::make_shared<spdlog::logger>(
        "thermocompd", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
  spdlog::set_default_logger(logger);
}

void set_log_level(const std::string& level) {
  spdlog::set_level(spdlog::level::from_str(level));
}

}  // namespace thermocomp
