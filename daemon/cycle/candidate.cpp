#include "daemon/cycle/candidate.hpp"

namespace thermocomp {
namespace {

constexpr const char* pair_key = "candidate.pair";

/// Calls `use` with name and value of each number of a score.
template <class Score, class Use>
void each_number(const std::string& axis, Score& score, Use use) {
  const std::string prefix = "candidate." + axis + ".";
  use(prefix + "probings", score.probings);
  use(prefix + "model_um2", score.model_um2);
  use(prefix + "candidate_um2", score.candidate_um2);
  for (std::size_t i = 0; i < score.log_better.size(); ++i) {
    use(prefix + "log_better" + std::to_string(i), score.log_better[i]);
    use(prefix + "log_worse" + std::to_string(i), score.log_worse[i]);
  }
}

}  // namespace

void Candidate::command(const Command& command, const Estimator& running) noexcept {
  if (command.kind == CommandKind::reference || command.kind == CommandKind::accept)
    estimator_.apply(command);
  if (command.kind != CommandKind::measured) return;
  const Estimator::Probed probed = running.probed(command);
  contest_.take(command.axis, now_, probed.displacement_um - probed.model_um,
                probed.displacement_um - estimator_.probed(command).model_um);
  publish();
}

void Candidate::adopt(const Estimator& running, const Candidate* before) noexcept {
  estimator_.adopt(running);
  if (before != nullptr && before->pair_ == pair_) contest_ = before->contest_;
  publish();
}

void Candidate::restore(const PersistentState& state) {
  PersistentState own = state;
  own.correction.clear();
  // Without reference numbers in its model file, the candidate uses the machine's reference.
  if (reference_numbers(estimator_.model()).empty()) own.model_reference_degC.clear();
  static_cast<void>(estimator_.restore(own));
  const auto pair = state.correction.find(pair_key);
  if (pair == state.correction.end() || pair->second != pair_) return;
  ModelContest::Score score{};
  const std::vector<AxisConfig>& axes = estimator_.config().axes;
  for (std::size_t i = 0; i < axes.size(); ++i)
    each_number(axes[i].name, score[i], [&](const std::string& name, double& value) {
      const auto found = state.correction.find(name);
      if (found != state.correction.end()) value = found->second;
    });
  contest_.restore(score);
  publish();
}

void Candidate::add_to(std::map<std::string, double>& correction) {
  correction[pair_key] = pair_;
  const std::vector<AxisConfig>& axes = estimator_.config().axes;
  for (std::size_t i = 0; i < axes.size(); ++i)
    if (score()[i].probings > 0)
      each_number(axes[i].name, score()[i],
                  [&](const std::string& name, double value) { correction[name] = value; });
}

void Candidate::publish() noexcept {
  score_.back() = contest_.score();
  score_.publish();
}

}  // namespace thermocomp
