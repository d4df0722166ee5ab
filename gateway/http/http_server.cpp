#include "gateway/http/http_server.hpp"

#include <arpa/inet.h>
#include <array>
#include <atomic>
#include <cstdarg>
#include <cstring>
#include <ctime>
#include <microhttpd.h>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include "config/toml/toml_reader.hpp"
#include "gateway/feed/page_state.hpp"
#include "gateway/http/event_streams.hpp"
#include "gateway/http/page_commands.hpp"
#include "gateway/http/password_file.hpp"
#include "gateway/http/request_rules.hpp"
#include "gateway/http/slow_answers.hpp"
#include "status/status_json.hpp"

namespace thermocomp::gateway {
namespace {

using nlohmann::json;

constexpr std::size_t body_bytes_max = 4096;
constexpr std::size_t header_bytes_max = std::size_t{16} * 1024;
constexpr unsigned silence_s_max = 10;
constexpr std::size_t page_events_max = 12;
constexpr const char* json_type = "application/json";

/// Nothing but what this gateway serves itself, in nobody's frame, and told to nobody.
constexpr const char* own_files_only =
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' "
    "data:; connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";
/// For a page with its scripts inside, from a file that the administrator named.
constexpr const char* own_scripts =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src "
    "'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
constexpr std::size_t gzip_bytes_min = 1400;  // a packet
constexpr std::array<std::array<const char*, 2>, 5> headers_of_all{
    {{"X-Content-Type-Options", "nosniff"},
     {"X-Frame-Options", "DENY"},
     {"Referrer-Policy", "no-referrer"},
     {"Cross-Origin-Resource-Policy", "same-origin"},
     {"Cache-Control", "no-store"}}};

std::string dumped(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string error_text(const std::string& text) {
  return dumped({{"error", text}});
}

std::string_view header(MHD_Connection* connection, const char* name) {
  const char* value = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
  return value != nullptr ? value : "";
}

bool takes_gzip(MHD_Connection* connection) {
  return header(connection, MHD_HTTP_HEADER_ACCEPT_ENCODING).find("gzip") != std::string_view::npos;
}

void tell_gzip(MHD_Response* response) {
  if (response == nullptr) return;
  MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_ENCODING, "gzip");
  MHD_add_response_header(response, MHD_HTTP_HEADER_VARY, MHD_HTTP_HEADER_ACCEPT_ENCODING);
}

std::string_view argument(MHD_Connection* connection, const char* name) {
  const char* value = MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, name);
  return value != nullptr ? value : "";
}

MHD_Result count_once(void* cls, MHD_ValueKind /*kind*/, const char* key, const char* /*value*/) {
  auto& facts = *static_cast<RequestFacts*>(cls);
  if (strcasecmp(key, MHD_HTTP_HEADER_HOST) == 0) ++facts.hosts_given;
  for (const char* name : {MHD_HTTP_HEADER_CONTENT_LENGTH, MHD_HTTP_HEADER_TRANSFER_ENCODING})
    if (strcasecmp(key, name) == 0) ++facts.lengths_given;
  return MHD_YES;
}

MHD_Result add_size(void* cls, MHD_ValueKind /*kind*/, const char* key, const char* value) {
  *static_cast<std::size_t*>(cls) += std::strlen(key) + (value != nullptr ? std::strlen(value) : 0);
  return MHD_YES;
}

int socket_of(MHD_Connection* connection) {
  const MHD_ConnectionInfo* info =
      MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  return info != nullptr ? info->connect_fd : -1;
}

[[gnu::format(printf, 2, 0)]] void log_library(void* /*cls*/, const char* format,
                                               va_list arguments) {
  std::array<char, 300> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  spdlog::debug("http: {}", text.data());
}

/// The connection ends with this answer: what follows a refused request may be its body, and must
/// not be taken for the next request.
void end_with(MHD_Response* response) {
  MHD_add_response_header(response, MHD_HTTP_HEADER_CONNECTION, "close");
}

/// What is kept of one request while it is served.
struct Request {
  std::string body;
  bool is_too_large{false};
  std::optional<JsonAnswer> answer;
  std::string user;  ///< empty: there are no passwords
};

struct Address {
  sockaddr_storage bytes{};
  bool is_six{false};
};

Address address_of(const HttpSettings& settings) {
  Address address;
  auto* four = reinterpret_cast<sockaddr_in*>(&address.bytes);
  if (inet_pton(AF_INET, settings.address.c_str(), &four->sin_addr) == 1) {
    four->sin_family = AF_INET;
    four->sin_port = htons(settings.port);
    return address;
  }
  auto* six = reinterpret_cast<sockaddr_in6*>(&address.bytes);
  six->sin6_family = AF_INET6;
  six->sin6_port = htons(settings.port);
  inet_pton(AF_INET6, settings.address.c_str(), &six->sin6_addr);
  address.is_six = true;
  return address;
}

/// As one of the problems of page_state(); the compensation does not suffer, so the verdict stays.
json broker_is_away(const MqttSettings& mqtt) {
  return {{"what", "the MQTT broker on " + mqtt.host + ", port " + std::to_string(mqtt.port) +
                       ", is away: nobody gets values or alarms from it"},
          {"remedy",
           "start the broker; if it runs, journalctl -u thermocomp-gateway says why it "
           "refuses. The newest messages are kept, and sent when it is back"}};
}

}  // namespace

