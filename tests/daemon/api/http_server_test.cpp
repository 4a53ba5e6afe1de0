// The API on real sockets, with clients who mean no good.
#include "daemon/api/http_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <list>
#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/api/access.h"
#include "daemon/api/api.h"
#include "daemon/api/api_server.h"
#include "daemon/api/listeners.h"
#include "formats/base/file_io.h"
#include "tests/daemon/api/fake_service.h"
#include "tests/daemon/api/raw_client.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

class HttpServerTest : public ::testing::Test {
 protected:
  HttpServerTest() {
    options_.max_event_clients = 40;
    options_.ping = std::chrono::milliseconds(50);
    options_.default_out = "/out";
  }
  ~HttpServerTest() override { service_.Close(); }

  void Start() {
    api_.emplace(options_, &service_, nullptr, &NoLog());
    auto listener = UnixListener::Open(socket_);
    ASSERT_OK(listener);
    listener_.emplace(std::move(*listener));
    auto server = HttpServer::Start(limits_, {{listener_->fd(), false}}, &*api_);
    ASSERT_OK(server);
    server_ = std::move(*server);
  }

  // Sends bytes and nothing more, and returns all that comes.
  std::string Provoke(const std::string& bytes) {
    RawClient client(socket_);
    client.Send(bytes);
    client.EndSending();
    return client.ReadAll();
  }

  static void ExpectProblem(const std::string& answer, int status) {
    const size_t body = answer.find("\r\n\r\n");
    ASSERT_NE(body, std::string::npos) << answer;
    EXPECT_EQ(answer.substr(0, 12), "HTTP/1.1 " + std::to_string(status));
    EXPECT_THAT(answer.substr(0, body), HasSubstr("application/problem+json"));
    const Json problem = Json::parse(answer.substr(body + 4), nullptr, false);
    ASSERT_TRUE(problem.is_object()) << answer;
    EXPECT_EQ(problem["status"], status);
  }

  void WaitForSubscribers(int count) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (service_.subscribers() != count && std::chrono::steady_clock::now() < deadline)
      std::this_thread::yield();
    ASSERT_EQ(service_.subscribers(), count);
  }

  test::TemporaryDirectory folder_;
  std::string socket_ = folder_ / "api.sock";
  HttpLimits limits_;
  ApiOptions options_;
  FakeService service_;
  std::optional<Api> api_;
  std::optional<UnixListener> listener_;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(HttpServerTest, Answers) {
  Start();
  const RawAnswer health = Ask(socket_, "GET", "/healthz");
  EXPECT_EQ(health.status, 200);
  EXPECT_EQ(health.Header("Content-Type"), "application/json");
  EXPECT_EQ(health.Header("X-Content-Type-Options"), "nosniff");
  EXPECT_EQ(Json::parse(health.body)["status"], "ok");
  const RawAnswer list = Ask(socket_, "GET", "/v1/jobs?limit=1&state=failed");
  EXPECT_EQ(Json::parse(list.body)["jobs"][0]["id"], 3);
  const RawAnswer submitted =
      Ask(socket_, "POST", "/v1/jobs",
          R"({"job": {"kind": "material", "asset": "wall", "folder": "/maps"}})");
  EXPECT_EQ(submitted.status, 202);
  EXPECT_EQ(submitted.Header("Location"), "/v1/jobs/100");
}

TEST_F(HttpServerTest, ServesSeveralRequestsOfAConnection) {
  Start();
  RawClient client(socket_);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(client.Send("GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"));
    EXPECT_EQ(client.ReadAnswer().status, 200);
    // A POST without a word on its body has none.
    ASSERT_TRUE(client.Send("POST /v1/jobs/3/retry HTTP/1.1\r\nHost: x\r\n\r\n"));
    EXPECT_EQ(client.ReadAnswer().status, 200);
  }
  ASSERT_TRUE(client.Send("HEAD /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"));
  const std::string head = client.ReadAll();
  EXPECT_THAT(head, HasSubstr("200 OK"));
  EXPECT_THAT(head, Not(HasSubstr("{")));
}

