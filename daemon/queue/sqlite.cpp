#include "daemon/queue/sqlite.h"

#include <sqlite3.h>

#include <utility>

#include "formats/base/check.h"

namespace patina::daemon {
namespace {

tl::unexpected<Error> FailSqlite(sqlite3* database, int code, const std::string& path) {
  ErrorCode kind = ErrorCode::kIo;
  std::string remedy;
  switch (code & 0xFF) {
    case SQLITE_FULL:
      kind = ErrorCode::kResourceExhausted;
      remedy = "; free some space";
      break;
    case SQLITE_NOMEM:
      kind = ErrorCode::kResourceExhausted;
      break;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      kind = ErrorCode::kCorruptData;
      remedy = "; move it away, or restore it from a copy";
      break;
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      remedy = "; another program holds it: close that";
      break;
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
    case SQLITE_PERM:
      remedy = "; check the rights of the folder";
      break;
    default:
      break;
  }
  const std::string what = database != nullptr ? sqlite3_errmsg(database) : sqlite3_errstr(code);
  return Fail(kind, "the queue " + path + ": " + what + remedy);
}

constexpr int kBusyTimeoutMs = 5000;

}  // namespace

Statement::Statement(Statement&& other) noexcept
    : statement_(std::exchange(other.statement_, nullptr)),
      path_(other.path_),
      bound_(other.bound_) {}

Statement::~Statement() { sqlite3_finalize(statement_); }

Statement& Statement::Bind(int64_t value) {
  PATINA_CHECK(sqlite3_bind_int64(statement_, ++bound_, value) == SQLITE_OK);
  return *this;
}

Statement& Statement::Bind(std::string_view text) {
  const int code =
      sqlite3_bind_text64(statement_, ++bound_, text.data() != nullptr ? text.data() : "",
                          text.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
  PATINA_CHECK(code != SQLITE_RANGE && code != SQLITE_MISUSE);
  return *this;
}

Statement& Statement::BindNull() {
  PATINA_CHECK(sqlite3_bind_null(statement_, ++bound_) == SQLITE_OK);
  return *this;
}

Result<bool> Statement::Step() {
  const int code = sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return FailSqlite(sqlite3_db_handle(statement_), code, *path_);
}

int64_t Statement::Int(int column) const { return sqlite3_column_int64(statement_, column); }

std::string Statement::Text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
  if (text == nullptr) return "";
  return {text, static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
}

Result<std::unique_ptr<Database>> Database::Open(const std::string& path) {
  sqlite3* handle = nullptr;
  const int code =
      sqlite3_open_v2(path.c_str(), &handle,
                      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX, nullptr);
  std::unique_ptr<Database> database(new Database(handle, path));
  if (code != SQLITE_OK) return FailSqlite(handle, code, path);
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_timeout(handle, kBusyTimeoutMs);
  PATINA_TRY(database->Execute("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL;"));
  return database;
}

Database::~Database() { sqlite3_close(database_); }

Result<Statement> Database::Prepare(const char* sql) {
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v2(database_, sql, -1, &statement, nullptr);
  if (code == SQLITE_ERROR) {
    // The statements are ours: it is the file that does not have their tables.
    return Fail(ErrorCode::kCorruptData, "the queue " + path_ + ": " + sqlite3_errmsg(database_) +
                                             "; move it away, or restore it from a copy");
  }
  if (code != SQLITE_OK) return FailSqlite(database_, code, path_);
  return Statement(statement, &path_);
}

Status Database::Execute(const char* sql) {
  const int code = sqlite3_exec(database_, sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return FailSqlite(database_, code, path_);
  return {};
}

Status Database::Run(Statement& statement) {
  for (;;) {
    PATINA_ASSIGN(const bool row, statement.Step());
    if (!row) return {};
  }
}

int64_t Database::LastInsertId() const { return sqlite3_last_insert_rowid(database_); }

int64_t Database::ChangedRows() const { return sqlite3_changes64(database_); }

Result<Transaction> Transaction::Begin(Database& database) {
  PATINA_TRY(database.Execute("BEGIN IMMEDIATE"));
  return Transaction(&database);
}

Transaction::Transaction(Transaction&& other) noexcept
    : database_(std::exchange(other.database_, nullptr)) {}

Transaction::~Transaction() {
  // Fails, harmlessly, where an error has rolled back already.
  if (database_ != nullptr) (void)database_->Execute("ROLLBACK");
}

Status Transaction::Commit() {
  PATINA_TRY(database_->Execute("COMMIT"));
  database_ = nullptr;
  return {};
}

}  // namespace patina::daemon
