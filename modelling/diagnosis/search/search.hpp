/// The search for what a model gets wrong: profile of every hypothesis, choice, joint refit.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "modelling/diagnosis/data/place_groups.hpp"
#include "modelling/diagnosis/evidence/evidence.hpp"
#include "modelling/diagnosis/evidence/sensor_witness.hpp"
#include "modelling/diagnosis/evidence/settings_together.hpp"
#include "modelling/diagnosis/hypothesis/parameter.hpp"

namespace thermocomp::diagnosis {

/// What counts as a finding.
struct Thresholds {
  /// Least share of the RMS that a cause must take from rows it was not fitted to.
  double left_out_gain_min{0.12};
  /// Least gain of 2 ln L over noise that may be as large as the residual, unless it takes
  /// `obvious_share` of the RMS of left-out rows.
  double score_min{25.0};
  double obvious_share{0.7};
  /// A finding is clear when it takes this share of the RMS of left-out rows, when it gains
  /// clear_score and takes seen_share, or when the sum of share / clear_share and
  /// 2 ln L / clear_score (at most 1) is large enough.
  double clear_share{0.55};
  double clear_score{90.0};
  double seen_share{0.2};
  double clear_sum{1.55};
  /// Several are clear when they take this share together and gain clear_score.
  double together_share{0.65};
  /// Least RMS of what a cause explains, as a share of the measured motion's; never below the noise
  /// of a single value.
  double motion_share_min{0.005};
  /// Later findings explain at least this share of the residual's RMS before the first.
  double later_share_min{0.2};
  /// All findings together must take this share of the variance of left-out rows.
  double carried_share_min{0.3};
  std::size_t findings_max{4};
  /// Outputs have one unit and much the same noise: shares are of all their squares together, since
  /// a cause that is plain in one of them leaves most others as they are. For the same reason what
  /// is likeliest need not be large enough to be named; then the best that is comes first.
  bool one_unit{false};
  /// Where one finding after another leaves a doubt, two are sought together.
  bool in_pairs{true};
  /// Only what is likelier than everything else together is named: calibrated for displacement, not
  /// for temperatures.
  bool by_probability{true};
  double probability_min{0.5};
  /// Only what the shares and scores above make clear is named.
  bool by_gates{false};
};

struct Finding {
  Explanation explanation;
  /// Spread of the shape parameters (of the logarithm where the grid is logarithmic) and gains.
  std::vector<double> shape_sd;
  std::vector<Eigen::VectorXd> gain_sd;   ///< one an output
  std::vector<Explanation> alternatives;  ///< best first, of other causes or subjects
  /// Outermost values of each shape parameter, far from its own, that explain as much.
  std::vector<Interval> rivals{};
};

/// What was weighed for a finding, whether it became one or not.
struct Weighed {
  std::size_t round{0};  ///< 1: for the first finding
  std::string cause{};
  std::string subject{};
  double score{0.0};
  double left_out_gain{0.0};
  double left_out_gain_of_best{0.0};
  double log_left{0.0};
  double witness{0.0};
  std::size_t free_parameters{0};
  /// Which search beside the model's own fit (SearchBesideFit) it was; 0: that of all outputs.
  std::size_t beside_fit{0};
};

struct SearchResult {
  std::vector<Finding> findings;  ///< in order of gain
  /// Share of an output's residual variance, noise taken out, that is left.
  std::vector<double> unexplained_share;
  /// Structure is left that is large against noise and motion, and nothing carries it.
  bool unexplained{false};
  /// Probability of each family for the first finding; what is missing to 1 is "nothing".
  std::map<std::string, double> families{};
  std::vector<Weighed> weighed;  ///< the best few of every round
};

class LeftOut;
struct LeftOutGain;
struct Headroom;

/// Seeks causes in the training rows.
class Search {
 public:
  /// Told what is accepted before the columns of any hypothesis are asked for again.
  using Accepted = std::function<void(const std::vector<Explanation>&)>;

