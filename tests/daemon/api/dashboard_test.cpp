// What the dashboard needs of the API: its pages, uploads, revisions and tickets; and what is kept
// from others.
#include "daemon/api/dashboard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "daemon/api/access.h"
#include "daemon/api/api.h"
#include "daemon/api/container_files.h"
#include "formats/base/file_io.h"
#include "tests/daemon/api/fake_service.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;
using Headers = std::vector<std::pair<std::string, std::string>>;
using std::chrono::seconds;

class DashboardTest : public ::testing::Test {
 protected:
  DashboardTest() {
    options_.default_out = "/out";
    options_.token = "0123456789abcdef";
    options_.uploads.folder = folder_ / "uploads";
    options_.uploads.files = &RealFileCalls();
    options_.uploads.max_bytes = 1000;
    options_.uploads.keep_free_bytes = 0;
    Begin();
  }

  void Begin() { api_.emplace(options_, &service_, nullptr, &NoLog()); }

  HttpResponse Send(const std::string& method, const std::string& path, Headers headers = {},
                    const std::string& body = "", Headers query = {}, bool over_tcp = false) {
    HttpRequest request;
    request.method = method;
    request.path = path;
    request.headers = std::move(headers);
    request.query = std::move(query);
    request.body = body;
    request.over_tcp = over_tcp;
    return api_->Handle(request);
  }
  HttpResponse PostJson(const std::string& path, const Json& body) {
    return Send("POST", path, {{"Content-Type", "application/json"}}, body.dump());
  }
  HttpResponse Piece(const std::string& upload, const std::string& file, const std::string& bytes,
                     const std::string& offset = "0") {
    return Send("POST", "/v1/uploads/" + upload + "/files/" + file,
                {{"Content-Type", "application/octet-stream"}}, bytes, {{"offset", offset}});
  }
  std::string BeginUpload(const Json& files, const std::string& name = "wall") {
    const HttpResponse begun = PostJson("/v1/uploads", {{"name", name}, {"files", files}});
    EXPECT_EQ(begun.status, 201) << begun.body;
    return begun.status == 201 ? Json::parse(begun.body)["upload"].get<std::string>() : "";
  }
  static std::string HeaderOf(const HttpResponse& response, const std::string& name) {
    for (const auto& [key, value] : response.headers) {
      if (key == name) return value;
    }
    return "";
  }
  size_t FoldersOfUploads() {
    std::error_code ignored;
    fs::directory_iterator begin(options_.uploads.folder, ignored), end;
    return static_cast<size_t>(std::distance(begin, end));
  }

  test::TemporaryDirectory folder_;
  ApiOptions options_;
  FakeService service_;
  std::optional<Api> api_;
};

// A list of one measurement of a BRDF, which is a thing to bake.
const char* const kSamples =
    "theta_i,phi_i,theta_o,phi_o,r,g,b\n10,0,20,180,0.1,0.2,0.3\n30,0,20,180,0.1,0.2,0.3\n";

TEST_F(DashboardTest, ServesItsPagesUnderAStrictPolicy) {
  ASSERT_GT(kDashboardFileCount, 5);
  for (int i = 0; i < kDashboardFileCount; ++i) {
    const std::string name = kDashboardFiles[i].name, text = kDashboardFiles[i].text;
    const HttpResponse response = Send("GET", "/web/" + name);
    ASSERT_EQ(response.status, 200) << name;
    EXPECT_EQ(response.body, text);
    const std::string policy = HeaderOf(response, "Content-Security-Policy");
    EXPECT_THAT(policy, HasSubstr("default-src 'none'"));
    EXPECT_THAT(policy, HasSubstr("frame-ancestors 'none'"));
    EXPECT_THAT(policy, Not(HasSubstr("unsafe")));
    EXPECT_EQ(HeaderOf(response, "X-Content-Type-Options"), "nosniff");
    EXPECT_EQ(HeaderOf(response, "Referrer-Policy"), "no-referrer");
    // Nothing of another server, and nothing that makes markup of text.
    for (const char* foreign : {"https://", "innerHTML", "insertAdjacentHTML", "document.write",
                                "eval(", "new Function", " style=\"", "javascript:"})
      EXPECT_THAT(text, Not(HasSubstr(foreign))) << name;
  }
  EXPECT_EQ(Send("GET", "/").body, Send("GET", "/web/index.html").body);
  EXPECT_EQ(Send("GET", "/").content_type, "text/html; charset=utf-8");
  EXPECT_EQ(Send("GET", "/web/app.js").content_type, "text/javascript; charset=utf-8");
  for (const char* name : {"", "app", "../web/app.js", "APP.JS", "app.js/", "/app.js", "x.js"})
    EXPECT_EQ(Send("GET", std::string("/web/") + name).status, 404) << name;
  EXPECT_EQ(Send("POST", "/web/app.js").status, 405);
}

