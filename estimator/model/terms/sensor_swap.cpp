#include <utility>

#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// Two exchanged channels: each place gets the rise of the other channel.
class SensorSwap final : public Term {
 public:
  explicit SensorSwap(const TermContext& context)
      : first_(context.subject), second_(context.second) {}

  void correct_rise(nanoseconds /*now*/, std::span<double> rise_K) noexcept override {
    std::swap(rise_K[first_], rise_K[second_]);
  }
  void add_slope(const TermInput& /*input*/, std::size_t /*output*/,
                 std::span<double> /*slope_um_per_K*/) const noexcept override {}
  void correct_slope(std::span<double> slope_um_per_K) const noexcept override {
    std::swap(slope_um_per_K[first_], slope_um_per_K[second_]);
  }
  void restart() noexcept override {}
  void visit_state(StateArchive& /*archive*/) override {}

 private:
  std::size_t first_;
  std::size_t second_;
};

}  // namespace

TermRegistration sensor_swap_registration() {
  return {{"sensor_swap", TermSubject::two_model_temperatures, {}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<SensorSwap>(context);
          }};
}

}  // namespace thermocomp
