#include "daemon/status/frozen_modules.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp {

FrozenModules::Channel::Step FrozenModules::Channel::take(double now_degC) noexcept {
  const bool is_same = now_degC == value_degC || (std::isnan(now_degC) && std::isnan(value_degC));
  if (is_same) return Step::none;
  const int towards = (now_degC > value_degC) - (now_degC < value_degC);
  const bool turns = towards * direction < 0 && now_degC != before_degC;
  before_degC = value_degC;
  value_degC = now_degC;
  direction = towards;
  return turns ? Step::turn : Step::change;
}

bool FrozenModules::Module::is_frozen() const noexcept {
  return was_noisy && same >= polls && newest_at - changed_at >= lasts;
}

void FrozenModules::note(const Report& report, const EstimatorConfig& config) {
  struct News {
    nanoseconds newest_at{};
    std::vector<std::size_t> sensors;
  };
  std::map<std::string, News> all;
  channels_.resize(report.sensors.size());
  for (std::size_t i = 0; i < report.sensors.size(); ++i) {
    if (config.sensors[i].module.empty()) continue;
    News& news = all[config.sensors[i].module];
    news.newest_at = std::max(news.newest_at, report.sensors[i].taken_at);
    news.sensors.push_back(i);
  }
  std::erase_if(modules_, [&](const auto& each) { return !all.contains(each.first); });
  for (const auto& [name, news] : all) {
    Module& module = modules_[name];
    if (news.newest_at <= module.newest_at) continue;
    module.newest_at = news.newest_at;
    auto most = Channel::Step::none;
    for (const std::size_t i : news.sensors)
      most = std::max(most, channels_[i].take(report.sensors[i].raw_degC));
    module.turns <<= 1;
    module.turns[0] = most == Channel::Step::turn;
    ++module.same;
    if (most == Channel::Step::none) continue;
    module.was_noisy = 3 * module.turns.count() > polls;
    module.changed_at = module.newest_at;
    module.same = 0;
  }
}

std::map<std::string, double> FrozenModules::frozen_s() const {
  std::map<std::string, double> found;
  for (const auto& [name, module] : modules_)
    if (module.is_frozen()) found[name] = to_seconds(module.newest_at - module.changed_at);
  return found;
}

}  // namespace thermocomp