TEST_F(DashboardTest, ServesPagesWithoutATokenAndNothingElse) {
  const Headers local = {{"Host", "127.0.0.1:7420"}};
  EXPECT_EQ(Send("GET", "/", local, "", {}, true).status, 200);
  EXPECT_EQ(Send("GET", "/web/app.js", local, "", {}, true).status, 200);
  EXPECT_EQ(Send("GET", "/", {{"Host", "evil.example"}}, "", {}, true).status, 403);
  for (const char* path :
       {"/v1/status", "/v1/jobs", "/v1/jobs/1/curve", "/v1/assets/wall/revisions",
        "/v1/assets/wall/files/report.html", "/v1/events"})
    EXPECT_EQ(Send("GET", path, local, "", {}, true).status, 401) << path;
  for (const char* path : {"/v1/uploads", "/v1/uploads/x/files/a.png", "/v1/uploads/x/submit",
                           "/v1/uploads/x/drop", "/v1/tickets", "/v1/jobs/1/cancel"})
    EXPECT_EQ(Send("POST", path, local, "{}", {}, true).status, 401) << path;
}

TEST_F(DashboardTest, RefusesWhatAPageOfAnotherSiteSends) {
  const std::string path = "/v1/queue/pause";
  const auto asks = [&](Headers headers) {
    headers.emplace_back("Host", "bake.example:8080");
    return Send("POST", path, headers).status;
  };
  EXPECT_EQ(asks({}), 200);  // no browser
  EXPECT_EQ(asks({{"Origin", "http://bake.example:8080"}, {"Sec-Fetch-Site", "same-origin"}}), 200);
  EXPECT_EQ(asks({{"Origin", "https://BAKE.example:8080"}}), 200);
  for (const char* origin : {"http://evil.example", "http://bake.example", "null", "file://",
                             "http://bake.example:8080.evil.example", "http://x@bake.example:8080"})
    EXPECT_EQ(asks({{"Origin", origin}}), 403) << origin;
  EXPECT_EQ(asks({{"Sec-Fetch-Site", "cross-site"}}), 403);
  EXPECT_EQ(asks({{"Sec-Fetch-Site", "same-site"}}), 403);
  for (const char* type : {"text/plain", "text/plain;charset=UTF-8",
                           "multipart/form-data; boundary=x", "Application/X-WWW-Form-Urlencoded"})
    EXPECT_EQ(asks({{"Content-Type", type}}), 403) << type;
  EXPECT_EQ(Send("GET", "/v1/status", {{"Host", "h"}, {"Origin", "http://evil.example"}}).status,
            403);
}

