#include "daemon/history/replay/replay_setup.hpp"

#include <utility>

#include "config/daemon/daemon_config.hpp"

namespace thermocomp {

ReplaySetup parse_setup(const SegmentSetup& setup) {
  DaemonConfig config = parse_daemon_config(setup.config_text, "configuration of the segment",
                                            setup.model_text, "model of the segment");
  return {std::move(config.estimator), std::move(config.model), config.dry_run};
}

}  // namespace thermocomp