TEST_F(HttpServerTest, RefusesWhatIsNoRequest) {
  Start();
  for (const char* request :
       {"\r\n\r\n", "GET\r\n\r\n", "GET /healthz\r\n\r\n", "GET /healthz HTTP/9.9\r\n\r\n",
        "FROB /healthz HTTP/1.1\r\nHost: x\r\n\r\n", "GET /healthz HTTP/1.1\r\n\r\n",
        "GET /healthz HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\n",
        "POST /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Length: -1\r\n\r\n",
        "POST /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nab",
        "POST /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Length: 0x5\r\n\r\nabcde",
        "POST /v1/jobs HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n"
        "Content-Length: 5\r\n\r\n0\r\n\r\n",
        "POST /v1/jobs HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: gzip\r\n\r\n",
        "POST /v1/jobs HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\nabc\r\n"})
    ExpectProblem(Provoke(request), 400);
  ExpectProblem(Provoke("POST /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\n"
                        "Content-Encoding: gzip\r\n\r\nabcd"),
                415);
  ExpectProblem(Provoke("POST /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\n"
                        "Content-Type: multipart/form-data; boundary=x\r\n\r\nabcd"),
                415);
  ExpectProblem(Provoke("PUT /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\n\r\nabcd"), 405);
  ExpectProblem(Provoke("DELETE /v1/jobs/1 HTTP/1.1\r\nHost: x\r\n\r\n"), 405);
  ExpectProblem(Provoke("GET /nowhere HTTP/1.1\r\nHost: x\r\n\r\n"), 404);
  ExpectProblem(Provoke("GET /v1/assets/x/files/%2e%2e%2f%2e%2e%2fetc HTTP/1.1\r\nHost: x\r\n\r\n"),
                404);
  EXPECT_EQ(Ask(socket_, "GET", "/healthz").status, 200);
}

TEST_F(HttpServerTest, SurvivesEveryTruncationOfARequest) {
  Start();
  const std::string request =
      "POST /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n"
      "Content-Length: 70\r\n\r\n"
      R"({"job": {"kind": "material", "asset": "wall", "folder": "/maps"}}     )";
  for (size_t size = 0; size < request.size(); ++size) {
    const std::string answer = Provoke(request.substr(0, size));
    EXPECT_TRUE(answer.empty() || answer.substr(0, 10) == "HTTP/1.1 4") << size << answer;
  }
  EXPECT_TRUE(service_.submitted.empty());
  EXPECT_EQ(Provoke(request).substr(0, 12), "HTTP/1.1 202");
}

TEST_F(HttpServerTest, LimitsSizes) {
  limits_.max_body_bytes = 1000;
  Start();
  const std::string head = "POST /v1/jobs HTTP/1.1\r\nHost: x\r\n";
  ExpectProblem(Provoke(head + "Content-Length: 1001\r\n\r\n" + std::string(1001, 'x')), 413);
  ExpectProblem(Provoke(head + "Content-Length: 99999999999999999\r\n\r\n"), 413);
  std::string chunks = head + "Transfer-Encoding: chunked\r\n\r\n";
  for (int i = 0; i < 20; ++i) chunks += "64\r\n" + std::string(100, 'x') + "\r\n";
  ExpectProblem(Provoke(chunks + "0\r\n\r\n"), 413);
  // Many headers, one that is long, a long path, and a line that never ends.
  std::string many = "GET /healthz HTTP/1.1\r\nHost: x\r\n";
  for (int i = 0; i < 4000; ++i) many += "X-" + std::to_string(i) + ": y\r\n";
  ExpectProblem(Provoke(many + "\r\n"), 431);
  const std::string long_header =
      Provoke("GET /healthz HTTP/1.1\r\nHost: x\r\nX: " + std::string(9000, 'y') + "\r\n\r\n");
  EXPECT_EQ(long_header.substr(0, 10), "HTTP/1.1 4");
  ExpectProblem(Provoke("GET /" + std::string(9000, 'y') + " HTTP/1.1\r\nHost: x\r\n\r\n"), 414);
  ExpectProblem(Provoke("GET /" + std::string(100000, 'y')), 431);
  EXPECT_EQ(Ask(socket_, "GET", "/healthz").status, 200);
}

TEST_F(HttpServerTest, EndsRequestsThatTakeTooLong) {
  limits_.request = std::chrono::milliseconds(200);
  Start();
  RawClient head(socket_), body(socket_), nothing(socket_), line(socket_);
  head.Send("GET /healthz HTTP/1.1\r\nHost: x\r\nX: ");
  body.Send("POST /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Length: 100\r\n\r\n{");
  line.Send("GET /hea");
  ExpectProblem(head.ReadAll(), 408);
  ExpectProblem(body.ReadAll(), 408);
  ExpectProblem(line.ReadAll(), 408);
  EXPECT_EQ(nothing.ReadAll(), "");
}

TEST_F(HttpServerTest, TurnsAwayTooManyConnections) {
  limits_.max_connections = 3;
  Start();
  std::list<RawClient> waiting;
  for (int i = 0; i < 3; ++i)
    waiting.emplace_back(socket_).Send("GET /v1/events HTTP/1.1\r\nHost: x\r\n\r\n");
  WaitForSubscribers(3);
  RawClient late(socket_);
  ExpectProblem(late.ReadAll(), 503);
}