struct HttpServer::Parts {
  Parts(const GatewaySettings& settings_in, DaemonFeed& feed_in, const PageFiles& files_in,
        AddFigures add_figures_in);
  ~Parts();

  // The library's callbacks, which know the server by a pointer.
  static MHD_Result on_request(void* cls, MHD_Connection* connection, const char* path,
                               const char* method, const char* version, const char* data,
                               std::size_t* size, void** state);
  static void on_completed(void* cls, MHD_Connection* connection, void** state,
                           MHD_RequestTerminationCode code);
  static void on_connection(void* cls, MHD_Connection* connection, void** context,
                            MHD_ConnectionNotificationCode code);

  void listen();
  MHD_Result serve(MHD_Connection* connection, const char* path, const char* method,
                   const char* data, std::size_t* size, void** state);
  MHD_Result begin(MHD_Connection* connection, const char* path, const char* method, void** state);
  [[nodiscard]] std::optional<Refusal> judge(MHD_Connection* connection, const char* path,
                                             const char* method) const;
  std::optional<MHD_Result> refuse_stranger(MHD_Connection* connection, Request& request);
  MHD_Result route(MHD_Connection* connection, std::string_view path, Request& request);
  MHD_Result post(MHD_Connection* connection, std::string_view path, Request& request);
  MHD_Result answer(MHD_Connection* connection, unsigned status, const char* type,
                    std::string text);
  MHD_Result queue(MHD_Connection* connection, unsigned status, const char* type,
                   MHD_Response* response, const char* policy = own_files_only);
  MHD_Result send(MHD_Connection* connection, const PageFile& file);
  MHD_Result of_daemon(MHD_Connection* connection, json (*part)(const Snapshot&));
  MHD_Result history(MHD_Connection* connection, Request& request);
  MHD_Result later(MHD_Connection* connection, Request& request, AnswerThread& answers,
                   AnswerThread::Work work);
  MHD_Result stream(MHD_Connection* connection);
  [[nodiscard]] GatewayFigures figures() const;

  const GatewaySettings& settings;
  DaemonFeed& feed;
  const PageFiles& files;
  HostRules hosts;
  std::optional<PasswordFile> passwords;
  PageCommands commands;
  AddFigures add_figures;
  AnswerThread history_answers;
  AnswerThread page_commands;  ///< of its own: nobody's charts are in the way of a command
  EventStreams streams;
  json shown;  ///< the newest state; only of the feed's thread
  SlowConnections connections;
  std::atomic<std::uint64_t> requests{0};
  std::atomic<std::uint64_t> refused{0};
  std::string certificate;  // the library goes on reading both
  std::string key;
  MHD_Daemon* daemon{nullptr};
  std::uint16_t port{0};
};

HttpServer::Parts::Parts(const GatewaySettings& settings_in, DaemonFeed& feed_in,
                         const PageFiles& files_in, AddFigures add_figures_in)
    : settings(settings_in),
      feed(feed_in),
      files(files_in),
      hosts(settings_in.http.address, settings_in.http.names),
      commands(settings_in),
      add_figures(std::move(add_figures_in)),
      connections(settings_in.http.connections_max) {
  if (!settings.http.passwords.empty()) passwords.emplace(settings.http.passwords);
  if (settings.http.has_tls()) {
    certificate = read_text_file(settings.http.certificate);
    key = read_text_file(settings.http.key);
  }
  listen();
}

HttpServer::Parts::~Parts() {
  history_answers.stop();
  page_commands.stop();
  streams.stop();
  if (daemon != nullptr) MHD_stop_daemon(daemon);
}

