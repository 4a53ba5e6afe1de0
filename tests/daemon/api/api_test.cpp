#include "daemon/api/api.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "tests/daemon/api/fake_service.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

class ApiTest : public ::testing::Test {
 protected:
  ApiTest() {
    options_.default_out = "/out";
    options_.token = "0123456789abcdef";
    api_.emplace(options_, &service_, nullptr, &NoLog());
  }

  HttpResponse Get(const std::string& path,
                   std::vector<std::pair<std::string, std::string>> query = {},
                   std::vector<std::pair<std::string, std::string>> headers = {}) {
    HttpRequest request;
    request.method = "GET";
    request.path = path;
    request.query = std::move(query);
    request.headers = std::move(headers);
    return api_->Handle(request);
  }

  HttpResponse Post(const std::string& path, const std::string& body,
                    std::vector<std::pair<std::string, std::string>> headers = {}) {
    HttpRequest request;
    request.method = "POST";
    request.path = path;
    request.body = body;
    request.headers = std::move(headers);
    request.headers.emplace_back("content-type", "application/json; charset=utf-8");
    return api_->Handle(request);
  }

  static std::string HeaderOf(const HttpResponse& response, const std::string& name) {
    for (const auto& [key, value] : response.headers) {
      if (key == name) return value;
    }
    return "";
  }

  ApiOptions options_;
  FakeService service_;
  std::optional<Api> api_;
  const std::string job_ = R"({"job": {"kind": "material", "asset": "wall", "folder": "/maps"}})";
};

TEST_F(ApiTest, QueuesAJob) {
  const HttpResponse response = Post("/v1/jobs", job_);
  EXPECT_EQ(response.status, 202);
  EXPECT_EQ(HeaderOf(response, "Location"), "/v1/jobs/100");
  EXPECT_EQ(Json::parse(response.body)["id"], 100);
  ASSERT_EQ(service_.submitted.size(), 1u);
  EXPECT_EQ(service_.submitted[0].job.asset, "wall");
}

TEST_F(ApiTest, MakesNoSecondJobForAKey) {
  const HttpResponse first = Post("/v1/jobs", job_, {{"Idempotency-Key", "k1"}});
  const HttpResponse second = Post("/v1/jobs", job_, {{"idempotency-key", "k1"}});
  EXPECT_EQ(Json::parse(first.body)["id"], Json::parse(second.body)["id"]);
  EXPECT_EQ(Json::parse(second.body)["created"], false);
  const HttpResponse other =
      Post("/v1/jobs", R"({"job": {"kind": "material", "asset": "other", "folder": "/maps"}})",
           {{"Idempotency-Key", "k1"}});
  EXPECT_EQ(other.status, 409);
  EXPECT_EQ(Post("/v1/jobs", job_, {{"Idempotency-Key", std::string(256, 'k')}}).status, 400);
  EXPECT_EQ(Post("/v1/jobs", job_, {{"Idempotency-Key", "a\nb"}}).status, 400);
}

TEST_F(ApiTest, PointsAtEveryBadField) {
  const HttpResponse response =
      Post("/v1/jobs", R"({"job": {"kind": "material", "asset": "wall", "folder": "/m", "sed": 1},
                           "priorty": 1})");
  EXPECT_EQ(response.status, 400);
  EXPECT_EQ(response.content_type, "application/problem+json");
  const Json problem = Json::parse(response.body);
  EXPECT_EQ(problem["status"], 400);
  EXPECT_EQ(problem["code"], "invalid_argument");
  ASSERT_EQ(problem["errors"].size(), 2u);
  EXPECT_EQ(problem["errors"][0]["pointer"], "/priorty");
  EXPECT_EQ(problem["errors"][1]["pointer"], "/job/sed");
}

TEST_F(ApiTest, PointsAtPathsThatTheServiceRefuses) {
  service_.failure = {ErrorCode::kInvalidArgument, "/folder: /maps is outside of the roots"};
  const HttpResponse response = Post("/v1/jobs", job_);
  EXPECT_EQ(response.status, 400);
  EXPECT_EQ(Json::parse(response.body)["errors"][0]["pointer"], "/job/folder");
}