TEST_F(DashboardTest, TakesFilesInPiecesAndBakesThem) {
  const std::string text = kSamples;
  options_.uploads.max_bytes = 1 << 20;
  Begin();
  const std::string id = BeginUpload(
      {{{"name", "sparse.csv"}, {"bytes", text.size()}}, {{"name", "empty.txt"}, {"bytes", 0}}});
  EXPECT_EQ(PostJson("/v1/uploads/" + id + "/submit", Json::object()).status, 409);  // not complete
  EXPECT_EQ(Json::parse(Piece(id, "sparse.csv", text.substr(0, 20)).body)["bytes"], 20);
  const HttpResponse wrong = Piece(id, "sparse.csv", text.substr(20), "19");
  EXPECT_EQ(wrong.status, 409);
  EXPECT_THAT(wrong.body, HasSubstr("byte 20"));
  EXPECT_EQ(Piece(id, "sparse.csv", text.substr(20) + "x", "20").status,
            400);  // more than announced
  EXPECT_EQ(Piece(id, "other.csv", "x").status, 404);
  EXPECT_EQ(Piece(id, "sparse.csv", text.substr(20), "20").status, 200);
  const HttpResponse made =
      PostJson("/v1/uploads/" + id + "/submit", {{"quality", "preview"}, {"priority", 3}});
  ASSERT_EQ(made.status, 202) << made.body;
  ASSERT_EQ(service_.submitted.size(), 1u) << made.body;
  const SubmitRequest& request = service_.submitted[0];
  EXPECT_EQ(request.job.file, options_.uploads.folder + "/" + id + "/wall/sparse.csv");
  EXPECT_EQ(request.job.quality, Quality::kPreview);
  EXPECT_EQ(request.priority, 3);
  EXPECT_EQ(*ReadTextFile(request.job.file, 1000), text);
  EXPECT_EQ(*ReadTextFile(options_.uploads.folder + "/" + id + "/jobs", 1000),
            std::to_string(Json::parse(made.body)["jobs"][0]["id"].get<int>()) + "\n");
  EXPECT_EQ(PostJson("/v1/uploads/" + id + "/submit", Json::object()).status, 404);
  EXPECT_EQ(Piece(id, "sparse.csv", "x", "20").status, 404);
}

TEST_F(DashboardTest, RefusesHostileNamesOfUploads) {
  for (const char* name : {"", "..", ".", ".hidden", "-rf", "a/b", "a\\b", "a b", "wall\n"}) {
    EXPECT_EQ(
        PostJson("/v1/uploads", {{"name", name}, {"files", {{{"name", "a.png"}, {"bytes", 1}}}}})
            .status,
        400)
        << name;
  }
  const std::string deep = "a/b/c/d/e/f/g/h/i/j.png";
  for (const std::string& name :
       {std::string(""), std::string("../a.png"), std::string("a/../../b.png"),
        std::string("/etc/passwd"), std::string("a//b"), std::string("a/"), std::string("."),
        std::string(".ssh/x"), std::string("a\\b.png"), std::string("a\0b", 3), std::string("a\nb"),
        std::string(" a"), std::string(129, 'a'), deep}) {
    const Json body = {{"name", "wall"}, {"files", {{{"name", name}, {"bytes", 1}}}}};
    const HttpResponse refused = PostJson("/v1/uploads", body);
    EXPECT_EQ(refused.status, 400) << name;
    EXPECT_THAT(refused.body, HasSubstr("/files/0/name")) << refused.body;
  }
  const std::string not_utf8 = "{\"name\":\"wall\",\"files\":[{\"name\":\"\xFF\",\"bytes\":1}]}";
  EXPECT_EQ(Send("POST", "/v1/uploads", {{"Content-Type", "application/json"}}, not_utf8).status,
            400);
  const auto of = [&](const Json& files) {
    return PostJson("/v1/uploads", {{"name", "wall"}, {"files", files}}).status;
  };
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", 1}}, {{"name", "a"}, {"bytes", 1}}}), 400);
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", 1}}, {{"name", "a/b"}, {"bytes", 1}}}), 400);
  EXPECT_EQ(of(Json::array()), 400);
  EXPECT_EQ(of("x"), 400);
  EXPECT_EQ(of({"x"}), 400);
  EXPECT_EQ(of({{{"name", "a"}}}), 400);
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", -1}}}), 400);
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", 1}, {"mode", "0777"}}}), 400);
  EXPECT_EQ(FoldersOfUploads(), 0u);
}

TEST_F(DashboardTest, LimitsUploads) {
  const auto of = [&](const Json& files) {
    return PostJson("/v1/uploads", {{"name", "wall"}, {"files", files}}).status;
  };
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", 1001}}}), 400);
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", 600}}, {{"name", "b"}, {"bytes", 600}}}), 400);
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", int64_t{1} << 41}}}), 400);
  Json many = Json::array();
  for (int i = 0; i < 501; ++i) many.push_back({{"name", "f" + std::to_string(i)}, {"bytes", 1}});
  EXPECT_EQ(of(many), 400);
  for (size_t i = 0; i < options_.uploads.max_open; ++i)
    BeginUpload({{{"name", "a"}, {"bytes", 1}}});
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", 1}}}), 507);
  options_.uploads.keep_free_bytes = uint64_t{1} << 60;
  Begin();
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", 1}}}), 507);
  options_.uploads.folder.clear();
  Begin();
  EXPECT_EQ(of({{{"name", "a"}, {"bytes", 1}}}), 409);
}

