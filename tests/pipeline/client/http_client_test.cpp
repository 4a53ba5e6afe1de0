#include "pipeline/client/http_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/formats/test_support.h"
#include "tests/pipeline/client/canned_server.h"

namespace patina {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing_support::CannedServer;

Result<HttpAnswer> AnswerTo(const std::string& bytes) {
  test::TemporaryDirectory folder;
  CannedServer server(folder / "s", {bytes});
  CancelToken cancel;
  return HttpClient(folder / "s", cancel).Request("GET", "/");
}

TEST(HttpClient, ReadsAnswersOfKnownLength) {
  const auto answer = AnswerTo("HTTP/1.1 200 OK\r\nX-a:  b\r\ncontent-length: 5\r\n\r\nhellorest");
  ASSERT_OK(answer);
  EXPECT_EQ(answer->status, 200);
  EXPECT_EQ(answer->Header("x-A"), "b");
  EXPECT_EQ(answer->body, "hello");
}

TEST(HttpClient, ReadsAnswersInChunksAndToTheEnd) {
  auto answer = AnswerTo(
      "HTTP/1.1 200 OK\r\nTransfer-Encoding: "
      "chunked\r\n\r\n3\r\nabc\r\nA;x=1\r\n0123456789\r\n0\r\n\r\n");
  ASSERT_OK(answer);
  EXPECT_EQ(answer->body, "abc0123456789");
  answer = AnswerTo("HTTP/1.1 404 No\r\n\r\nto the end");
  ASSERT_OK(answer);
  EXPECT_EQ(answer->status, 404);
  EXPECT_EQ(answer->body, "to the end");
}

TEST(HttpClient, RefusesWhatIsNoAnswer) {
  for (const char* bytes :
       {"", "SSH-2.0-OpenSSH\r\n\r\n", "HTTP/1.1 200 OK\r\n",
        "HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhell",
        "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
        "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabcd\r\n",
        "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nFFFFFFFFFFFFFFFF\r\n",
        "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n"}) {
    const auto answer = AnswerTo(bytes);
    ASSERT_FALSE(answer) << bytes;
    EXPECT_EQ(answer.error().code, ErrorCode::kCorruptData) << bytes;
  }
}

TEST(HttpClient, SaysWhatToDoWhereNobodyListens) {
  test::TemporaryDirectory folder;
  CancelToken cancel;
  const auto missing = HttpClient(folder / "missing", cancel).Request("GET", "/");
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(missing.error().message, HasSubstr("start one with `patinad"));
  const auto too_long = HttpClient(std::string(200, 'x'), cancel).Request("GET", "/");
  EXPECT_EQ(too_long.error().code, ErrorCode::kInvalidArgument);
}

TEST(HttpClient, EndsWhenItIsCancelled) {
  test::TemporaryDirectory folder;
  // Accepts nobody: the connection stays in its queue.
  CannedServer server(folder / "s", {});
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_EQ(HttpClient(folder / "s", cancel).Request("GET", "/").error().code,
            ErrorCode::kCancelled);
}

TEST(EventParser, TakesEventsInPiecesOfAnySize) {
  const std::string stream =
      "retry: 2000\n\n: ping\n\nid: 7\nevent: started\ndata: {\"a\":1}\n\ndata:x\r\ndata: y\r\n\r\n"
      "id: 8\n\nevent: late\ndata: z\n\n";
  for (size_t piece = 1; piece <= stream.size(); ++piece) {
    EventParser parser;
    std::vector<std::string> got;
    for (size_t at = 0; at < stream.size(); at += piece) {
      ASSERT_TRUE(parser.Feed(stream.substr(at, piece), [&](const ServerEvent& event) {
        got.push_back(event.id + "|" + event.type + "|" + event.data);
        return true;
      }));
    }
    EXPECT_THAT(got, ElementsAre("7|started|{\"a\":1}", "|message|x\ny", "|late|z")) << piece;
  }
}

TEST(EventParser, StopsWhenNothingMoreIsWanted) {
  EventParser parser;
  int count = 0;
  parser.Feed("data: 1\n\ndata: 2\n\n", [&](const ServerEvent&) { return ++count == 99; });
  EXPECT_EQ(count, 1);
  EXPECT_TRUE(parser.stopped());
}

TEST(EventParser, RefusesALineWithoutEnd) {
  EventParser parser;
  const std::string piece(1 << 20, 'x');
  bool fits = true;
  for (int i = 0; i < 20 && fits; ++i)
    fits = parser.Feed(piece, [](const ServerEvent&) { return true; });
  EXPECT_FALSE(fits);
}

TEST(HttpClient, TurnsProblemsIntoErrors) {
  HttpAnswer answer;
  answer.status = 409;
  answer.body = R"({"detail": "it has ended"})";
  EXPECT_EQ(ErrorOfAnswer(answer).code, ErrorCode::kConflict);
  EXPECT_EQ(ErrorOfAnswer(answer).message, "it has ended");
  answer.body = "<html>";
  EXPECT_THAT(ErrorOfAnswer(answer).message, HasSubstr("status 409"));
}

}  // namespace
}  // namespace patina