TEST_F(ApiTest, WantsJson) {
  HttpRequest request;
  request.method = "POST";
  request.path = "/v1/jobs";
  request.body = job_;
  EXPECT_EQ(api_->Handle(request).status, 415);
}

TEST_F(ApiTest, ListsJobsInPages) {
  HttpResponse response = Get("/v1/jobs", {{"limit", "2"}});
  Json page = Json::parse(response.body);
  ASSERT_EQ(page["jobs"].size(), 2u);
  EXPECT_EQ(page["jobs"][0]["id"], 3);
  EXPECT_FALSE(page["jobs"][0].contains("job"));
  page = Json::parse(
      Get("/v1/jobs", {{"limit", "2"}, {"cursor", page["next_cursor"].get<std::string>()}}).body);
  ASSERT_EQ(page["jobs"].size(), 1u);
  EXPECT_EQ(page["jobs"][0]["id"], 1);
  EXPECT_FALSE(page.contains("next_cursor"));
  page = Json::parse(Get("/v1/jobs", {{"state", "failed,running"}, {"asset", "wall3"}}).body);
  ASSERT_EQ(page["jobs"].size(), 1u);
  EXPECT_EQ(page["jobs"][0]["error"]["message"], "albedo.png is cut off");
}

TEST_F(ApiTest, RefusesBadQueries) {
  using Query = std::vector<std::pair<std::string, std::string>>;
  for (const Query& query :
       {Query{{"limit", "0"}}, Query{{"limit", "1001"}}, Query{{"limit", ""}},
        Query{{"limit", "1x"}}, Query{{"cursor", "-1"}}, Query{{"state", "done"}},
        Query{{"state", ""}}, Query{{"lmit", "1"}}, Query{{"limit", "1"}, {"limit", "2"}},
        Query{{"cursor", "99999999999999999999"}}}) {
    const HttpResponse response = Get("/v1/jobs", query);
    EXPECT_EQ(response.status, 400) << query[0].first << "=" << query[0].second;
    EXPECT_THAT(Json::parse(response.body)["errors"][0]["pointer"].get<std::string>(),
                ::testing::StartsWith("?"));
  }
}

TEST_F(ApiTest, AnswersCopiesWithNotModified) {
  const HttpResponse first = Get("/v1/jobs/2");
  const std::string tag = HeaderOf(first, "ETag");
  ASSERT_FALSE(tag.empty());
  EXPECT_EQ(Json::parse(first.body)["progress"]["stage"], "train");
  EXPECT_EQ(Json::parse(first.body)["job"]["version"], 1);
  for (const std::string& header : {tag, "W/" + tag, "\"x\", " + tag, std::string("*")})
    EXPECT_EQ(Get("/v1/jobs/2", {}, {{"If-None-Match", header}}).status, 304) << header;
  service_.jobs[2].progress->fraction = 0.6;
  EXPECT_EQ(Get("/v1/jobs/2", {}, {{"If-None-Match", tag}}).status, 200);
}

TEST_F(ApiTest, ChangesJobs) {
  EXPECT_EQ(Post("/v1/jobs/1/cancel", "").status, 200);
  EXPECT_EQ(Post("/v1/jobs/2/cancel", "{}").status, 202);
  EXPECT_EQ(Post("/v1/jobs/3/cancel", "").status, 409);
  EXPECT_EQ(Post("/v1/jobs/3/retry", "").status, 200);
  EXPECT_EQ(Post("/v1/jobs/1/retry", "").status, 409);
  EXPECT_EQ(Post("/v1/jobs/9/retry", "").status, 404);
  EXPECT_EQ(Post("/v1/jobs/1/cancel", "{\"now\": true}").status, 400);
  EXPECT_EQ(Json::parse(Post("/v1/jobs/1/hold", "").body)["held"], true);
  EXPECT_EQ(Json::parse(Post("/v1/jobs/1/release", "").body)["held"], false);
  EXPECT_EQ(Json::parse(Post("/v1/jobs/1/priority", "{\"priority\": 5}").body)["priority"], 5);
  EXPECT_EQ(Post("/v1/jobs/1/priority", "{\"priority\": \"5\"}").status, 400);
  EXPECT_EQ(Json::parse(Post("/v1/queue/pause", "").body)["queue_paused"], true);
  EXPECT_EQ(Json::parse(Post("/v1/queue/resume", "").body)["queue_paused"], false);
  EXPECT_EQ(Post("/v1/watch/rescan", "").status, 409);
}