  Search(const MeasuredData& data, const Thresholds& thresholds);
  /// With hypotheses of another catalogue; where their columns depend on what else is wrong,
  /// `accepted` says what that is.
  Search(const MeasuredData& data, const Thresholds& thresholds, std::vector<Hypothesis> hypotheses,
         Accepted accepted);
  [[nodiscard]] SearchResult run();
  /// What could be predicted of an output's remainder beyond what these findings carry.
  [[nodiscard]] std::vector<Headroom> headrooms(const SearchResult& result) const;
  [[nodiscard]] const PlaceGroups& groups() const noexcept { return groups_; }
  /// The explanations under consideration for the next finding, best first.
  [[nodiscard]] std::vector<Explanation> ranked();

 private:
  struct Trial {
    double score{0.0};
    std::vector<Eigen::VectorXd> gains;
  };
  using Settings = std::vector<const Setting*>;

  /// Under each of several settings, of each shape, of each output.
  struct Equations {
    EquationsTable table{};
    std::size_t shapes{0};
    std::size_t outputs{0};
    [[nodiscard]] std::size_t place(std::size_t under, std::size_t shape,
                                    std::size_t output) const {
      return (under * shapes + shape) * outputs + output;
    }
  };

  using Group = std::vector<const Hypothesis*>;
  /// A hypothesis and what it is weighed at.
  struct Part {
    const Hypothesis* hypothesis{nullptr};
    Shapes shapes;
  };
  /// Under each of several settings of an output the equations of groups of `width` columns.
  using Weigh =
      std::function<std::vector<EquationsTable>(const Panel& columns, Eigen::Index width)>;