TEST_F(DashboardTest, WantsTheRightTypesOfBodies) {
  EXPECT_EQ(Send("POST", "/v1/uploads", {}, "{}").status, 415);
  const std::string id = BeginUpload({{{"name", "a"}, {"bytes", 1}}});
  EXPECT_EQ(
      Send("POST", "/v1/uploads/" + id + "/files/a", {{"Content-Type", "application/json"}}, "x")
          .status,
      415);
  EXPECT_EQ(Send("GET", "/v1/uploads/" + id + "/files/a").status, 405);
  EXPECT_EQ(Send("GET", "/v1/uploads").status, 405);
  EXPECT_EQ(Piece(id, "a", "x", "-1").status, 400);
  EXPECT_EQ(Piece("../" + id, "a", "x").status, 404);
  EXPECT_EQ(PostJson("/v1/uploads/" + id + "/submit", {{"quality", "best"}}).status, 400);
  EXPECT_EQ(PostJson("/v1/uploads/" + id + "/submit", {{"out", "/tmp"}}).status, 400);
}

TEST_F(DashboardTest, SaysWhyNothingOfAnUploadCanBeBakedAndRemovesIt) {
  const std::string id = BeginUpload({{{"name", "notes.txt"}, {"bytes", 2}}});
  ASSERT_EQ(Piece(id, "notes.txt", "hi").status, 200);
  const HttpResponse refused = PostJson("/v1/uploads/" + id + "/submit", Json::object());
  EXPECT_EQ(refused.status, 400);
  EXPECT_THAT(refused.body, HasSubstr("nothing to bake"));
  EXPECT_TRUE(service_.submitted.empty());
  EXPECT_EQ(FoldersOfUploads(), 0u);
}

TEST_F(DashboardTest, RemovesUploadsThatNobodyNeeds) {
  const std::string id = BeginUpload({{{"name", "a"}, {"bytes", 1}}});
  EXPECT_EQ(FoldersOfUploads(), 1u);
  EXPECT_EQ(PostJson("/v1/uploads/" + id + "/drop", Json::object()).status, 200);
  EXPECT_EQ(PostJson("/v1/uploads/" + id + "/drop", Json::object()).status, 404);
  EXPECT_EQ(FoldersOfUploads(), 0u);

  Uploads uploads(options_.uploads);
  const auto begin = Uploads::Clock::now();
  const auto nobody = [](int64_t) { return false; };
  const auto knows_7 = [](int64_t job) { return job == 7; };
  uploads.CleanUp(nobody, begin);
  const std::string left = *uploads.Begin("wall", {{"a", 1}}, begin);
  const std::string done = *uploads.Begin("floor", {{"a", 1}}, begin);
  ASSERT_OK(uploads.Write(done, "a", 0, "x", begin));
  ASSERT_OK(uploads.Close(done));
  uploads.CleanUp(nobody, begin + seconds(4000));  // the jobs are being made; the other was left
  EXPECT_TRUE(fs::exists(options_.uploads.folder + "/" + done));
  EXPECT_FALSE(fs::exists(options_.uploads.folder + "/" + left));
  ASSERT_OK(uploads.NoteJobs(done, {5, 7}));
  uploads.CleanUp(knows_7, begin + seconds(8000));
  EXPECT_TRUE(fs::exists(options_.uploads.folder + "/" + done));
  uploads.CleanUp(nobody, begin + seconds(8001));  // looked a moment ago
  EXPECT_TRUE(fs::exists(options_.uploads.folder + "/" + done));
  uploads.CleanUp(nobody, begin + seconds(12000));
  EXPECT_FALSE(fs::exists(options_.uploads.folder + "/" + done));
}