MHD_Result HttpServer::Parts::queue(MHD_Connection* connection, unsigned status, const char* type,
                                    MHD_Response* response, const char* policy) {
  if (response == nullptr) return MHD_NO;
  MHD_add_response_header(response, "Content-Security-Policy", policy);
  for (const auto& [name, value] : headers_of_all) MHD_add_response_header(response, name, value);
  MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type);
  if (status >= MHD_HTTP_BAD_REQUEST) end_with(response);
  if (settings.http.has_tls())
    MHD_add_response_header(response, "Strict-Transport-Security", "max-age=31536000");
  const MHD_Result queued = MHD_queue_response(connection, status, response);
  MHD_destroy_response(response);
  ++requests;
  return queued;
}

MHD_Result HttpServer::Parts::answer(MHD_Connection* connection, unsigned status, const char* type,
                                     std::string text) {
  connections.is_at(socket_of(connection), SlowConnections::Stage::answer,
                    SlowConnections::Clock::now());
  std::string gzip;
  if (text.size() >= gzip_bytes_min && takes_gzip(connection)) gzip = gzipped(text);
  const std::string& sent = gzip.empty() ? text : gzip;
  MHD_Response* response = MHD_create_response_from_buffer(
      sent.size(), const_cast<char*>(sent.data()), MHD_RESPMEM_MUST_COPY);
  if (!gzip.empty()) tell_gzip(response);
  return queue(connection, status, type, response);
}

MHD_Result HttpServer::Parts::send(MHD_Connection* connection, const PageFile& file) {
  connections.is_at(socket_of(connection), SlowConnections::Stage::answer,
                    SlowConnections::Clock::now());
  const bool is_gzip = !file.gzip.empty() && takes_gzip(connection);
  const std::string& sent = is_gzip ? file.gzip : file.bytes;
  MHD_Response* response = MHD_create_response_from_buffer(
      sent.size(), const_cast<char*>(sent.data()), MHD_RESPMEM_PERSISTENT);
  if (is_gzip) tell_gzip(response);
  return queue(connection, MHD_HTTP_OK, file.type.c_str(), response,
               file.has_own_scripts ? own_scripts : own_files_only);
}

std::optional<Refusal> HttpServer::Parts::judge(MHD_Connection* connection, const char* path,
                                                const char* method) const {
  RequestFacts facts{method,
                     path,
                     header(connection, MHD_HTTP_HEADER_HOST),
                     header(connection, "Origin"),
                     header(connection, "Sec-Fetch-Site"),
                     0,
                     0};
  MHD_get_connection_values(connection, MHD_HEADER_KIND, &count_once, &facts);
  MHD_get_connection_values(connection, MHD_GET_ARGUMENT_KIND, &add_size, &facts.query_bytes);
  return judge_request(facts, hosts);
}

/// @return nothing where the request may go on
std::optional<MHD_Result> HttpServer::Parts::refuse_stranger(MHD_Connection* connection,
                                                             Request& request) {
  if (!passwords) return std::nullopt;
  char* password = nullptr;
  char* user = MHD_basic_auth_get_username_password(connection, &password);
  const bool is_given = user != nullptr && password != nullptr;
  const PasswordFile::Answer checked =
      is_given ? passwords->check(user, password, PasswordFile::Clock::now())
               : PasswordFile::Answer::wrong;
  if (is_given) request.user = user;
  MHD_free(user);
  MHD_free(password);
  if (checked == PasswordFile::Answer::right) return std::nullopt;
  ++refused;
  if (checked == PasswordFile::Answer::too_many)
    return answer(connection, MHD_HTTP_TOO_MANY_REQUESTS, json_type,
                  error_text("too many wrong passwords; try again in some seconds"));
  const std::string text = error_text("user and password are needed");
  MHD_Response* response = MHD_create_response_from_buffer(
      text.size(), const_cast<char*>(text.data()), MHD_RESPMEM_MUST_COPY);
  if (response == nullptr) return MHD_NO;
  end_with(response);
  const MHD_Result queued = MHD_queue_basic_auth_fail_response(connection, "thermocomp", response);
  MHD_destroy_response(response);
  return queued;
}

MHD_Result HttpServer::Parts::begin(MHD_Connection* connection, const char* path,
                                    const char* method, void** state) {
  auto request = std::make_unique<Request>();
  Request& begun = *request;
  *state = request.release();  // on_completed ends it
  if (const std::optional<Refusal> refusal = judge(connection, path, method)) {
    ++refused;
    return answer(connection, refusal->status, json_type, error_text(refusal->text));
  }
  if (const std::optional<MHD_Result> done = refuse_stranger(connection, begun)) return *done;
  return MHD_YES;
}

