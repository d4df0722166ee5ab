// thermocomp-fleet-page: web page of the store of a series of machines.
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <exception>
#include <optional>
#include <pqxx/pqxx>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <systemd/sd-daemon.h>

#include "config/toml/toml_reader.hpp"
#include "fleet/page/command_line.hpp"
#include "fleet/store/store.hpp"
#include "gateway/http/http_server.hpp"
#include "report/command.hpp"

namespace thermocomp::fleet {
namespace {

using gateway::AnswerThread;
using gateway::error_text;
using gateway::HttpExchange;
using gateway::json_type;
using gateway::JsonAnswer;

struct PageSettings {
  std::string store;  ///< connection
  gateway::HttpSettings http;
};

PageSettings load_settings(const std::filesystem::path& file) {
  const TomlDocument document = TomlDocument::from_file(file);
  const TomlTable root = document.root();
  PageSettings settings;
  static_cast<void>(root.integer("format", 1, 1));
  settings.store = root.text("store", "dbname=thermocomp_fleet");
  settings.http = gateway::read_http(root.table_or_empty("http"), file.parent_path());
  document.finish();
  return settings;
}

/// Queries the store on its own thread over its own read-only connection.
class StoreReader {
 public:
  explicit StoreReader(std::string conninfo) : conninfo_(std::move(conninfo)) {}

  /// @param call  function of the schema, with $1, $2, ... for `values`
  void ask(HttpExchange& exchange, const char* call, std::vector<std::string> values) {
    exchange.later(thread_, [this, call, values = std::move(values)] {
      return answer(std::string("SELECT ").append(call), values);
    });
  }

 private:
  JsonAnswer answer(const std::string& sql, const std::vector<std::string>& values) noexcept {
    try {
      if (!store_) {
        store_.emplace(complete_conninfo(conninfo_));
        pqxx::nontransaction(*store_).exec0(
            "SET default_transaction_read_only = on; SET statement_timeout = '20s'");
      }
      pqxx::nontransaction work(*store_);
      const pqxx::row row = work.exec_params1(sql, pqxx::prepare::make_dynamic_params(values));
      if (row[0].is_null()) return {404, error_text("no such machine")};
      return {200, row[0].as<std::string>()};
    } catch (const std::exception& error) {
      spdlog::warn("not answered: {}", error.what());
      store_.reset();
      return {503, error_text("the store does not answer")};
    }
  }

  std::string conninfo_;
  std::optional<pqxx::connection> store_;  ///< used by the thread only
  AnswerThread thread_;
};

std::optional<double> number_in(const HttpExchange& exchange, const char* name) {
  const std::string_view text = exchange.argument(name);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

class Page {
 public:
  explicit Page(const PageSettings& settings)
      : tables_(settings.store),
        curves_(settings.store),
        files_(gateway::page_folder("fleet/page"), {}, {}),
        http_(settings.http, files_, [this](HttpExchange& exchange) { serve(exchange); }) {}

  [[nodiscard]] std::uint16_t port() const { return http_.port(); }
  void tick() { http_.end_slow_connections(); }

 private:
  void serve(HttpExchange& exchange) {
    const std::string_view path = exchange.path();
    if (exchange.is_post()) return exchange.answer(405, json_type, error_text("only GET"));
    if (path == "/api/machines") return tables_.ask(exchange, "fleet.page_machines()", {});
    if (path == "/api/machine")
      return tables_.ask(exchange, "fleet.page_machine($1)",
                         {std::string(exchange.argument("name"))});
    if (path == "/api/curves") return ask_curves(exchange);
    exchange.answer(404, json_type, error_text("no such page"));
  }

  /// Curves of the last `seconds`, at most a year.
  void ask_curves(HttpExchange& exchange) {
    const std::optional<double> seconds = number_in(exchange, "seconds");
    constexpr double seconds_max = 366.0 * 86400.0;
    if (!seconds || !(*seconds >= 60.0 && *seconds <= seconds_max))
      return exchange.answer(400, json_type,
                             error_text("seconds must be a number in [60, 31622400]"));
    const auto now_s = static_cast<double>(std::time(nullptr));
    curves_.ask(exchange, "fleet.page_curves($1, $2, $3::float8, $4::float8, 400)",
                {std::string(exchange.argument("name")), std::string(exchange.argument("column")),
                 std::to_string(now_s - *seconds), std::to_string(now_s)});
  }

  StoreReader tables_;
  StoreReader curves_;  ///< separate, so that curves do not delay the table
  gateway::PageFiles files_;
  gateway::HttpServer http_;  ///< last, since its handler uses the others
};

/// Runs until a signal.
void run(const PageSettings& settings) {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  spdlog::set_default_logger(spdlog::stderr_color_mt("thermocomp-fleet-page"));
  Page page(settings);
  std::printf("{\"ready\":true,\"http\":%u}\n", static_cast<unsigned>(page.port()));
  std::fflush(stdout);
  sd_notify(0, "READY=1");
  const timespec second{1, 0};
  while (sigtimedwait(&signals, nullptr, &second) < 0) {
    page.tick();
    sd_notify(0, "WATCHDOG=1");
  }
}

}  // namespace
}  // namespace thermocomp::fleet

int main(int argc, char** argv) {
  using namespace thermocomp;
  std::string file;
  return cli::run_program(argc, argv, "thermocomp-fleet-page",
                          [&](CLI::App& app, cli::Action& action) {
                            fleet::declare_page_command_line(app, file);
                            action = [&] {
                              fleet::run(fleet::load_settings(file));
                              return cli::exit_success;
                            };
                          });
}