TEST_F(DashboardTest, ShowsRevisionsAndNoOtherFolder) {
  const std::string asset = folder_ / "out/wall";
  for (const char* revision :
       {"r0001", "r0002", "r0010", "r10000", "rejected", ".staging-1-1", "r1x"}) {
    fs::create_directories(asset + "/" + revision);
    ASSERT_OK(WriteFileDurably(asset + "/" + revision + "/manifest.json", std::string_view("{}")));
  }
  fs::create_directories(asset + "/r0003");  // without a manifest
  fs::create_directory_symlink(asset + "/r0001", asset + "/r0004");
  fs::create_directory_symlink("r0002", asset + "/current");
  ASSERT_OK(WriteFileDurably(folder_ / "out/secret.json", std::string_view("{}")));
  service_.assets["wall"] = {"wall",  folder_ / "out",  "", "baked", "", 1,
                             "r0002", asset + "/r0002", 1};
  const Json listed = Json::parse(Send("GET", "/v1/assets/wall/revisions").body)["revisions"];
  std::vector<std::string> names;
  for (const Json& revision : listed) {
    names.push_back(revision["revision"]);
    EXPECT_EQ(revision["current"], revision["revision"] == "r0002");
    EXPECT_EQ(revision["bytes"], 2);
  }
  EXPECT_THAT(names, ::testing::ElementsAre("r10000", "r0010", "r0002", "r0001"));
  const std::string base = "/v1/assets/wall/revisions/";
  EXPECT_EQ(Send("GET", base + "r0001/files/manifest.json").file_bytes, 2u);
  for (const char* path :
       {"r0003/files/manifest.json", "r0004/files/manifest.json", "current/files/manifest.json",
        "rejected/files/manifest.json", "../files/secret.json", "../wall/r0001/files/manifest.json",
        "r0001/files/preview.png"})
    EXPECT_EQ(Send("GET", base + path).status, 404) << path;
  for (const char* path :
       {"r0001/files/../manifest.json", "r0001/files/../../secret.json",
        "r0001/files//manifest.json", "r0001/files/", "r0001/files/./manifest.json"})
    EXPECT_EQ(Send("GET", base + path).status, 400) << path;
  EXPECT_EQ(Send("GET", "/v1/assets/none/revisions").status, 404);
}

TEST_F(DashboardTest, ATicketOpensOneFileForAWhile) {
  fs::create_directories(folder_ / "c");
  ASSERT_OK(WriteFileDurably(folder_ / "c/report.html", std::string_view("<p>")));
  service_.assets["wall"] = {"wall", folder_.path(), "", "baked", "", 1, "r1", folder_ / "c", 1};
  const Headers local = {{"Host", "localhost"}};
  const std::string path = "/v1/assets/wall/files/report.html";
  const HttpResponse issued = PostJson("/v1/tickets", {{"path", path}});
  ASSERT_EQ(issued.status, 200);
  const std::string url = Json::parse(issued.body)["url"];
  ASSERT_EQ(url.substr(0, 8), "?ticket=");
  const std::string ticket = url.substr(8);
  const auto open = [&](const std::string& at, const Headers& query, const char* method = "GET") {
    return Send(method, at, local, "", query, true);
  };
  const HttpResponse report = open(path, {{"ticket", ticket}});
  EXPECT_EQ(report.status, 200);
  EXPECT_THAT(HeaderOf(report, "Content-Security-Policy"), HasSubstr("sandbox"));
  EXPECT_EQ(open("/v1/assets/wall/files/manifest.json", {{"ticket", ticket}}).status, 401);
  EXPECT_EQ(open("/v1/status", {{"ticket", ticket}}).status, 401);
  EXPECT_EQ(open(path, {{"ticket", ticket}}, "POST").status, 401);
  EXPECT_EQ(open(path, {{"ticket", ticket + "0"}}).status, 401);
  EXPECT_EQ(open(path, {{"ticket", ""}}).status, 401);
  EXPECT_EQ(open(path, {}).status, 401);
  for (const char* other : {"/v1/status", "/v1/assets", "/", ""})
    EXPECT_EQ(PostJson("/v1/tickets", {{"path", other}}).status, 400) << other;

  Tickets tickets;
  const auto now = Tickets::Clock::now();
  const std::string own = *tickets.Issue("/a", now);
  EXPECT_TRUE(tickets.Admits(own, "/a", now + seconds(299)));
  EXPECT_FALSE(tickets.Admits(own, "/b", now));
  EXPECT_FALSE(tickets.Admits(own, "/a", now + Tickets::kLifetime));
  EXPECT_NE(*tickets.Issue("/a", now), *tickets.Issue("/a", now));
}

}  // namespace
}  // namespace patina::daemon
