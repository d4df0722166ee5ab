#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "config/runs/model_inputs.hpp"
#include "daemon/history/replay/record_loader.hpp"
#include "modelling/command_line.hpp"
#include "modelling/thermal_test/part_test.hpp"
#include "modelling/thermal_test/test_data.hpp"
#include "modelling/thermal_test/test_report.hpp"
#include "modelling/thermal_test/test_sheet.hpp"
#include "report/command.hpp"
#include "report/files.hpp"

namespace thermocomp::thermal_test {
namespace {

const std::map<std::string, TestKind> kinds{{"spindle", TestKind::spindle},
                                            {"environment", TestKind::environment},
                                            {"axis", TestKind::axis}};

constexpr const char* part = "part";

CLI::Option* add_kind(CLI::App& sub, std::string& kind) {
  return sub
      .add_option("--test", kind,
                  "heat source: environment (only its surroundings), spindle, axis; or "
                  "part: features of a test part, cold and warm")
      ->check(CLI::IsMember({"environment", "spindle", "axis", part}))
      ->type_name("TEST")
      ->required();
}

struct ReportOptions {
  std::string before;
  std::string after;
  std::string kind;
  TestOptions test;
  std::optional<double> tolerance_um;  ///< for a part
  std::string columns;
  std::string output;
  std::string json;
};

std::string sentences(const TestFigures& figures) {
  std::string text = figures.file + "\n";
  for (const AxisFigures& axis : figures.axes)
    text += "  " + axis_sentence(axis, figures.phases) + "\n";
  return text;
}

int run_part_report(const ReportOptions& options) {
  PartTest test{part_figures(options.before), {}, options.tolerance_um};
  if (!options.after.empty()) test.after = part_figures(options.after);
  cli::write_file(options.output, part_html(test));
  if (!options.json.empty()) cli::write_file(options.json, part_json(test));
  if (options.output != "-" && options.json != "-")
    for (const std::string& sentence : part_sentences(test)) std::puts(sentence.c_str());
  return cli::exit_success;
}

int run_report(ReportOptions options) {
  if (options.kind == part) return run_part_report(options);
  if (options.tolerance_um) throw cli::Failure("--tolerance-um: only with --test part");
  options.test.kind = kinds.at(options.kind);
  cli::RunLoader loader(options.columns);
  const RunFile first = cli::load_record(options.before, loader);
  TestData before = test_data(first, options.test);
  std::optional<TestData> after;
  if (!options.after.empty()) {
    const RunFile second = cli::load_record(options.after, loader);
    if (share_rows(first, second))
      throw cli::Failure(options.after + ": has rows of " + options.before +
                         "; before and after must be two recordings");
    after = test_data(second, options.test);
  }
  for (const TestData* data : {&before, after ? &*after : nullptr})
    for (const std::string& axis : data == nullptr ? std::vector<std::string>{} : data->left_out)
      std::fprintf(stderr, "%s: %s\n", data->file.c_str(), axis.c_str());
  const TestAnswer answer = answer_of(std::move(before), std::move(after));
  cli::write_file(options.output, report_html(answer));
  if (!options.json.empty()) cli::write_file(options.json, report_json(answer));
  if (options.output != "-" && options.json != "-") {
    std::string text = sentences(answer.before_figures);
    if (answer.after_figures) text += sentences(*answer.after_figures);
    for (const std::string& note : answer.notes) text += note + "\n";
    std::fputs(text.c_str(), stdout);
  }
  return cli::exit_success;
}

struct PlanOptions {
  std::string kind;
  SheetOptions sheet;
  PartSheet part;
  std::string moving{"x"};
  std::string speed{"constant"};
  std::string output;
  double hours{0.0};
};

int run_plan(PlanOptions options) {
  const bool page = options.output.ends_with(".html");
  if (!page && !options.output.ends_with(".csv") && options.output != "-")
    throw cli::Failure(options.output + ": must end with .csv or .html");
  if (options.kind == part) {
    if (options.hours > 0.0) options.part.hours = options.hours;
    cli::write_file(options.output, part_sheet(options.part, page));
    return cli::exit_success;
  }
  options.sheet.kind = kinds.at(options.kind);
  options.sheet.steps = options.speed == "steps";
  options.sheet.moving = options.moving.front();
  const bool surroundings = options.sheet.kind == TestKind::environment;
  options.sheet.hours = options.hours > 0.0 ? options.hours : surroundings ? 24.0 : 4.0;
  if (surroundings && options.sheet.every_min == SheetOptions{}.every_min)
    options.sheet.every_min = 15.0;
  cli::write_file(options.output, page ? sheet_html(options.sheet) : sheet_csv(options.sheet));
  return cli::exit_success;
}

void add_report(CLI::App& group, std::function<int()>& action) {
  const auto options = std::make_shared<ReportOptions>();
  CLI::App* sub = group.add_subcommand(
      "report", "a page with the figures of one test, or of two before and after");
  sub->add_option("BEFORE", options->before,
                  "RUN.csv[@T0:T1], or a history[@T0:T1] with probed values")
      ->type_name("FILE")
      ->required();
  sub->add_option("AFTER", options->after, "the same test with compensation")->type_name("FILE");
  add_kind(*sub, options->kind);
  sub->add_option("--axis", options->test.axes,
                  "column of an axis: z=ch5_um; tilt from two probes and their distance: "
                  "a=ch3_um-ch4_um/150mm; default: columns named x_um ... c_urad, x1_um, x2_um")
      ->type_name("AXIS=COLUMN");
  sub->add_option("--distance-mm", options->test.distance_mm,
                  "distance between the probes x1 and x2, y1 and y2, for the tilts B and A")
      ->check(CLI::PositiveNumber)
      ->type_name("MM");
  sub->add_option("--running", options->test.running,
                  "column that is not 0 while it runs, or T0:T1 in seconds; default: the column "
                  "in rpm (spindle), in mm/min or mm (axis)")
      ->type_name("COLUMN");
  sub->add_option("--room", options->test.room, "column of the room's temperature")
      ->type_name("COLUMN");
  sub->add_option(
         "--noise-um", options->test.noise_um,
         "standard deviation of one value of the probe; default: estimated from the values")
      ->check(CLI::NonNegativeNumber)
      ->type_name("UM");
  sub->add_option("--tolerance-um", options->tolerance_um,
                  "with --test part: allowed shift of a feature, for a verdict")
      ->check(CLI::PositiveNumber)
      ->type_name("UM");
  sub->add_option("--columns", options->columns, cli::columns_help)->type_name("FILE");
  sub->add_option("-o,--output", options->output, "page to write (HTML); - is standard output")
      ->type_name("FILE")
      ->required();
  sub->add_option("--json", options->json, "file for the figures as JSON; - is standard output")
      ->type_name("FILE");
  sub->callback([options, &action] { action = [options] { return run_report(*options); }; });
}

void add_plan(CLI::App& group, std::function<int()>& action) {
  const auto options = std::make_shared<PlanOptions>();
  CLI::App* sub = group.add_subcommand(
      "plan", "a test sheet: instructions, and a row to fill in for each reading");
  add_kind(*sub, options->kind);
  sub->add_option("--hours", options->hours,
                  "duration of running, default 4 (part: 2); environment: of the test, default 24")
      ->check(CLI::PositiveNumber)
      ->type_name("H");
  sub->add_option("--cooling-hours", options->sheet.cooling_h,
                  "duration of the record after running, default 2")
      ->check(CLI::NonNegativeNumber)
      ->type_name("H");
  sub->add_option("--every-min", options->sheet.every_min,
                  "minutes between two readings, default 5 (environment: 15)")
      ->check(CLI::PositiveNumber)
      ->type_name("MIN");
  sub->add_option("--features", options->part.features, "number of features of the part, default 6")
      ->check(CLI::Range(1, 100))
      ->type_name("N");
  sub->add_option("--repeats", options->part.repeats,
                  "number of cold and warm repeats with the part, default 3")
      ->check(CLI::Range(2, 100))
      ->type_name("N");
  sub->add_option("--rpm-max", options->sheet.rpm_max, "largest speed of the spindle")
      ->check(CLI::PositiveNumber)
      ->type_name("RPM");
  sub->add_option("--speed", options->speed,
                  "constant (75 % of the largest) or steps (half an hour each)")
      ->check(CLI::IsMember({"constant", "steps"}))
      ->type_name("HOW");
  sub->add_option("--feed", options->sheet.feed_mm_per_min, "feed at which the axis moves")
      ->check(CLI::PositiveNumber)
      ->type_name("MM_PER_MIN");
  sub->add_option("--moving", options->moving, "the axis that moves, default x")
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->type_name("AXIS");
  sub->add_option("-o,--output", options->output,
                  "SHEET.csv to fill in, or SHEET.html to print; - is standard output (CSV)")
      ->type_name("FILE")
      ->required();
  sub->callback([options, &action] { action = [options] { return run_plan(*options); }; });
}

}  // namespace

void add_thermal_test_command(CLI::App& app, std::function<int()>& action) {
  CLI::App* group = app.add_subcommand(
      "thermal-test", "tests of thermal behaviour after ISO 230-3: plan and report");
  group->require_subcommand(1);
  add_report(*group, action);
  add_plan(*group, action);
}

}  // namespace thermocomp::thermal_test