TEST_F(HttpServerTest, IsNotDelayedByEventClientsWhoDoNotRead) {
  limits_.max_connections = 64;
  Start();
  std::list<RawClient> slow;
  for (int i = 0; i < 32; ++i)
    slow.emplace_back(socket_).Send("GET /v1/events HTTP/1.1\r\nHost: x\r\n\r\n");
  WaitForSubscribers(32);
  // More than their sockets hold, so that every one of them is stuck in a write.
  const std::string data = "{\"text\":\"" + std::string(60000, 'x') + "\"}";
  for (int i = 0; i < 40; ++i) service_.Publish("progress", 1, data, false);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(Ask(socket_, "GET", "/healthz").status, 200);
}

TEST_F(HttpServerTest, StreamsEvents) {
  Start();
  service_.Publish("submitted", 1, "{\"asset\":\"wall\"}");
  RawClient client(socket_);
  client.Send("GET /v1/events?after=0 HTTP/1.1\r\nHost: x\r\n\r\n");
  ASSERT_TRUE(client.WaitFor("id: 1\nevent: submitted\ndata: {\"id\":1,"));
  EXPECT_THAT(client.received(), HasSubstr("Content-Type: text/event-stream"));
  service_.Publish("progress", 1, "{}", false);
  ASSERT_TRUE(client.WaitFor("event: progress\n"));
  ASSERT_TRUE(client.WaitFor(": ping\n\n"));
  service_.Close();
  client.ReadAll();
  EXPECT_THAT(client.received(), ::testing::EndsWith("0\r\n\r\n"));
}

TEST_F(HttpServerTest, ResumesEventsAndTellsOfGaps) {
  Start();
  for (int i = 1; i <= 5; ++i) service_.Publish("started", i, "{}");
  RawClient resumed(socket_);
  resumed.Send("GET /v1/events?after=0 HTTP/1.1\r\nHost: x\r\nLast-Event-ID: 3\r\n\r\n");
  ASSERT_TRUE(resumed.WaitFor("id: 5\n"));
  EXPECT_THAT(resumed.received(), HasSubstr("id: 4\n"));
  EXPECT_THAT(resumed.received(), Not(HasSubstr("id: 3\n")));
  EXPECT_THAT(resumed.received(), Not(HasSubstr("reset")));
  service_.Forget(4);
  RawClient late(socket_);
  late.Send("GET /v1/events HTTP/1.1\r\nHost: x\r\nLast-Event-ID: 3\r\n\r\n");
  ASSERT_TRUE(late.WaitFor("id: 5\n"));
  EXPECT_THAT(late.received(), HasSubstr("event: reset\n"));
  RawClient of_one(socket_);
  of_one.Send("GET /v1/events?job=2&after=0 HTTP/1.1\r\nHost: x\r\n\r\n");
  WaitForSubscribers(3);
  service_.Publish("started", 1, "{}");
  service_.Publish("succeeded", 2, "{}");
  ASSERT_TRUE(of_one.WaitFor("event: succeeded"));
  EXPECT_THAT(of_one.received(), Not(HasSubstr("id: 6\n")));
  EXPECT_EQ(Ask(socket_, "GET", "/v1/events", "", "Last-Event-ID: x\r\n").status, 400);
}

TEST_F(HttpServerTest, CapsEventClientsAndNoticesWhenTheyLeave) {
  options_.max_event_clients = 2;
  Start();
  {
    RawClient first(socket_), second(socket_);
    for (RawClient* client : {&first, &second})
      client->Send("GET /v1/events HTTP/1.1\r\nHost: x\r\n\r\n");
    WaitForSubscribers(2);
    const RawAnswer third = Ask(socket_, "GET", "/v1/events");
    EXPECT_EQ(third.status, 503);
    EXPECT_EQ(third.Header("Retry-After"), "5");
  }
  WaitForSubscribers(0);
  RawClient again(socket_);
  again.Send("GET /v1/events HTTP/1.1\r\nHost: x\r\n\r\n");
  WaitForSubscribers(1);
}

TEST_F(HttpServerTest, SendsFiles) {
  Start();
  const std::string content(300000, 'z');
  ASSERT_OK(WriteFileDurably(folder_ / "report.html", std::string_view(content)));
  service_.assets["wall"] = {"wall", "", "", "baked", "", 1, "r1", folder_.path(), 0};
  const RawAnswer answer =
      Ask(socket_, "GET", "/v1/assets/wall/files/report.html", "", "Range: bytes=0-10\r\n");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, content);
  EXPECT_THAT(answer.Header("Content-Security-Policy"), HasSubstr("sandbox"));
}

