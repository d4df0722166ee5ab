#include "estimator/axes/mismatch.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace thermocomp {
namespace {

/// Rounding of registers and delay of a moving offset.
constexpr double noise_um = 0.3;
/// Closer pairs count as one, closer read-backs as the same.
constexpr double apart_um = 0.2;
/// Largest deviation of the older pairs from the cause of the newest, as a share of the mismatch.
/// Also the limit for a certain cause, which prevents a release while it still explains the
/// read-backs.
constexpr double share_of_mismatch = 0.35;
constexpr double sure_share_of_mismatch = 0.1;
/// Smallest offset sent that gives a factor.
constexpr double sent_um_min = 0.2;
/// From this offset on, an exact negative is not a coincidence.
constexpr double negative_um_min = 3.0;
/// Smallest change of the offset sent, and below it as a share of the mismatch, that confirms a
/// factor.
constexpr double spread_um_min = 0.5;
constexpr double spread_share_min = 0.2;

/// Factors of common mistakes: units, decimal places, radius and diameter.
bool is_usual(double factor) noexcept {
  constexpr std::array usual{2.0, 0.5, 10.0, 0.1, 100.0, 0.01, 1000.0, 0.001, 25.4, 1.0 / 25.4};
  return std::any_of(usual.begin(), usual.end(), [factor](double each) {
    return std::abs(std::abs(factor) / each - 1.0) < 0.03;
  });
}

bool is_near(double a, double b) noexcept {
  return std::abs(a - b) < 0.05 * std::abs(b);
}

std::string factor_text(const Mismatch& mismatch) {
  std::array<char, 96> text{};
  if (is_near(mismatch.size, 2.0))
    std::snprintf(text.data(), text.size(), "reads back twice what is sent: check scale");
  else if (is_near(mismatch.size, 0.5))
    std::snprintf(text.data(), text.size(), "reads back half of what is sent: check scale");
  else
    std::snprintf(text.data(), text.size(), "reads back %.3g times what is sent: check scale%s",
                  mismatch.size, mismatch.size < 0.0 ? " and sign" : "");
  std::string words = text.data();
  if (!mismatch.or_constant) return words;
  std::snprintf(text.data(), text.size(), "; or constant %+.1f um: check the offset's zero",
                mismatch.read_um - mismatch.sent_um);
  return words.append(text.data());
}

}  // namespace

bool Mismatch::explains(double of_sent_um, double of_read_um) const noexcept {
  if (!sure) return false;
  double expected_um = not_a_number;
  if (likely == MismatchCause::factor) expected_um = size * of_sent_um;
  if (likely == MismatchCause::opposite_sign) expected_um = -of_sent_um;
  if (likely == MismatchCause::constant) expected_um = of_sent_um + size;
  return std::abs(of_read_um - expected_um) <= noise_um + 0.1 * std::abs(read_um - sent_um);
}

std::string likely_text(const Mismatch& mismatch) {
  std::array<char, 96> text{};
  switch (mismatch.likely) {
    case MismatchCause::none:
      return {};
    case MismatchCause::opposite_sign:
      return "opposite sign: check sign";
    case MismatchCause::stands_still:
      if (std::abs(mismatch.read_um) <= noise_um)
        return "reads back nothing of what is sent: not taken, or check scale";
      return "does not follow the offset sent: not taken (rejected, or stopped)";
    case MismatchCause::changes_alone:
      return "changes by itself: another writer, a restart or a limit?";
    case MismatchCause::constant:
      std::snprintf(text.data(), text.size(), "constant %+.1f um: check the offset's zero",
                    mismatch.size);
      return text.data();
    case MismatchCause::factor:
      return factor_text(mismatch);
  }
  return {};
}

void SentAndRead::note(double sent_um, double read_um) noexcept {
  if (adds_nothing(sent_um, read_um)) --count_;
  sent_um_[count_ % length] = sent_um;
  read_um_[count_ % length] = read_um;
  ++count_;
}

/// True if the newest pair lies between others or equals an older one.
bool SentAndRead::adds_nothing(double next_sent_um, double next_read_um) const noexcept {
  if (count_ < 2) return false;
  const double sent_um = sent_um_[index_of(0)];
  const auto is_same = [read_um = read_um_[index_of(0)]](double other_um) {
    return std::abs(other_um - read_um) < apart_um;
  };
  bool lower = is_same(next_read_um) && next_sent_um <= sent_um;
  bool higher = is_same(next_read_um) && next_sent_um >= sent_um;
  std::size_t age = 1;
  for (; age < kept() && is_same(read_um_[index_of(age)]); ++age) {
    lower = lower || sent_um_[index_of(age)] < sent_um + apart_um;
    higher = higher || sent_um_[index_of(age)] > sent_um - apart_um;
  }
  return age > 1 && lower && higher;
}

