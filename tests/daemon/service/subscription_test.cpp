#include <thread>

#include "tests/daemon/service/service_support.h"

namespace patina::daemon {
namespace {

using Next = Subscription::Next;
using std::chrono::milliseconds;
using SubscriptionTest = test::ServiceTest;

TEST_F(SubscriptionTest, BringsWhatHappensInOrder) {
  auto events = service_->Subscribe(std::nullopt, 0);
  ASSERT_OK(events);
  Event event;
  EXPECT_EQ((*events)->Wait(milliseconds(0), &event), Next::kTimeout);
  const int64_t id = Submit("wall");
  service_->Step();
  executor_.running[id].events = {R"({"type":"progress","stage":"train","fraction":0.5})"};
  service_->Step();
  for (const char* type : {"submitted", "started", "progress"}) {
    ASSERT_EQ((*events)->Wait(milliseconds(0), &event), Next::kEvent);
    EXPECT_EQ(event.type, type);
    EXPECT_EQ(event.job, id);
    EXPECT_EQ(event.id > 0, event.type != "progress");
  }
  EXPECT_NE(event.data.find("\"fraction\":0.5"), std::string::npos);
  EXPECT_EQ((*events)->Wait(milliseconds(0), &event), Next::kTimeout);
}

TEST_F(SubscriptionTest, GoesOnFromAnId) {
  Submit("a");
  Submit("b");
  Event event;
  auto events = service_->Subscribe(1, 0);
  ASSERT_EQ((*events)->Wait(milliseconds(0), &event), Next::kEvent);
  EXPECT_EQ(event.id, 2);
  EXPECT_EQ((*events)->Wait(milliseconds(0), &event), Next::kTimeout);
}

TEST_F(SubscriptionTest, SaysWhatIsNoLongerKept) {
  for (int i = 0; i < 10; ++i) Submit("a" + std::to_string(i));
  StoreRetention retention;
  retention.keep_finished = 100;
  retention.keep_events = 3;
  ASSERT_OK(store_->Prune(retention));
  Event event;
  for (const int64_t after : {int64_t{2}, int64_t{99}}) {
    auto events = service_->Subscribe(after, 0);
    EXPECT_EQ((*events)->Wait(milliseconds(0), &event), Next::kGap);
    EXPECT_EQ((*events)->Wait(milliseconds(0), &event), Next::kTimeout);
  }
  EXPECT_EQ(service_->GetMetrics()->subscriber_gaps, 2);
}

TEST_F(SubscriptionTest, OfOneJobLeavesOutTheOthersHoweverMany) {
  for (int i = 0; i < 600; ++i) Submit("a" + std::to_string(i));
  auto events = service_->Subscribe(0, 600);
  Event event;
  ASSERT_EQ((*events)->Wait(milliseconds(0), &event), Next::kEvent);
  EXPECT_EQ(event.job, 600);
  EXPECT_EQ((*events)->Wait(milliseconds(0), &event), Next::kTimeout);
}

TEST_F(SubscriptionTest, WaitsAndIsWoken) {
  auto events = service_->Subscribe(std::nullopt, 0);
  Event event;
  std::thread submitter([this] { Submit("wall"); });
  EXPECT_EQ((*events)->Wait(std::chrono::minutes(1), &event), Next::kEvent);
  submitter.join();
  EXPECT_EQ(event.type, "submitted");
}

TEST_F(SubscriptionTest, OutlivesTheServiceAndIsClosed) {
  auto events = service_->Subscribe(std::nullopt, 0);
  EXPECT_EQ(service_->GetMetrics()->subscribers, 1);
  service_.reset();
  store_.reset();
  Event event;
  EXPECT_EQ((*events)->Wait(std::chrono::minutes(1), &event), Next::kClosed);
}

}  // namespace
}  // namespace patina::daemon
