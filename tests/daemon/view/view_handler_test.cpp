// What `patina view` serves, and to whom it serves nothing.
#include "daemon/view/view_handler.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "daemon/api/dashboard.h"
#include "daemon/api/http_server.h"
#include "daemon/api/listeners.h"
#include "formats/base/file_io.h"
#include "tests/daemon/api/raw_client.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;
using Headers = std::vector<std::pair<std::string, std::string>>;

const std::string kToken = "0123456789abcdef0123456789abcdef";

class ViewHandlerTest : public ::testing::Test {
 protected:
  ViewHandlerTest() {
    fs::create_directories(folder_ / "wall/inner");
    Container container;
    container.directory = folder_ / "wall";
    container.manifest.asset = "wall";
    for (const char* name : {"features_0.dds", "inner/preview.png"})
      container.manifest.payloads.push_back({name, "features", 4, std::string(64, '0')});
    for (const char* name : {"wall/manifest.json", "wall/features_0.dds", "wall/run.json",
                             "wall/inner/preview.png", "secret"}) {
      EXPECT_TRUE(WriteFileDurably(folder_ / name, std::string_view("text")).has_value());
    }
    handler_.emplace(container, kToken, nullptr);
  }

  HttpResponse Send(const std::string& method, const std::string& path, Headers headers) {
    HttpRequest request;
    request.method = method;
    request.path = path;
    request.headers = std::move(headers);
    request.over_tcp = true;
    return handler_->Handle(request);
  }
  HttpResponse Get(const std::string& path) { return Send("GET", path, Right()); }
  static Headers Right() {
    return {{"Host", "127.0.0.1:7000"}, {"Authorization", "Bearer " + kToken}};
  }

  test::TemporaryDirectory folder_;
  std::optional<ViewHandler> handler_;
};

TEST_F(ViewHandlerTest, ServesTheViewerAndNothingElseOfTheDashboard) {
  EXPECT_EQ(Get("/").body, DashboardResponse("viewer.html").body);
  int viewer = 0;
  for (int i = 0; i < kDashboardFileCount; ++i) {
    const std::string name = kDashboardFiles[i].name;
    const int status = Send("GET", "/web/" + name, {{"Host", "127.0.0.1"}}).status;
    if (status == 200) ++viewer;
    if (name.substr(0, 4) == "view") {
      EXPECT_EQ(status, 200) << name;
    }
  }
  EXPECT_EQ(Get("/web/app.js").status, 404);
  EXPECT_EQ(Get("/web/queue.js").status, 404);
  EXPECT_GE(viewer, 10);
  for (const auto& [name, value] : Get("/").headers) {
    if (name == "Content-Security-Policy") {
      EXPECT_THAT(value, HasSubstr("default-src 'none'"));
      EXPECT_THAT(value, Not(HasSubstr("unsafe")));
    }
  }
}

// What a page imports is served, or the viewer does not start.
TEST_F(ViewHandlerTest, ServesAllThatItsPagesName) {
  int named = 0;
  for (int i = 0; i < kDashboardFileCount; ++i) {
    const std::string name = kDashboardFiles[i].name, text = kDashboardFiles[i].text;
    if (name.substr(0, 4) != "view" && name != "api.js" && name != "dom.js" && name != "token.js")
      continue;
    for (const std::string mark : {"from \"./", "=\"/web/"}) {
      for (size_t at = text.find(mark); at != std::string::npos; at = text.find(mark, at + 1)) {
        const size_t begin = at + mark.size();
        const std::string wanted = text.substr(begin, text.find('"', begin) - begin);
        EXPECT_EQ(Get("/web/" + wanted).status, 200) << name << " names " << wanted;
        ++named;
      }
    }
  }
  EXPECT_GT(named, 15);
}

TEST_F(ViewHandlerTest, GivesTheContainerToWhoHasTheTokenAlone) {
  const char* const kPaths[] = {"/v1/container/files/manifest.json",
                                "/v1/container/shader/bindings.json",
                                "/v1/container/source/source.json"};
  EXPECT_EQ(Get(kPaths[0]).file_bytes, 4u);
  EXPECT_EQ(Get(kPaths[2]).body, "null\n");
  const std::string longer = kToken + "0", shorter = kToken.substr(1);
  std::string wrong = kToken;
  wrong.back() = 'e';
  for (const char* path : kPaths) {
    for (const std::string& value :
         {std::string(), "Bearer " + wrong, "Bearer " + longer, "Bearer " + shorter,
          std::string("Bearer "), kToken, "Basic " + kToken, "Bearer  " + kToken}) {
      const HttpResponse response =
          Send("GET", path, {{"Host", "localhost:7000"}, {"Authorization", value}});
      EXPECT_EQ(response.status, 401) << path << " with " << value;
      EXPECT_THAT(response.body, HasSubstr("patina view"));
      EXPECT_FALSE(response.file);
    }
    EXPECT_EQ(Send("GET", path + ("?token=" + kToken), {{"Host", "localhost"}}).status, 401);
  }
}