std::size_t SentAndRead::disagreeing() const noexcept {
  std::size_t pairs = 0;
  for (; pairs < kept(); ++pairs) {
    const std::size_t i = index_of(pairs);
    if (std::abs(read_um_[i] - sent_um_[i]) <= noise_um) break;
  }
  return pairs;
}

double SentAndRead::worst_um(std::size_t pairs, double factor, double constant_um) const noexcept {
  double worst = 0.0;
  for (std::size_t age = 0; age < pairs; ++age) {
    const double read_um = read_um_[index_of(age)] - constant_um;
    const double before_um = sent_um_[index_of(age + 1 < kept() ? age + 1 : age)];
    const auto [low_um, high_um] =
        std::minmax({factor * sent_um_[index_of(age)], factor * before_um});
    worst = std::max(worst, std::abs(read_um - std::clamp(read_um, low_um, high_um)));
  }
  return worst;
}

double SentAndRead::spread_um(std::size_t pairs, double sent_um) const noexcept {
  double low = sent_um;
  double high = sent_um;
  for (std::size_t age = 0; age < pairs; ++age) {
    low = std::min(low, sent_um_[index_of(age)]);
    high = std::max(high, sent_um_[index_of(age)]);
  }
  return high - low;
}

ConstantReadBack SentAndRead::standing(double sent_um, double read_um) const noexcept {
  ConstantReadBack found{0, sent_um, sent_um};
  for (; found.pairs < kept(); ++found.pairs) {
    const std::size_t i = index_of(found.pairs);
    if (!(std::abs(read_um_[i] - read_um) < apart_um)) break;
    found.low_um = std::min(found.low_um, sent_um_[i]);
    found.high_um = std::max(found.high_um, sent_um_[i]);
  }
  return found;
}

/// True for all pairs, or for those since the read-back was an offset sent.
bool SentAndRead::stands_still(double sent_um, double read_um) const noexcept {
  const ConstantReadBack found = standing(sent_um, read_um);
  const bool was_sent = read_um >= found.low_um - noise_um && read_um <= found.high_um + noise_um;
  return (was_sent || found.pairs == kept()) && found.high_um - found.low_um > 3.0 * noise_um;
}

Mismatch SentAndRead::judge(double sent_um, double read_um) const noexcept {
  const Mismatch found = judge_newest(kept(), sent_um, read_um);
  if (found.likely != MismatchCause::changes_alone) return found;
  const std::size_t since_it_began = disagreeing();
  Mismatch lately = judge_newest(since_it_began, sent_um, read_um);
  // Another writer would hardly hit the exact negative.
  const bool is_negative =
      lately.likely == MismatchCause::opposite_sign && std::abs(sent_um) >= negative_um_min;
  if (is_negative && std::abs(read_um + sent_um) <= noise_um) lately.sure = true;
  if (since_it_began == 0 && !is_negative) return found;
  const bool is_constant = lately.sure && lately.likely == MismatchCause::constant;
  return is_negative || is_constant ? lately : found;
}

Mismatch SentAndRead::judge_newest(std::size_t pairs, double sent_um,
                                   double read_um) const noexcept {
  Mismatch found;
  found.sent_um = sent_um;
  found.read_um = read_um;
  found.likely = MismatchCause::changes_alone;
  if (stands_still(sent_um, read_um)) {
    found.likely = MismatchCause::stands_still;
    return found;
  }
  const double allowed_um = noise_um + share_of_mismatch * std::abs(read_um - sent_um);
  const double factor = std::abs(sent_um) >= sent_um_min ? read_um / sent_um : not_a_number;
  const double constant_um = read_um - sent_um;
  const double of_factor_um = worst_um(pairs, factor, 0.0);
  const double of_constant_um = worst_um(pairs, 1.0, constant_um);
  // A negated comparison would accept NaN, the factor of an offset near 0.
  const bool factor_fits = std::isfinite(factor) && of_factor_um <= allowed_um;
  const bool constant_fits = of_constant_um <= allowed_um;
  found.sure = spread_um(pairs, sent_um) >
               std::max(spread_um_min, spread_share_min * std::abs(read_um - sent_um));
  const bool by_factor =
      factor_fits && (!constant_fits || is_usual(factor) || is_near(factor, -1.0) ||
                      (found.sure && of_factor_um < of_constant_um));
  if (by_factor) {
    found.likely = is_near(factor, -1.0) ? MismatchCause::opposite_sign : MismatchCause::factor;
    found.size = factor;
    found.or_constant = constant_fits && !found.sure;
  } else if (constant_fits) {
    found.likely = MismatchCause::constant;
    found.size = constant_um;
  }
  const double off_um = by_factor ? of_factor_um : of_constant_um;
  const double sure_um = noise_um + sure_share_of_mismatch * std::abs(read_um - sent_um);
  if (found.likely == MismatchCause::changes_alone || off_um > sure_um) found.sure = false;
  return found;
}

}  // namespace thermocomp