TEST_F(ApiTest, KnowsItsPathsAndMethods) {
  for (const char* path :
       {"", "//", "/v1", "/v1/", "/v1/jobs/", "/v1/jobs/1/", "/v2/jobs", "/v1/jobs/1/cancel/x",
        "v1/jobs", "//v1/jobs", "/v1/jobs/0", "/v1/jobs/-1", "/v1/jobs/x", "/v1/jobs/1 ",
        "/v1/jobs/99999999999999999999", "/healthz/"})
    EXPECT_EQ(Get(path).status, 404) << path;
  EXPECT_EQ(Get(std::string("/healthz\0", 9)).status, 404);
  const HttpResponse response = Get("/v1/jobs/1/cancel");
  EXPECT_EQ(response.status, 405);
  EXPECT_EQ(HeaderOf(response, "Allow"), "POST");
  EXPECT_EQ(HeaderOf(Post("/healthz", ""), "Allow"), "GET, HEAD");
}

TEST_F(ApiTest, GivesLogsInPieces) {
  HttpResponse response = Get("/v1/jobs/1/log", {{"limit", "7"}});
  EXPECT_EQ(response.body, "line 1\n");
  EXPECT_EQ(HeaderOf(response, "Patina-Next-Offset"), "7");
  EXPECT_EQ(HeaderOf(response, "Patina-Log-Complete"), "false");
  response = Get("/v1/jobs/1/log", {{"offset", "7"}});
  EXPECT_EQ(response.body, "line 2\n");
  EXPECT_EQ(HeaderOf(response, "Patina-Log-Complete"), "true");
  EXPECT_EQ(Get("/v1/jobs/1/log", {{"offset", "-7"}}).body, "line 2\n");
  EXPECT_EQ(Get("/v1/jobs/9/log").status, 404);
}

TEST_F(ApiTest, ServesFilesOfContainersAndNothingElse) {
  test::TemporaryDirectory folder;
  const std::string container = folder / "wall/r1";
  ASSERT_OK(MakeDirectories(container + "/inner"));
  ASSERT_OK(WriteFileDurably(container + "/manifest.json", std::string_view("{}")));
  ASSERT_OK(WriteFileDurably(container + "/inner/a.dds", std::string_view("dds!")));
  ASSERT_OK(WriteFileDurably(folder / "secret", std::string_view("secret")));
  ASSERT_EQ(symlink("../../secret", (container + "/link").c_str()), 0);
  ASSERT_EQ(symlink("../..", (container + "/up").c_str()), 0);
  service_.assets["wall"] = {"wall", "/out", "/drop/wall", "baked", "", 1, "r1", container, 0};
  service_.assets["bare"].name = "bare";

  const Json list = Json::parse(Get("/v1/assets/wall/files").body);
  ASSERT_EQ(list["files"].size(), 2u);
  EXPECT_EQ(list["files"][0]["name"], "inner/a.dds");
  const HttpResponse file = Get("/v1/assets/wall/files/inner/a.dds");
  EXPECT_EQ(file.status, 200);
  EXPECT_EQ(file.file_bytes, 4u);
  EXPECT_EQ(
      Get("/v1/assets/wall/files/inner/a.dds", {}, {{"If-None-Match", HeaderOf(file, "ETag")}})
          .status,
      304);
  for (const char* name : {"../../secret", "../r1/manifest.json", "inner/../manifest.json", "link",
                           "up/secret", "/etc/passwd", "", ".", "..", "inner", "inner/",
                           "manifest.json/", "missing", "./manifest.json"}) {
    const HttpResponse response = Get(std::string("/v1/assets/wall/files/") + name);
    EXPECT_TRUE(response.status == 400 || response.status == 404) << name << response.status;
    EXPECT_FALSE(response.file) << name;
    EXPECT_THAT(response.body, Not(HasSubstr("secret\n"))) << name;
  }
  EXPECT_EQ(Get("/v1/assets/bare/files").status, 404);
  EXPECT_EQ(Get("/v1/assets/bare/files/manifest.json").status, 404);
  EXPECT_EQ(Get("/v1/assets/../files/x").status, 404);
}