  [[nodiscard]] Equations no_equations(Eigen::Index width, std::size_t shapes,
                                       std::size_t settings) const;
  /// Of hypotheses of one width and output.
  /// @param weigh  one an output
  [[nodiscard]] std::vector<Equations> equations_of_each(const std::vector<Part>& parts,
                                                         std::size_t settings,
                                                         const std::vector<Weigh>& weigh) const;
  [[nodiscard]] std::vector<Equations> equations_of_readings(
      const Group& hypotheses, const std::vector<Settings>& settings) const;
  /// Of hypotheses of one cause and run, over their grid.
  /// @param together  one an output
  [[nodiscard]] std::vector<Equations> equations_from_onset(
      const Group& hypotheses, std::size_t settings,
      const std::vector<SettingsTogether>& together) const;
  /// Those of a hypothesis whose columns are those of another but for a factor.
  [[nodiscard]] Equations scaled(const Equations& equations, const Hypothesis& from,
                                 const Hypothesis& to, std::size_t settings) const;
  /// One trial a shape.
  [[nodiscard]] std::vector<Trial> weigh_all(const Hypothesis& hypothesis, const Shapes& shapes,
                                             const Settings& settings) const;
  [[nodiscard]] Trial weigh(const Hypothesis& hypothesis, const std::vector<double>& shape,
                            const Settings& settings) const;
  /// @param gains  one an output; null: they are not wanted
  [[nodiscard]] double score_of(const Hypothesis& hypothesis, const Equations& equations,
                                std::size_t under, std::size_t shape, const Settings& settings,
                                std::vector<Eigen::VectorXd>* gains) const;
  [[nodiscard]] double shared_gain(const Equations& equations, std::size_t under, std::size_t shape,
                                   const Hypothesis& hypothesis, const Settings& settings) const;
  /// The best point of the grid under each of the settings is added to those that it belongs to,
  /// where it gains more than it costs.
  void add_best_of_grid(const Hypothesis& hypothesis, const Equations& equations,
                        const std::vector<Settings>& settings,
                        std::vector<std::vector<Explanation>>& under_each) const;
  /// With others of its pattern.
  [[nodiscard]] bool shares_columns(const Hypothesis& hypothesis) const;
  /// Every hypothesis at the best point of its grid, under each of the settings.
  [[nodiscard]] std::vector<std::vector<Explanation>> profile(
      const std::vector<Settings>& settings) const;
  [[nodiscard]] std::vector<Settings> profiled_settings() const;
  [[nodiscard]] std::vector<Explanation> judged(std::vector<std::vector<Explanation>> under_each);
  void take_likeliest_settings(const std::vector<Explanation*>& explanations) const;
  /// @return what it comes to at its new shape
  Trial refine(Explanation& explanation) const;
  void settle(std::vector<Explanation*> explanations) const;
  void settle_anew(Explanation& explanation) const;
  [[nodiscard]] double price(const Hypothesis& hypothesis) const;
  [[nodiscard]] bool concerns(const Hypothesis& hypothesis, std::size_t output) const;
  void choose(std::vector<Explanation>& candidates) const;
  void measure_left_out(std::vector<Explanation>& candidates) const;
  [[nodiscard]] Explanation in_white_noise(const Explanation& explanation) const;
  /// In its own noise or in white noise, whichever leaves less.
  [[nodiscard]] LeftOutGain left_out_gain(const Explanation& explanation, LeftOut& left_out) const;
  void measure_left_out(Explanation& explanation, LeftOut& left_out) const;
  void measure_without();
  void accept(const std::vector<Finding>& findings, std::size_t but);
  /// Best first.
  struct BothStances {
    std::vector<Explanation> right;          ///< the coefficients are
    std::vector<Explanation> beside_errors;  ///< of all coefficients
  };
  [[nodiscard]] BothStances first_candidates();
  /// Whether errors of all coefficients are reckoned with; holds for every later finding too.
  void doubt(bool doubted);
  /// @param candidates  for the first finding, best first
  /// @param errors_seen  the coefficients are taken as right although they hardly are
  [[nodiscard]] SearchResult run_from(const std::vector<Explanation>& candidates, bool errors_seen);
  /// Findings one after another.
  struct Path {
    std::vector<Finding> findings;
    std::vector<Weighed> weighed{};
    double log_left{0.0};  ///< of all together, over all outputs, their price added
    double score{0.0};     ///< 2 ln L with all of them, their price taken off
    std::map<std::string, double> families{};  ///< of the first round
  };
  /// Adds findings for as long as they are earned.
  /// @param candidates  for the round `from_round`, where that is the first
  void follow(Path& path, std::vector<Explanation> candidates, std::size_t from_round);
  void put_likeliest_first(std::vector<Explanation>& candidates, Path& path) const;
  [[nodiscard]] bool may_be_named(const Explanation& explanation, bool first) const;
  [[nodiscard]] bool named(const Path& path) const;
  [[nodiscard]] bool in_doubt(const Path& path) const;
  void reconsider(Path& path, const std::vector<Explanation>& firsts);
  [[nodiscard]] std::vector<Path> pairs(const std::vector<Explanation>& firsts);
  [[nodiscard]] bool stands(Path& path);
  [[nodiscard]] bool each_earned(std::vector<Finding>& findings);
  [[nodiscard]] bool each_likely(std::vector<Finding>& findings);
  void measure(Path& path);
  [[nodiscard]] SearchResult result_of(Path path);
  /// With all other candidates as alternatives.
  [[nodiscard]] static Finding finding_of(const std::vector<Explanation>& candidates,
                                          std::size_t chosen);
  void refit(std::vector<Finding>& findings);
  void settle_for_left_out_rows(Explanation& explanation) const;
  void measure_spread(std::vector<Finding>& findings);
  [[nodiscard]] double widening(const Setting& setting, const Panel& columns,
                                const Eigen::VectorXd& gains) const;
  [[nodiscard]] double step_of_values_s(const Explanation& explanation) const;
  [[nodiscard]] double shape_sd(const Explanation& explanation, std::size_t parameter) const;
  [[nodiscard]] Interval rivals(const Explanation& explanation, std::size_t parameter,
                                double wider) const;
  [[nodiscard]] double carried_share(const std::vector<Finding>& findings,
                                     std::size_t output) const;
  /// Whether any output has a share.
  [[nodiscard]] static bool acts(const Explanation& explanation);
  /// Whether it may be named.
  [[nodiscard]] bool earned(const Explanation& explanation, bool first) const;
  [[nodiscard]] bool convincing(const std::vector<Finding>& findings) const;
  [[nodiscard]] bool matters(const Explanation& explanation, bool first) const;
  [[nodiscard]] bool structure_left() const;

  const MeasuredData& data_;
  Thresholds thresholds_;
  StackedRows rows_;
  PlaceGroups groups_;
  Panel readings_;  ///< the model's calm readings over the stacked rows
  SensorWitness witness_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<OutputEvidence> outputs_;
  std::vector<std::size_t> measured_;     ///< outputs with values
  std::vector<double> log_left_without_;  ///< of an output that an explanation does not act on
  Accepted accepted_;
};

}  // namespace thermocomp::diagnosis