MHD_Result HttpServer::Parts::serve(MHD_Connection* connection, const char* path,
                                    const char* method, const char* data, std::size_t* size,
                                    void** state) {
  if (*state == nullptr) return begin(connection, path, method, state);
  Request& request = *static_cast<Request*>(*state);
  if (*size > 0) {
    request.is_too_large = request.is_too_large || request.body.size() + *size > body_bytes_max;
    if (!request.is_too_large) request.body.append(data, *size);
    *size = 0;
    return MHD_YES;
  }
  if (request.is_too_large) {
    ++refused;
    return answer(connection, MHD_HTTP_CONTENT_TOO_LARGE, json_type,
                  error_text("a body has at most 4096 bytes"));
  }
  if (request.answer)
    return answer(connection, request.answer->status, json_type, std::move(request.answer->text));
  if (std::strcmp(method, "POST") == 0) return post(connection, path, request);
  return route(connection, path, request);
}

MHD_Result HttpServer::Parts::route(MHD_Connection* connection, std::string_view path,
                                    Request& request) {
  if (const PageFile* file = files.find(path)) return send(connection, *file);
  if (path == "/api/status")
    return of_daemon(connection, [](const Snapshot& all) { return json_of(all.status); });
  if (path == "/api/sensors")
    return of_daemon(connection, [](const Snapshot& all) { return json_of(all.sensors); });
  if (path == "/api/events") return stream(connection);
  if (path == "/api/history") return history(connection, request);
  if (path == "/api/commands") {
    json offered = commands.offered(request.user);
    offered["body"] = !settings.http.body.empty();
    return answer(connection, MHD_HTTP_OK, json_type, dumped(offered));
  }
  if (path == "/metrics")
    return answer(connection, MHD_HTTP_OK, "text/plain; version=0.0.4; charset=utf-8",
                  metrics_text(*feed.newest(), figures()));
  return answer(connection, MHD_HTTP_NOT_FOUND, json_type, error_text("there is no such page"));
}

MHD_Result HttpServer::Parts::post(MHD_Connection* connection, std::string_view path,
                                   Request& request) {
  if (path != "/api/command")
    return answer(connection, MHD_HTTP_METHOD_NOT_ALLOWED, json_type, error_text("only GET"));
  // A form of another site cannot have this type without asking first, and is not allowed to ask.
  if (header(connection, MHD_HTTP_HEADER_CONTENT_TYPE) != json_type)
    return answer(connection, MHD_HTTP_UNSUPPORTED_MEDIA_TYPE, json_type,
                  error_text("the body must be application/json"));
  return later(connection, request, page_commands,
               [this, user = request.user, body = request.body] {
                 JsonAnswer done = commands.take(user, body, *feed.newest());
                 if (done.status != MHD_HTTP_OK) ++refused;
                 return done;
               });
}

MHD_Result HttpServer::Parts::of_daemon(MHD_Connection* connection, json (*part)(const Snapshot&)) {
  const SnapshotPointer snapshot = feed.newest();
  if (!snapshot->is_here)
    return answer(connection, MHD_HTTP_SERVICE_UNAVAILABLE, json_type,
                  error_text("the daemon does not answer: " + snapshot->why));
  return answer(connection, MHD_HTTP_OK, json_type, dumped(part(*snapshot)));
}

MHD_Result HttpServer::Parts::history(MHD_Connection* connection, Request& request) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  std::string why;
  const std::optional<HistoryRequest> asked =
      parse_history_request(argument(connection, "from"), argument(connection, "to"),
                            argument(connection, "points"), static_cast<double>(now.tv_sec), why);
  if (!asked) return answer(connection, MHD_HTTP_BAD_REQUEST, json_type, error_text(why));
  return later(connection, request, history_answers,
               [this, asked = *asked] { return history_answer(feed, asked); });
}

/// Called again with the answer, when the answers has it; before that nothing ends the connection.
MHD_Result HttpServer::Parts::later(MHD_Connection* connection, Request& request,
                                    AnswerThread& answers, AnswerThread::Work work) {
  MHD_suspend_connection(connection);
  const auto done = [&request, connection](JsonAnswer made) {
    request.answer = std::move(made);
    MHD_resume_connection(connection);
  };
  if (!answers.ask(std::move(work), done))
    done({MHD_HTTP_SERVICE_UNAVAILABLE, error_text("too many requests wait")});
  return MHD_YES;
}

MHD_Result HttpServer::Parts::stream(MHD_Connection* connection) {
  connections.is_at(socket_of(connection), SlowConnections::Stage::stream,
                    SlowConnections::Clock::now());
  return queue(connection, MHD_HTTP_OK, "text/event-stream", streams.open(connection));
}

