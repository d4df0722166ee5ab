#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include "config/text/printable_text.hpp"
#include "modelling/experiments/test_plan.hpp"

namespace thermocomp::experiments {
namespace {

const std::string& level_of(const TestPlan& plan, std::size_t test, std::size_t factor) {
  const auto level = static_cast<std::size_t>(plan.design.rows[test][factor]);
  return plan.spec.factors[factor].levels[level];
}

std::string padded(std::string text, std::size_t width) {
  if (text.size() < width) text.append(width - text.size(), ' ');
  return text;
}

std::string clock(double minutes) {
  const long whole = std::lround(minutes);
  char text[32];
  std::snprintf(text, sizeof text, "%ld:%02ld", whole / 60, whole % 60);
  return text;
}

std::string coverage_text(const TestPlan& plan) {
  std::string text;
  text.append("strength ").append(std::to_string(plan.strength));
  text.append(plan.strength >= 2 ? ": any two factors have each combination equally often\n"
                                 : ": combinations of two factors do not occur equally often\n");
  text.append(plan.levels_balanced ? "all levels of a factor occur equally often\n"
                                   : "levels of a factor do not all occur equally often\n");
  text.append("pairs of levels covered: ").append(std::to_string(plan.pairs.covered));
  text.append(" of ").append(std::to_string(plan.pairs.possible));
  if (plan.pairs.impossible > 0)
    text.append("; excluded as forbidden: ").append(std::to_string(plan.pairs.impossible));
  text.append("\n");
  if (plan.dummy_levels)
    text.append(
        "a factor has fewer levels than its column: some of its levels occur twice as often\n");
  return text;
}

Cutting cutting_in(const TestPlan& plan, std::size_t test) {
  const TestSpec& spec = plan.spec.test;
  if (!spec.cutting_factor) return spec.cutting;
  return level_of(plan, test, *spec.cutting_factor) == "simulated" ? Cutting::simulated
                                                                   : Cutting::actual;
}

const char* how_to_cut(Cutting cutting) {
  return cutting == Cutting::simulated
             ? "Simulated cutting: a dummy workpiece stays in place, the tool makes every movement "
               "of the cut without touching it. Measure the distance on the dummy."
             : "Actual cutting: a workpiece is cut in every cycle.";
}

/// JP7689460B2: machining passes are rough cuts; the distance is measured after the finishing cut.
std::string cycle_of(const TestPlan& plan, std::size_t test) {
  const TestSpec& spec = plan.spec.test;
  const std::string cuts = spec.rough_cuts_factor ? level_of(plan, test, *spec.rough_cuts_factor)
                                                  : std::to_string(spec.rough_cuts);
  if (cuts == "0") return "";
  return "Each machining cycle: " + cuts + (cuts == "1" ? " rough cut" : " rough cuts") +
         ", one finishing cut, tool back at its origin, then measure.\n";
}

/// The machine runs (1) or stops (0) at a minute of the test.
bool runs_at(const TestSpec& test, double minute) {
  return std::none_of(test.stops.begin(), test.stops.end(), [&](const Stop& stop) {
    return minute > stop.after_h * 60.0 && minute <= stop.after_h * 60.0 + stop.pause_min;
  });
}

}  // namespace

std::string plan_text(const TestPlan& plan) {
  std::string text = plan.design.name;
  text.append(", ").append(std::to_string(plan.design.rows.size())).append(" tests\n");
  text.append(coverage_text(plan)).append("\n");
  std::vector<std::size_t> widths;
  for (const Factor& factor : plan.spec.factors) {
    std::size_t width = factor.name.size();
    for (const std::string& level : factor.levels) width = std::max(width, level.size());
    widths.push_back(width + 2);
  }
  text.append("test  run as  ");
  for (std::size_t i = 0; i < widths.size(); ++i)
    text.append(padded(plan.spec.factors[i].name, widths[i]));
  text.append("\n");
  for (std::size_t test = 0; test < plan.design.rows.size(); ++test) {
    const auto place = std::find(plan.order.begin(), plan.order.end(), test) - plan.order.begin();
    text.append(padded(std::to_string(test + 1), 6)).append(padded(std::to_string(place + 1), 8));
    for (std::size_t i = 0; i < widths.size(); ++i)
      text.append(padded(level_of(plan, test, i), widths[i]));
    text.append("\n");
  }
  return text;
}

std::string plan_json(const TestPlan& plan) {
  nlohmann::ordered_json json;
  json["design"] = plan.design.name;
  json["strength"] = plan.strength;
  json["levels_balanced"] = plan.levels_balanced;
  json["pairs"] = {{"possible", plan.pairs.possible},
                   {"covered", plan.pairs.covered},
                   {"impossible", plan.pairs.impossible}};
  for (const Factor& factor : plan.spec.factors) json["factors"].push_back(factor.name);
  json["tests"] = nlohmann::ordered_json::array();
  for (std::size_t test = 0; test < plan.design.rows.size(); ++test) {
    nlohmann::ordered_json levels = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < plan.spec.factors.size(); ++i)
      levels.push_back(level_of(plan, test, i));
    json["tests"].push_back(levels);
  }
  for (const std::size_t test : plan.order) json["order"].push_back(test + 1);
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string plan_csv(const TestPlan& plan) {
  // Levels are free text: quoted if they contain a comma or quote.
  const auto field = [](const std::string& text) {
    if (text.find_first_of(",\"\n") == std::string::npos) return text;
    std::string quoted("\"");
    for (const char c : text) quoted.append(c == '"' ? 2 : 1, c);
    return quoted.append("\"");
  };
  std::string text("test");
  for (const Factor& factor : plan.spec.factors) text.append(",").append(field(factor.name));
  text.append("\n");
  for (std::size_t test = 0; test < plan.design.rows.size(); ++test) {
    text.append(std::to_string(test + 1));
    for (std::size_t i = 0; i < plan.spec.factors.size(); ++i)
      text.append(",").append(field(level_of(plan, test, i)));
    text.append("\n");
  }
  return text;
}

std::string test_sheet(const TestPlan& plan) {
  const TestSpec& test_spec = plan.spec.test;
  std::string text("# Test sheet\n\n");
  text.append(plan.design.name).append(", ").append(std::to_string(plan.design.rows.size()));
  text.append(" tests of ").append(number_text(test_spec.hours)).append(" h.\n\n");
  text.append(coverage_text(plan))
      .append(
          "\nBefore each test, leave the machine at rest until its temperature is uniform. Take "
          "the first row of a run file before anything runs: it is the reference.\n");
  for (std::size_t place = 0; place < plan.order.size(); ++place) {
    const std::size_t test = plan.order[place];
    text.append("\n## ").append(std::to_string(place + 1)).append(". test ");
    text.append(std::to_string(test + 1)).append("\n\n");
    for (std::size_t i = 0; i < plan.spec.factors.size(); ++i)
      text.append("* ")
          .append(plan.spec.factors[i].name)
          .append(": ")
          .append(level_of(plan, test, i))
          .append("\n");
    text.append("\n").append(how_to_cut(cutting_in(plan, test))).append("\n");
    text.append(cycle_of(plan, test));
    text.append("\n| time (h:min) | do | done at, by |\n|---|---|---|\n| 0:00 | start | |\n");
    for (const Stop& stop : test_spec.stops) {
      text.append("| ").append(clock(stop.after_h * 60)).append(" | stop for ");
      text.append(number_text(stop.pause_min)).append(" min | |\n| ");
      text.append(clock(stop.after_h * 60 + stop.pause_min)).append(" | continue | |\n");
    }
    text.append("| ").append(clock(test_spec.hours * 60)).append(" | end | |\n");
    text.append("\nEvery ").append(number_text(test_spec.row_every_min));
    text.append(
        " min, at the end of a machining cycle with the tool back at its origin, enter all "
        "temperatures and the displacement into the run file of test ");
    text.append(std::to_string(test + 1)).append(".\n");
  }
  return text;
}

std::string run_file_skeleton(const TestPlan& plan, std::size_t test) {
  const TestSpec& spec = plan.spec.test;
  std::string text("# test ");
  text.append(std::to_string(test + 1)).append(" of ").append(plan.design.name).append("\n");
  for (std::size_t i = 0; i < plan.spec.factors.size(); ++i)
    text.append("# ")
        .append(plan.spec.factors[i].name)
        .append(" = ")
        .append(level_of(plan, test, i))
        .append("\n");
  if (!spec.cutting_factor)
    text.append(spec.cutting == Cutting::simulated ? "# cutting = simulated\n"
                                                   : "# cutting = actual\n");
  text.append("time_s,running_on");
  for (const auto& name : spec.temperatures) text.append(",").append(name);
  for (const auto& name : spec.outputs) text.append(",").append(name);
  text.append("\n");
  const auto steps = static_cast<long>(std::floor(spec.hours * 60.0 / spec.row_every_min + 1e-9));
  for (long step = 0; step <= steps; ++step) {
    const double minute = static_cast<double>(step) * spec.row_every_min;
    text.append(number_text(minute * 60.0));
    text.append(step > 0 && runs_at(spec, minute) ? ",1" : ",0");
    text.append(spec.temperatures.size() + spec.outputs.size(), ',');
    text.append("\n");
  }
  return text;
}

}  // namespace thermocomp::experiments
