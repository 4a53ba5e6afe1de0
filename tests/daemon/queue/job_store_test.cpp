#include "daemon/queue/job_store.h"

#include <sqlite3.h>

#include <fstream>

#include "tests/daemon/queue/queue_support.h"

namespace patina::daemon {
namespace {

using patina::test::MessageOf;
using test::QueueTest;
using test::SampleJob;
using JobStoreTest = QueueTest;

std::vector<int64_t> Ids(const std::vector<JobRecord>& jobs) {
  std::vector<int64_t> ids;
  for (const JobRecord& job : jobs) ids.push_back(job.id);
  return ids;
}

TEST_F(JobStoreTest, KeepsEveryFieldOfAJob) {
  NewJob job = SampleJob("wall");
  job.kind = "brdf";
  job.origin = JobOrigin::kWatch;
  job.priority = -7;
  job.limits = {3, 512, 60, 90};
  job.force = true;
  job.signature = "abc";
  job.idempotency_key = "key";
  const int64_t id = Add(job);
  Reopen();
  const auto kept = store_->Get(id);
  ASSERT_OK(kept);
  EXPECT_EQ(kept->asset, "wall");
  EXPECT_EQ(kept->kind, "brdf");
  EXPECT_EQ(kept->out, "/out");
  EXPECT_EQ(kept->origin, JobOrigin::kWatch);
  EXPECT_EQ(kept->state, JobState::kQueued);
  EXPECT_EQ(kept->priority, -7);
  EXPECT_EQ(kept->limits.threads, 3);
  EXPECT_EQ(kept->limits.memory_mb, 512);
  EXPECT_EQ(kept->limits.cpu_s, 60);
  EXPECT_EQ(kept->limits.wall_s, 90);
  EXPECT_TRUE(kept->force);
  EXPECT_EQ(kept->signature, "abc");
  EXPECT_EQ(kept->job_json, job.job_json);
  EXPECT_EQ(kept->created_ms, now_);
  EXPECT_EQ(kept->attempt, 0);
}

TEST_F(JobStoreTest, KeepsWhatBecameOfAnAttempt) {
  const AttemptKey key = Run(Add("wall"));
  ASSERT_OK(store_->SetHandle(key, "pid:7"));
  EXPECT_EQ(store_->Get(key.job)->handle, "pid:7");
  AttemptEnd end;
  end.state = JobState::kSucceeded;
  end.exit_code = 0;
  end.revision = "r0002";
  end.container = "/out/wall/r0002";
  end.result_json = "{}";
  now_ += 5;
  ASSERT_OK(store_->Finish(key, end, now_));
  Reopen();
  const auto job = store_->Get(key.job);
  ASSERT_OK(job);
  EXPECT_EQ(job->state, JobState::kSucceeded);
  EXPECT_EQ(job->revision, "r0002");
  EXPECT_EQ(job->container, "/out/wall/r0002");
  EXPECT_EQ(job->result_json, "{}");
  EXPECT_EQ(job->finished_ms, now_);
  EXPECT_EQ(job->handle, "");
  EXPECT_EQ(job->lease_ms, 0);
  EXPECT_EQ(job->base_revision, "r0001");
}

TEST_F(JobStoreTest, NumbersAttemptsAndHearsOnlyTheCurrentOne) {
  const int64_t id = Add("wall");
  const AttemptKey first = Run(id);
  ASSERT_OK(End(first, JobState::kRetryWaiting));
  now_ += 1000;
  ASSERT_OK(store_->WakeDue(now_));
  const AttemptKey second = Run(id);
  EXPECT_EQ(first.attempt, 1);
  EXPECT_EQ(second.attempt, 2);
  // The first comes back from the dead.
  EXPECT_EQ(End(first, JobState::kSucceeded).error().code, ErrorCode::kConflict);
  EXPECT_EQ(store_->SetHandle(first, "x").error().code, ErrorCode::kConflict);
  EXPECT_EQ(store_->Heartbeat({first}, now_).error().code, ErrorCode::kConflict);
  EXPECT_EQ(StateOf(id), JobState::kRunning);
  ASSERT_OK(store_->Heartbeat({second}, now_ + 7));
  EXPECT_EQ(store_->Get(id)->lease_ms, now_ + 7);
  ASSERT_OK(End(second, JobState::kSucceeded));
  EXPECT_EQ(End(second, JobState::kSucceeded).error().code, ErrorCode::kConflict);
  EXPECT_EQ(store_->Get(id)->failures, 1);
}

TEST_F(JobStoreTest, ForgetsTheWholeHeartbeatOfAStaleAttempt) {
  const AttemptKey good = Run(Add("a"));
  const int64_t before = store_->Get(good.job)->lease_ms;
  EXPECT_FALSE(store_->Heartbeat({good, {good.job, 99}}, now_ + 5000));
  EXPECT_EQ(store_->Get(good.job)->lease_ms, before);
}

TEST_F(JobStoreTest, HandingBackIsNoFailure) {
  const AttemptKey key = Run(Add("wall"));
  ASSERT_OK(End(key, JobState::kQueued));
  EXPECT_EQ(store_->Get(key.job)->failures, 0);
  EXPECT_EQ(Run(key.job).attempt, 2);
}

TEST_F(JobStoreTest, ACancelledJobIsNotTriedAgain) {
  for (const JobState end :
       {JobState::kRetryWaiting, JobState::kBuried, JobState::kQueued, JobState::kCancelled}) {
    const AttemptKey key = Run(Add("asset"));
    ASSERT_OK(store_->Cancel(key.job, now_));
    ASSERT_OK(End(key, end));
    EXPECT_EQ(StateOf(key.job), JobState::kCancelled) << JobStateName(end);
  }
  // What it did before it heard of it counts.
  const AttemptKey key = Run(Add("asset"));
  ASSERT_OK(store_->Cancel(key.job, now_));
  ASSERT_OK(End(key, JobState::kSucceeded));
  EXPECT_EQ(StateOf(key.job), JobState::kSucceeded);
}

TEST_F(JobStoreTest, RunsByPriorityThenAge) {
  NewJob low = SampleJob("low"), high = SampleJob("high");
  low.priority = -1;
  high.priority = 5;
  const int64_t a = Add("a"), l = Add(low), b = Add("b"), h = Add(high);
  EXPECT_EQ(Ids(*store_->Runnable(10)), (std::vector<int64_t>{h, a, b, l}));
  EXPECT_EQ(Ids(*store_->Runnable(2)), (std::vector<int64_t>{h, a}));
  ASSERT_OK(store_->SetPriority(l, 9, now_));
  EXPECT_EQ(Ids(*store_->Runnable(1)), (std::vector<int64_t>{l}));
  EXPECT_EQ(store_->SetPriority(a, 101, now_).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(JobStoreTest, DoesNotOfferHeldJobsNorASecondOneOfAnAsset) {
  const int64_t first = Add("wall"), second = Add("wall"), held = Add("held");
  NewJob elsewhere = SampleJob("wall");
  elsewhere.out = "/other";
  const int64_t third = Add(elsewhere);
  ASSERT_OK(store_->SetHeld(held, true, now_));
  EXPECT_EQ(Ids(*store_->Runnable(10)), (std::vector<int64_t>{first, third}));
  const AttemptKey key = Run(first);
  EXPECT_EQ(Ids(*store_->Runnable(10)), (std::vector<int64_t>{third}));
  EXPECT_EQ(store_->Start(held, "", 0, now_).error().code, ErrorCode::kConflict);
  ASSERT_OK(End(key, JobState::kSucceeded));
  ASSERT_OK(store_->SetHeld(held, false, now_));
  EXPECT_EQ(Ids(*store_->Runnable(10)), (std::vector<int64_t>{second, held, third}));
}

TEST_F(JobStoreTest, WakesWhatIsDue) {
  const AttemptKey a = Run(Add("a")), b = Run(Add("b"));
  ASSERT_OK(End(a, JobState::kRetryWaiting));
  now_ += 50;
  ASSERT_OK(End(b, JobState::kRetryWaiting));
  EXPECT_EQ(**store_->NextDue(), now_ + 50);
  EXPECT_EQ(*store_->WakeDue(now_ + 49), 0);
  EXPECT_EQ(*store_->WakeDue(now_ + 50), 1);
  EXPECT_EQ(StateOf(a.job), JobState::kQueued);
  EXPECT_EQ(StateOf(b.job), JobState::kRetryWaiting);
  EXPECT_EQ(*store_->WakeDue(now_ + 1000), 1);
  EXPECT_FALSE(store_->NextDue()->has_value());
}

TEST_F(JobStoreTest, AnIdempotencyKeyMakesOneJob) {
  NewJob job = SampleJob("wall");
  job.idempotency_key = "k1";
  const auto first = store_->Submit(job, now_), again = store_->Submit(job, now_ + 1);
  ASSERT_OK(first);
  ASSERT_OK(again);
  EXPECT_TRUE(first->created);
  EXPECT_FALSE(again->created);
  EXPECT_EQ(again->id, first->id);
  job.priority = 1;
  EXPECT_EQ(store_->Submit(job, now_).error().code, ErrorCode::kConflict);
  job.idempotency_key = "k2";
  EXPECT_TRUE(store_->Submit(job, now_)->created);
}

TEST_F(JobStoreTest, ListsPagesFromTheNewest) {
  std::vector<int64_t> all;
  for (int i = 0; i < 25; ++i) all.insert(all.begin(), Add("a" + std::to_string(i)));
  JobFilter filter;
  filter.limit = 10;
  std::vector<int64_t> seen;
  int pages = 0;
  do {
    const auto page = store_->List(filter);
    ASSERT_OK(page);
    for (const int64_t id : Ids(page->jobs)) seen.push_back(id);
    filter.before = page->next;
    ++pages;
  } while (filter.before != 0);
  EXPECT_EQ(seen, all);
  EXPECT_EQ(pages, 3);
}

TEST_F(JobStoreTest, ListsByStatesAndAsset) {
  const int64_t queued = AddIn(JobState::kQueued), failed = AddIn(JobState::kFailed),
                buried = AddIn(JobState::kBuried);
  JobFilter filter;
  filter.states = {JobState::kFailed, JobState::kBuried, JobState::kFailed};
  EXPECT_EQ(Ids(store_->List(filter)->jobs), (std::vector<int64_t>{buried, failed}));
  filter.limit = 1;
  EXPECT_EQ(store_->List(filter)->next, buried);
  filter = {};
  filter.asset = store_->Get(queued)->asset;
  EXPECT_EQ(Ids(store_->List(filter)->jobs), (std::vector<int64_t>{queued}));
  const auto counts = store_->Counts();
  ASSERT_OK(counts);
  EXPECT_EQ(counts->of(JobState::kFailed), 1);
  EXPECT_EQ(counts->of(JobState::kRunning), 0);
}

TEST_F(JobStoreTest, TellsOfEverythingOnceAndInOrder) {
  const int64_t id = Add("wall");
  const AttemptKey key = Run(id);
  ASSERT_OK(End(key, JobState::kRetryWaiting));
  ASSERT_OK(store_->Retry(id, now_));
  ASSERT_OK(store_->SetQueuePaused(true, now_));
  ASSERT_OK(store_->SetQueuePaused(true, now_));
  ASSERT_OK(store_->Cancel(id, now_));
  const auto events = store_->EventsAfter(0, 100);
  ASSERT_OK(events);
  std::vector<std::string> types;
  for (const StoredEvent& event : *events) types.push_back(event.type);
  EXPECT_EQ(types, (std::vector<std::string>{"submitted", "started", "retry_waiting", "requeued",
                                             "queue_paused", "cancelled"}));
  EXPECT_EQ(store_->EventsAfter(events->at(3).id, 1)->at(0).type, "queue_paused");
  EXPECT_TRUE(*store_->QueuePaused());
}

TEST_F(JobStoreTest, KnowsTheLastJobOfAnAssetAndWhatTheWatcherSaid) {
  NewJob watched = SampleJob("wall");
  watched.origin = JobOrigin::kWatch;
  watched.signature = "s1";
  watched.failed_file = "/in/wall.failed.json";
  Add(watched);
  NewJob other = SampleJob("wall");
  other.source = "/elsewhere";
  const int64_t second = Add(other);
  const auto asset = store_->GetAsset("/out", "wall");
  ASSERT_OK(asset);
  EXPECT_EQ((*asset)->last_job, second);
  EXPECT_EQ((*asset)->signature, "s1");
  EXPECT_EQ((*asset)->source, "/in/wall");
  EXPECT_EQ((*asset)->failed_file, "/in/wall.failed.json");
  EXPECT_FALSE(store_->GetAsset("/out", "other")->has_value());
}

TEST_F(JobStoreTest, AWaitingJobTakesANewDescription) {
  NewJob job = SampleJob("wall");
  job.origin = JobOrigin::kWatch;
  const int64_t id = Add(job);
  job.signature = "s2";
  job.job_json = "{}";
  ASSERT_OK(store_->ReplaceWaiting(id, job, now_));
  EXPECT_EQ(store_->Get(id)->job_json, "{}");
  EXPECT_EQ((*store_->GetAsset("/out", "wall"))->signature, "s2");
  EXPECT_EQ((*store_->WaitingFor("/out", "wall"))->id, id);
  Run(id);
  EXPECT_FALSE(store_->WaitingFor("/out", "wall")->has_value());
  EXPECT_EQ(store_->ReplaceWaiting(id, job, now_).error().code, ErrorCode::kConflict);
}

TEST_F(JobStoreTest, KeepsTheNewestAndTheLastOfEachAsset) {
  std::vector<int64_t> ids;
  for (int i = 0; i < 6; ++i) {
    ids.push_back(Add("same"));
    ASSERT_OK(End(Run(ids.back()), JobState::kFailed));
  }
  const int64_t queued = Add("other");
  StoreRetention retention;
  retention.keep_finished = 2;
  EXPECT_EQ(*store_->Prune(retention), (std::vector<int64_t>(ids.begin(), ids.begin() + 4)));
  EXPECT_TRUE(store_->Prune(retention)->empty());
  retention.keep_finished = 100;
  retention.finished_before_ms = now_ + 1;
  EXPECT_EQ(*store_->Prune(retention), (std::vector<int64_t>{ids[4]}));
  EXPECT_TRUE(store_->Get(ids[5]));
  EXPECT_TRUE(store_->Get(queued));
}

TEST_F(JobStoreTest, ForgetsOldEventsAndSaysSo) {
  for (int i = 0; i < 20; ++i) Add("a" + std::to_string(i));
  StoreRetention retention;
  retention.keep_finished = 100;
  retention.keep_events = 5;
  ASSERT_OK(store_->Prune(retention));
  EXPECT_EQ(*store_->EventRange(), (std::pair<int64_t, int64_t>(16, 20)));
  Reopen();
  EXPECT_EQ(store_->EventsAfter(0, 100)->size(), 5u);
}

TEST_F(JobStoreTest, NamesOfAnyBytesAreKept) {
  NewJob job = SampleJob("x");
  job.source = std::string("/in/\xff\x01' -- \n\0z", 15);
  Add(job);
  EXPECT_EQ((*store_->GetAsset("/out", "x"))->source, job.source);
}

TEST_F(JobStoreTest, UnknownJobsAreNotFound) {
  EXPECT_EQ(store_->Get(1).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->Cancel(1, 0).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->Retry(1, 0).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->Start(1, "", 0, 0).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->SetHeld(1, true, 0).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(End({1, 1}, JobState::kFailed).error().code, ErrorCode::kNotFound);
}

// ---- files that are not what they should be

void Execute(const std::string& path, const char* sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql, nullptr, nullptr, nullptr), SQLITE_OK)
      << sqlite3_errmsg(database);
  sqlite3_close(database);
}

TEST(JobStoreFile, RefusesAFutureVersion) {
  const patina::test::TemporaryDirectory folder;
  Execute(folder / "q", "PRAGMA user_version = 999");
  const auto store = JobStore::Open(folder / "q");
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(MessageOf(store).find("999"), std::string::npos);
}

TEST(JobStoreFile, RefusesWhatIsNoDatabase) {
  const patina::test::TemporaryDirectory folder;
  std::ofstream(folder / "q") << std::string(5000, 'x');
  const auto store = JobStore::Open(folder / "q");
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().code, ErrorCode::kCorruptData);
  EXPECT_NE(MessageOf(store).find(folder / "q"), std::string::npos);
}

TEST(JobStoreFile, RefusesOtherTablesAndRowsThatMakeNoSense) {
  const patina::test::TemporaryDirectory folder;
  Execute(folder / "other", "CREATE TABLE x (y); PRAGMA user_version = 1");
  auto store = JobStore::Open(folder / "other");
  ASSERT_OK(store);
  EXPECT_EQ((*store)->Get(1).error().code, ErrorCode::kCorruptData);

  store = JobStore::Open(folder / "rows");
  ASSERT_OK(store);
  ASSERT_OK((*store)->Submit(SampleJob("a"), 0));
  store->reset();
  Execute(folder / "rows", "UPDATE jobs SET threads = -5");
  store = JobStore::Open(folder / "rows");
  ASSERT_OK(store);
  EXPECT_EQ((*store)->Get(1).error().code, ErrorCode::kCorruptData);
  EXPECT_EQ((*store)->Runnable(5).error().code, ErrorCode::kCorruptData);
}

TEST(JobStoreFile, EveryTruncationIsAnErrorOrAnOlderState) {
  const patina::test::TemporaryDirectory folder;
  {
    auto store = JobStore::Open(folder / "q");
    ASSERT_OK(store);
    for (int i = 0; i < 50; ++i) ASSERT_OK((*store)->Submit(SampleJob("a"), 0));
  }
  std::ifstream file(folder / "q", std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  ASSERT_GT(bytes.size(), 20000u);
  for (size_t size = 0; size < bytes.size(); size += 997) {
    std::ofstream(folder / "cut", std::ios::binary) << bytes.substr(0, size);
    auto store = JobStore::Open(folder / "cut");
    // Must not crash; what it says depends on which pages are there.
    if (store) {
      (void)(*store)->List({});
      (void)(*store)->Counts();
      (void)(*store)->Submit(SampleJob("b"), 0);
    }
    store = Fail(ErrorCode::kIo, "");
    for (const char* suffix : {"", "-wal", "-shm"})
      std::filesystem::remove((folder / "cut") + suffix);
  }
}

}  // namespace
}  // namespace patina::daemon