GatewayFigures HttpServer::Parts::figures() const {
  GatewayFigures told;
  told.pages = streams.count();
  told.requests = requests;
  told.refused = refused;
  if (add_figures) add_figures(told);
  return told;
}

void HttpServer::Parts::listen() {
  const Address address = address_of(settings.http);
  std::vector<MHD_OptionItem> options;
  const auto add = [&options](MHD_OPTION option, std::intptr_t value, void* pointer = nullptr) {
    options.push_back({option, value, pointer});
  };
  const auto callback = [](auto* function) { return reinterpret_cast<std::intptr_t>(function); };
  add(MHD_OPTION_EXTERNAL_LOGGER, callback(&log_library));
  add(MHD_OPTION_NOTIFY_COMPLETED, callback(&on_completed), this);
  add(MHD_OPTION_NOTIFY_CONNECTION, callback(&on_connection), this);
  add(MHD_OPTION_CONNECTION_LIMIT, settings.http.connections_max);
  add(MHD_OPTION_CONNECTION_TIMEOUT, silence_s_max);
  add(MHD_OPTION_CONNECTION_MEMORY_LIMIT, header_bytes_max);
  add(MHD_OPTION_STRICT_FOR_CLIENT, 1);
  add(MHD_OPTION_SOCK_ADDR, 0, const_cast<sockaddr_storage*>(&address.bytes));
  unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ERROR_LOG;
  if (address.is_six) flags |= MHD_USE_IPv6;
  if (settings.http.has_tls()) {
    flags |= MHD_USE_TLS;
    add(MHD_OPTION_HTTPS_MEM_CERT, 0, certificate.data());
    add(MHD_OPTION_HTTPS_MEM_KEY, 0, key.data());
    add(MHD_OPTION_HTTPS_PRIORITIES, 0,
        const_cast<char*>("SECURE128:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2"));
  }
  add(MHD_OPTION_END, 0);
  daemon = MHD_start_daemon(flags, settings.http.port, nullptr, nullptr, &on_request, this,
                            MHD_OPTION_ARRAY, options.data(), MHD_OPTION_END);
  const std::string place = settings.http.address + " port " + std::to_string(settings.http.port);
  if (daemon == nullptr)
    throw std::runtime_error("cannot listen on " + place +
                             (settings.http.has_tls()
                                  ? " (taken, not ours, or certificate and key do not fit)"
                                  : " (taken, or not an address of this computer)"));
  const MHD_DaemonInfo* info = MHD_get_daemon_info(daemon, MHD_DAEMON_INFO_BIND_PORT);
  port = info != nullptr ? info->port : settings.http.port;
}

MHD_Result HttpServer::Parts::on_request(void* cls, MHD_Connection* connection, const char* path,
                                         const char* method, const char* /*version*/,
                                         const char* data, std::size_t* size, void** state) {
  try {
    return static_cast<Parts*>(cls)->serve(connection, path, method, data, size, state);
  } catch (const std::exception& error) {
    spdlog::error("http: {}", error.what());
    return MHD_NO;  // ends this connection
  }
}

void HttpServer::Parts::on_completed(void* cls, MHD_Connection* connection, void** state,
                                     MHD_RequestTerminationCode /*code*/) {
  delete static_cast<Request*>(*state);
  *state = nullptr;
  static_cast<Parts*>(cls)->connections.is_at(
      socket_of(connection), SlowConnections::Stage::request, SlowConnections::Clock::now());
}

void HttpServer::Parts::on_connection(void* cls, MHD_Connection* connection, void** /*context*/,
                                      MHD_ConnectionNotificationCode code) {
  SlowConnections& connections = static_cast<Parts*>(cls)->connections;
  if (code == MHD_CONNECTION_NOTIFY_STARTED)
    connections.opened(socket_of(connection), SlowConnections::Clock::now());
  else
    connections.closed(socket_of(connection));
}

HttpServer::HttpServer(const GatewaySettings& settings, DaemonFeed& feed, const PageFiles& files,
                       AddFigures add_figures)
    : parts_(std::make_unique<Parts>(settings, feed, files, std::move(add_figures))) {}
HttpServer::~HttpServer() = default;

void HttpServer::show(const SnapshotPointer& snapshot) {
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

void HttpServer::end_slow_connections() {
  parts_->connections.end_slow(SlowConnections::Clock::now());
}

std::uint16_t HttpServer::port() const noexcept {
  return parts_->port;
}

}  // namespace thermocomp::gateway
