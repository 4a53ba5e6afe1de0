// Checks what a daemon left behind, knowing nothing of it but its formats: the queue's file, the
// containers, the jobs' folders.
//
// usage: daemon_checker STATE_DIR OUT_DIR REFERENCE_DIR ACKNOWLEDGED
//   REFERENCE_DIR   output of an undisturbed run of the same jobs
//   ACKNOWLEDGED    file with the id and asset of each job that was acknowledged, one a line
// Prints one line for each thing that is wrong, and exits with 1 if there is any.
#include <sqlite3.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "formats/container.h"

namespace {

namespace fs = std::filesystem;
int problems = 0;

void Complain(const std::string& what) {
  std::printf("%s\n", what.c_str());
  ++problems;
}

using Row = std::vector<std::string>;

std::vector<Row> Query(sqlite3* database, const std::string& sql) {
  std::vector<Row> rows;
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(database, sql.c_str(), -1, &statement, nullptr) != SQLITE_OK) {
    Complain(sql + ": " + sqlite3_errmsg(database));
    return rows;
  }
  while (sqlite3_step(statement) == SQLITE_ROW) {
    Row row;
    for (int i = 0; i < sqlite3_column_count(statement); ++i) {
      const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement, i));
      row.emplace_back(text != nullptr ? text : "");
    }
    rows.push_back(std::move(row));
  }
  sqlite3_finalize(statement);
  return rows;
}

std::string Content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void CheckQueue(sqlite3* database, const std::string& acknowledged) {
  const auto integrity = Query(database, "PRAGMA integrity_check");
  if (integrity.size() != 1 || integrity[0][0] != "ok") Complain("the queue's file is damaged");
  std::ifstream list(acknowledged);
  int count = 0;
  for (std::string id, asset; list >> id >> asset; ++count) {
    const auto job = Query(database, "SELECT asset, state FROM jobs WHERE id = " + id);
    if (job.empty()) {
      Complain("job " + id + " was acknowledged and is lost");
    } else if (job[0][0] != asset) {
      Complain("job " + id + " is of asset " + job[0][0] + " instead of " + asset);
    }
  }
  if (count == 0) Complain("nothing was acknowledged");
  for (const Row& job : Query(database, "SELECT id, state FROM jobs WHERE state != 3"))
    Complain("job " + job[0] + " is in state " + job[1] + " and did not succeed");

  // The events tell of every job one story: submitted once, each attempt started once and in order,
  // one success, nothing after it.
  std::map<std::string, std::string> last;
  std::map<std::string, int> attempts;
  for (const Row& event : Query(
           database, "SELECT job, type, json_extract(data, '$.attempt') FROM events ORDER BY id")) {
    const std::string& job = event[0];
    const std::string& type = event[1];
    if (last[job].empty() != (type == "submitted"))
      Complain("job " + job + ": " + type + " after " + last[job]);
    if (last[job] == "succeeded") Complain("job " + job + ": " + type + " after its success");
    if (type == "started" && std::stoi(event[2]) != ++attempts[job])
      Complain("job " + job + ": attempt " + event[2] + " started out of order");
    if (type == "started" && last[job] == "started")
      Complain("job " + job + ": attempt " + event[2] + " started beside another");
    last[job] = type;
  }
  for (const auto& [job, type] : last) {
    if (type != "succeeded") Complain("job " + job + ": the last event is " + type);
  }
}

void CheckContainers(const fs::path& out, const fs::path& reference) {
  std::set<std::string> assets;
  for (const auto& entry : fs::directory_iterator(reference))
    assets.insert(entry.path().filename().string());
  for (const auto& entry : fs::directory_iterator(out)) {
    if (assets.count(entry.path().filename().string()) == 0)
      Complain(entry.path().string() + " is no asset");
  }
  for (const std::string& asset : assets) {
    const auto container = patina::OpenContainer(out / asset / "current");
    if (!container) {
      Complain(container.error().message);
      continue;
    }
    std::set<std::string> revisions, expected;
    for (const auto& entry : fs::directory_iterator(out / asset)) {
      const std::string name = entry.path().filename().string();
      if (name[0] == 'r') revisions.insert(name);
      if (name[0] != 'r' && name != "current" && name != ".lock")
        Complain(entry.path().string() + " was left behind");
    }
    for (const auto& entry : fs::directory_iterator(reference / asset)) {
      const std::string name = entry.path().filename().string();
      if (name[0] == 'r') expected.insert(name);
    }
    if (revisions != expected) {
      Complain(asset + ": " + std::to_string(revisions.size()) + " revisions instead of " +
               std::to_string(expected.size()));
    }
    for (const std::string& revision : revisions) {
      const auto whole = patina::OpenContainer(out / asset / revision);
      const auto verified = whole ? patina::VerifyPayloads(*whole) : patina::Status();
      if (!whole) Complain(whole.error().message);
      if (!verified) Complain(verified.error().message);
      if (expected.count(revision) == 0) continue;
      for (const auto& file : fs::directory_iterator(reference / asset / revision)) {
        const std::string name = file.path().filename().string();
        if (name == "run.json" || name == "report.html") continue;  // times stand there
        if (Content(file.path()) != Content(out / asset / revision / name))
          Complain(asset + "/" + revision + "/" + name + " differs from an undisturbed run");
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: daemon_checker STATE_DIR OUT_DIR REFERENCE_DIR ACKNOWLEDGED\n");
    return 2;
  }
  sqlite3* database = nullptr;
  const std::string queue = std::string(argv[1]) + "/queue.db";
  if (sqlite3_open_v2(queue.c_str(), &database, SQLITE_OPEN_READWRITE, nullptr) != SQLITE_OK)
    Complain(queue + ": " + sqlite3_errmsg(database));
  CheckQueue(database, argv[4]);
  sqlite3_close(database);
  CheckContainers(argv[2], argv[3]);
  return problems == 0 ? 0 : 1;
}