TEST_F(HttpServerTest, ReplacesTheSocketOfADeadProcessAndNoOther) {
  const int stale = socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, socket_.c_str(), sizeof address.sun_path - 1);
  ASSERT_EQ(bind(stale, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  close(stale);
  Start();
  EXPECT_EQ(Ask(socket_, "GET", "/healthz").status, 200);
  struct stat info {};
  ASSERT_EQ(stat(socket_.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  const auto second = UnixListener::Open(socket_);
  EXPECT_EQ(second.error().code, ErrorCode::kConflict);
  EXPECT_THAT(second.error().message, HasSubstr("another patinad listens"));
  EXPECT_EQ(Ask(socket_, "GET", "/healthz").status, 200);
  server_.reset();
  listener_.reset();
  EXPECT_NE(stat(socket_.c_str(), &info), 0);
  ASSERT_OK(WriteFileDurably(folder_ / "file", std::string_view("x")));
  EXPECT_THAT(test::MessageOf(UnixListener::Open(folder_ / "file")), HasSubstr("no socket"));
  EXPECT_EQ(UnixListener::Open(folder_ / std::string(200, 'x')).error().code,
            ErrorCode::kInvalidArgument);
}

TEST_F(HttpServerTest, SharesNoTcpPort) {
  const auto first = OpenTcpListener("127.0.0.1", 0);
  ASSERT_OK(first);
  EXPECT_EQ(OpenTcpListener("127.0.0.1", first->port).error().code, ErrorCode::kConflict);
  ASSERT_OK(OpenTcpListener("localhost", 0));
  for (const char* host : {"0.0.0.0", "192.168.1.1", "::", "example.com", ""})
    EXPECT_EQ(OpenTcpListener(host, 0).error().code, ErrorCode::kInvalidArgument) << host;
}

TEST_F(HttpServerTest, AsksForATokenOverTcp) {
  ApiConfig config;
  config.socket = socket_;
  config.listen_host = "127.0.0.1";
  const auto without = ApiServer::Start(config, "/out", &service_, nullptr, &NoLog());
  EXPECT_THAT(test::MessageOf(without), HasSubstr("there is no token file"));
  config.token_file = folder_ / "token";
  ASSERT_OK(WriteFileDurably(config.token_file, std::string_view("0123456789abcdef\n")));
  ASSERT_EQ(chmod(config.token_file.c_str(), 0600), 0);
  auto server = ApiServer::Start(config, "/out", &service_, nullptr, &NoLog());
  ASSERT_OK(server);
  const auto ask = [&](const std::string& headers) {
    RawClient client((*server)->tcp_port());
    client.Send("GET /v1/status HTTP/1.1\r\n" + headers + "\r\n");
    return client.ReadAnswer().status;
  };
  EXPECT_EQ(ask("Host: localhost\r\n"), 401);
  EXPECT_EQ(ask("Host: localhost\r\nAuthorization: Bearer 0123456789abcdef\r\n"), 200);
  EXPECT_EQ(ask("Host: evil.example\r\nAuthorization: Bearer 0123456789abcdef\r\n"), 403);
  EXPECT_EQ(Ask(socket_, "GET", "/v1/status").status, 200);
}

TEST_F(HttpServerTest, MakesATokenOnceWhereNobodyNamedOne) {
  ApiConfig config;
  config.socket = socket_;
  config.listen_host = "127.0.0.1";
  config.token_file = folder_ / "token";
  const auto refused = ApiServer::Start(config, "/out", &service_, nullptr, &NoLog());
  EXPECT_THAT(test::MessageOf(refused), HasSubstr("is not there"));
  config.makes_token = true;
  std::string tokens[2];
  for (std::string& token : tokens) {
    auto server = ApiServer::Start(config, "/out", &service_, nullptr, &NoLog());
    ASSERT_OK(server);
    struct stat info {};
    ASSERT_EQ(stat(config.token_file.c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0600u);
    auto read = ReadTokenFile(config.token_file);
    ASSERT_OK(read);
    token = *read;
    RawClient client((*server)->tcp_port());
    client.Send("GET /v1/status HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token +
                "\r\n\r\n");
    EXPECT_EQ(client.ReadAnswer().status, 200);
  }
  EXPECT_GE(tokens[0].size(), 32u);
  EXPECT_EQ(tokens[0], tokens[1]);
}

TEST_F(HttpServerTest, StopsWhileClientsListen) {
  Start();
  RawClient events(socket_), half(socket_), idle(socket_);
  events.Send("GET /v1/events HTTP/1.1\r\nHost: x\r\n\r\n");
  half.Send("GET /healthz HTTP/1.1\r\n");
  WaitForSubscribers(1);
  server_.reset();
  EXPECT_EQ(service_.subscribers(), 0);
}

}  // namespace
}  // namespace patina::daemon
