#include <cstdio>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "modelling/command_line.hpp"
#include "modelling/identification/equation/similarity.hpp"
#include "report/files.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::identification {
namespace {

struct Options {
  std::vector<std::string> runs;
  std::string columns;
  std::vector<std::string> places;
  double threshold{-1.0};  ///< automatic if negative
  bool as_published{false};
  bool range_of_each_test{false};
  bool json{false};
  std::string picture;
};

using Json = nlohmann::ordered_json;

std::vector<std::string> names_of(const MeasuredTests& tests,
                                  const std::vector<std::size_t>& group) {
  std::vector<std::string> names;
  names.reserve(group.size());
  for (const std::size_t place : group) names.push_back(tests.places[place]);
  return names;
}

std::string json_of(const MeasuredTests& tests, const Eigen::MatrixXd& s,
                    const Grouping& grouping) {
  Json json;
  json["groups"] = Json::array();
  for (const auto& group : grouping.groups) json["groups"].push_back(names_of(tests, group));
  json["threshold"] = grouping.threshold;
  json["threshold_given"] = grouping.threshold_given;
  json["places"] = tests.places;
  json["similarity"] = Json::array();
  for (Eigen::Index row = 0; row < s.rows(); ++row) {
    Json line = Json::array();
    for (Eigen::Index column = 0; column < s.cols(); ++column) line.push_back(s(row, column));
    json["similarity"].push_back(line);
  }
  json["thresholds"] = Json::array();
  for (const Merge& merge : grouping.merges)
    json["thresholds"].push_back({{"from", merge.threshold}, {"groups", merge.groups}});
  json["notes"] = tests.notes;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

/// Table with full names, at least two blanks between the columns.
std::string table_of(const MeasuredTests& tests, const Eigen::MatrixXd& s,
                     const Grouping& grouping) {
  std::size_t longest = 7;  // width of a value
  for (const std::string& place : tests.places) longest = std::max(longest, place.size());
  const std::size_t width = longest + 2;
  const auto right = [width](const std::string& cell) {
    return std::string(width - std::min(width - 1, cell.size()), ' ') + cell;
  };
  std::string text = "\nS, a row against a column:\n" + std::string(width, ' ');
  for (const auto& group : grouping.groups)
    for (const std::size_t b : group) text += right(tests.places[b]);
  text += "\n";
  for (const auto& group : grouping.groups)
    for (const std::size_t a : group) {
      text += tests.places[a] + std::string(width - tests.places[a].size(), ' ');
      for (const auto& other : grouping.groups)
        for (const std::size_t b : other) {
          char value[32];
          std::snprintf(value, sizeof value, "%.2g",
                        s(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)));
          text += right(value);
        }
      text += "\n";
    }
  return text;
}

std::string text_of(const MeasuredTests& tests, const Eigen::MatrixXd& s,
                    const Grouping& grouping) {
  std::string text;
  char line[160];
  std::snprintf(line, sizeof line, "%zu places, %zu tests: %zu groups at S <= %.3g (%s)\n",
                tests.places.size(), tests.runs.size(), grouping.groups.size(), grouping.threshold,
                grouping.threshold_given ? "given" : "chosen: the widest gap between mergings");
  text += line;
  for (std::size_t i = 0; i < grouping.groups.size(); ++i) {
    std::snprintf(line, sizeof line, "group %zu (%zu):", i + 1, grouping.groups[i].size());
    text += line;
    for (const auto& name : names_of(tests, grouping.groups[i])) text.append(" ").append(name);
    text += "\n";
  }
  text += "\nother thresholds:\n";
  for (const Merge& merge : grouping.merges) {
    std::snprintf(line, sizeof line, "  from S = %-10.3g %zu groups\n", merge.threshold,
                  merge.groups);
    text += line;
  }
  return text + table_of(tests, s, grouping);
}

int run(const Options& options) {
  const std::vector<RunFile> runs = cli::RunLoader(options.columns).load(options.runs);
  const MeasuredTests tests = measured_tests(runs, {options.places, {}, 1});
  const Eigen::MatrixXd s =
      similarity(tests, !options.as_published,
                 options.range_of_each_test ? LargestOver::each_test : LargestOver::all_tests);
  Grouping grouping;
  if (options.threshold >= 0) {
    grouping = group_places(s, options.threshold);
  } else if (options.as_published) {
    throw std::runtime_error("--as-published needs --threshold, since sums have no common scale");
  } else {
    grouping = group_places(s, noise_floor(tests));
  }
  if (!options.picture.empty()) {
    cli::write_file(options.picture,
                    svg_file({groups_drawing("similarity S of places, light: alike; frames: groups",
                                             tests.places, s, grouping)}));
  }
  for (const std::string& note : tests.notes) std::fprintf(stderr, "%s\n", note.c_str());
  cli::write_file("-", options.json ? json_of(tests, s, grouping) : text_of(tests, s, grouping));
  return 0;
}

}  // namespace

void add_group_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub = app.add_subcommand("group", "similarity groups of measured temperatures");
  sub->add_option("RUN.csv", options->runs, "runs, each one test: RUN.csv[@T0:T1]")->required();
  sub->add_option("--columns", options->columns, cli::columns_help);
  sub->add_option("--places", options->places, "temperatures to compare; default: all")
      ->delimiter(',')
      ->type_name("NAME");
  sub->add_option("--threshold", options->threshold,
                  "largest S within a group; default: the widest gap between mergings")
      ->check(CLI::Range(0.0, 1e9));
  sub->add_flag("--as-published", options->as_published,
                "S as sums, not divided by the place's own sum of squares");
  sub->add_flag(
      "--range-of-each-test", options->range_of_each_test,
      "divide a place's rise by its largest in each test; default: by its largest in all tests");
  sub->add_option("--picture", options->picture, "heat map of S in the order of the groups (SVG)");
  sub->add_flag("--json", options->json, "groups, S and all thresholds as JSON");
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::identification
