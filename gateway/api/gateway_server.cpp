#include "gateway/api/gateway_server.hpp"

#include <ctime>
#include <filesystem>
#include <optional>
#include <utility>

#include <nlohmann/json.hpp>

#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"
#include "gateway/api/history_answer.hpp"
#include "gateway/api/page_commands.hpp"
#include "gateway/feed/page_state.hpp"
#include "gateway/http/answer_thread.hpp"
#include "gateway/http/http_server.hpp"
#include "gateway/http/request_rules.hpp"
#include "status/status.hpp"

namespace thermocomp::gateway {
namespace {

using nlohmann::json;

constexpr std::size_t page_events_max = 12;

/// A further entry of page_state()'s problems. Compensation is not affected, so the verdict stays.
json broker_is_away(const MqttSettings& mqtt) {
  return {{"what", "the MQTT broker on " + mqtt.host + ", port " + std::to_string(mqtt.port) +
                       ", is not connected: it gets no values or alarms"},
          {"remedy",
           "start the broker; if it is running, see the log of thermocomp-gateway. The newest "
           "messages are kept and sent once it is connected"}};
}

}  // namespace

struct GatewayServer::Parts {
  Parts(const GatewaySettings& settings_in, DaemonFeed& feed_in, const PageFiles& files,
        AddFigures add_figures_in);
  ~Parts();

  void serve(HttpExchange& exchange);
  void take_command(HttpExchange& exchange);
  void answer_history(HttpExchange& exchange);
  void show_report(HttpExchange& exchange) const;
  void of_daemon(HttpExchange& exchange, json (*part)(const Snapshot&)) const;
  [[nodiscard]] GatewayFigures figures();

  const GatewaySettings& settings;
  DaemonFeed& feed;
  PageCommands commands;
  AddFigures add_figures;
  AnswerThread history_answers;
  AnswerThread page_commands;  ///< separate, so that slow charts do not delay commands
  EventStreams streams;
  json shown;       ///< newest state; feed's thread only
  HttpServer http;  ///< last: its handler uses the members above
};

GatewayServer::Parts::Parts(const GatewaySettings& settings_in, DaemonFeed& feed_in,
                            const PageFiles& files, AddFigures add_figures_in)
    : settings(settings_in),
      feed(feed_in),
      commands(settings_in),
      add_figures(std::move(add_figures_in)),
      http(settings_in.http, files, [this](HttpExchange& exchange) { serve(exchange); }) {}

GatewayServer::Parts::~Parts() {
  history_answers.stop();
  page_commands.stop();
  streams.stop();
}

void GatewayServer::Parts::serve(HttpExchange& exchange) {
  const std::string_view path = exchange.path();
  if (exchange.is_post()) return take_command(exchange);
  if (path == "/api/status")
    return of_daemon(exchange, [](const Snapshot& all) { return json_of(all.status); });
  if (path == "/api/sensors")
    return of_daemon(exchange, [](const Snapshot& all) { return json_of(all.sensors); });
  if (path == "/api/events") return exchange.stream(streams);
  if (path == "/api/history") return answer_history(exchange);
  if (path == "/report") return show_report(exchange);
  if (path == "/api/commands") {
    json offered = commands.offered(exchange.user());
    offered["body"] = !settings.http.body.empty();
    std::error_code none;
    offered["report"] = std::filesystem::exists(settings.http.report, none);
    return exchange.answer(200, json_type, dumped(offered));
  }
  if (path == "/metrics")
    return exchange.answer(200, "text/plain; version=0.0.4; charset=utf-8",
                           metrics_text(*feed.newest(), figures()));
  exchange.answer(404, json_type, error_text("page not found"));
}

void GatewayServer::Parts::take_command(HttpExchange& exchange) {
  if (exchange.path() != "/api/command")
    return exchange.answer(405, json_type, error_text("only GET"));
  // A form of another site cannot send this type without a preflight request, which is refused.
  if (exchange.header("Content-Type") != json_type)
    return exchange.answer(415, json_type, error_text("the body must be application/json"));
  exchange.later(page_commands, [this, user = exchange.user(), body = exchange.body()] {
    JsonAnswer done = commands.take(user, body, *feed.newest());
    if (done.status != 200) ++http.refused();
    return done;
  });
}

void GatewayServer::Parts::of_daemon(HttpExchange& exchange, json (*part)(const Snapshot&)) const {
  const SnapshotPointer snapshot = feed.newest();
  if (!snapshot->is_here)
    return exchange.answer(503, json_type,
                           error_text("the daemon does not answer: " + snapshot->why));
  exchange.answer(200, json_type, dumped(part(*snapshot)));
}

void GatewayServer::Parts::answer_history(HttpExchange& exchange) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  std::string why;
  const std::optional<HistoryRequest> asked =
      parse_history_request(exchange.argument("from"), exchange.argument("to"),
                            exchange.argument("points"), static_cast<double>(now.tv_sec), why);
  if (!asked) return exchange.answer(400, json_type, error_text(why));
  exchange.later(history_answers, [this, asked = *asked] { return history_answer(feed, asked); });
}

/// Reads the file for each request, because it is rewritten weekly.
void GatewayServer::Parts::show_report(HttpExchange& exchange) const {
  constexpr std::uintmax_t report_bytes_max = 4'000'000;
  try {
    exchange.answer(200, "text/html; charset=utf-8",
                    read_text_file(settings.http.report, report_bytes_max));
  } catch (const ConfigurationError& error) {
    exchange.answer(404, json_type, error_text(std::string("there is no report: ") + error.what()));
  }
}

GatewayFigures GatewayServer::Parts::figures() {
  GatewayFigures counts;
  counts.pages = streams.count();
  counts.requests = http.requests();
  counts.refused = http.refused();
  if (add_figures) add_figures(counts);
  return counts;
}

GatewayServer::GatewayServer(const GatewaySettings& settings, DaemonFeed& feed,
                             const PageFiles& files, AddFigures add_figures)
    : parts_(std::make_unique<Parts>(settings, feed, files, std::move(add_figures))) {}
GatewayServer::~GatewayServer() = default;

void GatewayServer::show(const SnapshotPointer& snapshot) {
  json state = page_state(*snapshot, parts_->settings.machine);
  state["events"] = page_events(*snapshot, page_events_max);
  const GatewayFigures figures = parts_->figures();
  if (figures.mqtt_enabled && !figures.mqtt_connected)
    state["problems"].push_back(broker_is_away(parts_->settings.mqtt));
  auto frame = std::make_shared<StreamFrame>();
  frame->number = snapshot->number;
  frame->text = "event: state\ndata: " + dumped(state) + "\n\n";
  if (const std::optional<json> change = state_change(parts_->shown, state))
    frame->change = "event: change\ndata: " + dumped(*change) + "\n\n";
  parts_->shown = std::move(state);
  parts_->streams.show(std::move(frame));
}

void GatewayServer::end_slow_connections() {
  parts_->http.end_slow_connections();
}

std::uint16_t GatewayServer::port() const noexcept {
  return parts_->http.port();
}

}  // namespace thermocomp::gateway