TEST_F(ApiTest, ListsAssetsInPages) {
  for (const char* name : {"a", "b", "c"}) service_.assets[name].name = name;
  Json page = Json::parse(Get("/v1/assets", {{"limit", "2"}}).body);
  EXPECT_EQ(page["next_cursor"], "b");
  page = Json::parse(Get("/v1/assets", {{"limit", "2"}, {"cursor", "b"}}).body);
  ASSERT_EQ(page["assets"].size(), 1u);
  EXPECT_EQ(Get("/v1/assets", {{"cursor", "../x"}}).status, 400);
}

TEST_F(ApiTest, WantsATokenOverTcp) {
  HttpRequest request;
  request.method = "GET";
  request.path = "/v1/status";
  request.over_tcp = true;
  request.headers = {{"Host", "localhost:80"}};
  HttpResponse response = api_->Handle(request);
  EXPECT_EQ(response.status, 401);
  EXPECT_EQ(HeaderOf(response, "WWW-Authenticate"), "Bearer");
  request.headers.emplace_back("Authorization", "Bearer 0123456789abcdef");
  EXPECT_EQ(api_->Handle(request).status, 200);
  request.headers[0].second = "evil.example";
  EXPECT_EQ(api_->Handle(request).status, 403);
  request.headers = {{"Host", "127.0.0.1"}};
  request.path = "/healthz";
  EXPECT_EQ(api_->Handle(request).status, 200);
}

TEST_F(ApiTest, TranslatesErrorsOfTheService) {
  const std::pair<ErrorCode, int> expected[] = {{ErrorCode::kInvalidArgument, 400},
                                                {ErrorCode::kNotFound, 404},
                                                {ErrorCode::kConflict, 409},
                                                {ErrorCode::kResourceExhausted, 507},
                                                {ErrorCode::kIo, 500},
                                                {ErrorCode::kCancelled, 503},
                                                {ErrorCode::kInternal, 500}};
  for (const auto& [code, status] : expected) {
    service_.failure = {code, "because \xFF"};
    for (const char* path : {"/v1/jobs/1", "/v1/jobs", "/v1/status", "/metrics", "/v1/events"}) {
      const HttpResponse response = Get(path);
      EXPECT_EQ(response.status, status) << path;
      EXPECT_EQ(Json::parse(response.body)["code"], ErrorCodeName(code));
    }
    EXPECT_EQ(Get("/healthz").status, 200);
    EXPECT_EQ(Get("/readyz").status, 503);
  }
}

TEST_F(ApiTest, WritesMetricsThatPrometheusReads) {
  const HttpResponse response = Get("/metrics");
  EXPECT_THAT(response.content_type, HasSubstr("version=0.0.4"));
  EXPECT_THAT(response.body, HasSubstr("# TYPE patina_jobs gauge\n"));
  EXPECT_THAT(response.body, HasSubstr("patina_jobs{state=\"queued\"} 1\n"));
  EXPECT_THAT(response.body, HasSubstr("patina_queue_seconds_bucket{le=\"1\"} 3\n"));
  EXPECT_THAT(response.body, HasSubstr("patina_queue_seconds_bucket{le=\"+Inf\"} 6\n"));
  EXPECT_THAT(response.body, HasSubstr("patina_queue_seconds_sum 42.5\n"));
  EXPECT_THAT(response.body, HasSubstr("{root=\"/dr\\\"op\\\\\\n\",mode=\"polling\"} 3\n"));
  for (size_t at = 0; at < response.body.size();) {
    const size_t end = response.body.find('\n', at);
    ASSERT_NE(end, std::string::npos);
    const std::string line = response.body.substr(at, end - at);
    EXPECT_TRUE(line.substr(0, 2) == "# " || line.substr(0, 7) == "patina_") << line;
    at = end + 1;
  }
}

}  // namespace
}  // namespace patina::daemon