TEST_F(ViewHandlerTest, RefusesOtherHostsAndOtherSites) {
  for (const char* path : {"/", "/web/viewer.js", "/v1/container/files/manifest.json"}) {
    for (const char* host : {"", "evil.example", "evil.example:7000", "127.0.0.1.evil.example",
                             "localhost.evil.example", "192.168.0.1:7000", "0.0.0.0:7000"}) {
      Headers headers = Right();
      headers[0].second = host;
      EXPECT_EQ(Send("GET", path, headers).status, 403) << path << " of " << host;
    }
    for (const char* origin : {"http://evil.example", "null", "http://127.0.0.1:7001"}) {
      Headers headers = Right();
      headers.emplace_back("Origin", origin);
      EXPECT_EQ(Send("GET", path, headers).status, 403) << path << " from " << origin;
    }
  }
}

TEST_F(ViewHandlerTest, ServesListedFilesAlone) {
  EXPECT_EQ(Get("/v1/container/files/features_0.dds").status, 200);
  for (const char* path : {"run.json", "features_1.dds", "", ".", "..", "../secret", "inner",
                           "inner/../features_0.dds", "/features_0.dds", "./features_0.dds",
                           "features_0.dds/", "..\\secret", "%2e%2e/secret"})
    EXPECT_EQ(Get(std::string("/v1/container/files/") + path).status, 404) << path;
  EXPECT_EQ(Get(std::string("/v1/container/files/features_0.dds\0x", 36)).status, 404);
  for (const char* path :
       {"/v1/status", "/v1/container", "/v1/container/", "/v1/assets/wall/files", "/healthz",
        "/manifest.json", "//", "", "v1/container/files/manifest.json",
        "/v1/container/source/0_0.bin", "/v1/container/source/../source.json"})
    EXPECT_EQ(Get(path).status, 404) << path;
  // A listed file that is a link to somewhere else.
  fs::remove(folder_ / "wall/features_0.dds");
  fs::create_symlink(folder_ / "secret", folder_ / "wall/features_0.dds");
  EXPECT_EQ(Get("/v1/container/files/features_0.dds").status, 404);
}

TEST_F(ViewHandlerTest, SaysWhatIsDamaged) {
  const HttpResponse response = Get("/v1/container/shader/bindings.json");
  EXPECT_EQ(response.status, 500);
  EXPECT_THAT(response.body, HasSubstr("manifest.json"));
  EXPECT_EQ(Json::parse(response.body)["code"], "corrupt_data");
}

TEST_F(ViewHandlerTest, TakesNothing) {
  for (const char* method : {"POST", "PUT", "DELETE", "PATCH", "OPTIONS"}) {
    for (const char* path : {"/", "/web/viewer.js", "/v1/container/files/manifest.json"}) {
      const HttpResponse response = Send(method, path, Right());
      EXPECT_EQ(response.status, 405) << method << " " << path;
      EXPECT_FALSE(response.file);
    }
  }
}

TEST_F(ViewHandlerTest, RefusesHugeRequestsOnItsSocket) {
  auto listener = OpenTcpListener("127.0.0.1", 0);
  ASSERT_OK(listener);
  HttpLimits limits;
  limits.max_body_bytes = 1024;
  auto server = HttpServer::Start(limits, {{listener->fd.get(), true}}, &*handler_);
  ASSERT_OK(server);
  const auto provoke = [&](const std::string& bytes) {
    RawClient client(listener->port);
    client.Send(bytes);
    client.EndSending();
    return client.ReadAll().substr(0, 12);
  };
  const std::string host = "Host: 127.0.0.1\r\n";
  EXPECT_EQ(provoke("GET / HTTP/1.1\r\n" + host + "Connection: close\r\n\r\n"), "HTTP/1.1 200");
  EXPECT_EQ(provoke("GET /" + std::string(20000, 'a') + " HTTP/1.1\r\n" + host + "\r\n"),
            "HTTP/1.1 414");
  EXPECT_EQ(provoke("GET / HTTP/1.1\r\n" + host + "X: " + std::string(100000, 'a') + "\r\n\r\n"),
            "HTTP/1.1 431");
  for (const char* method : {"POST", "PUT"}) {
    EXPECT_EQ(provoke(std::string(method) + " / HTTP/1.1\r\n" + host +
                      "Content-Length: 100000\r\n\r\n" + std::string(100000, 'a')),
              "HTTP/1.1 413");
  }
  EXPECT_EQ(provoke("GET /v1/container/files/%2e%2e/secret HTTP/1.1\r\n" + host +
                    "Authorization: Bearer " + kToken + "\r\nConnection: close\r\n\r\n"),
            "HTTP/1.1 404");
}

}  // namespace
}  // namespace patina::daemon
