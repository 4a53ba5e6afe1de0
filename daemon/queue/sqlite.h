// SQLite as far as the queue needs it: errors as Status, statements and transactions that clean up
// after themselves.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "formats/base/result.h"

struct sqlite3;
struct sqlite3_stmt;

namespace patina::daemon {

// A statement with its values. Text is copied. The database must outlive it.
class Statement {
 public:
  Statement(Statement&& other) noexcept;
  Statement& operator=(Statement&&) = delete;
  ~Statement();

  // Values for ?1, ?2 ... in order.
  Statement& Bind(int64_t value);
  Statement& Bind(std::string_view text);
  Statement& BindNull();

  // True: there is a row, whose columns can be read until the next call. False: done.
  Result<bool> Step();
  int64_t Int(int column) const;
  std::string Text(int column) const;  // of NULL: ""

 private:
  friend class Database;
  Statement(sqlite3_stmt* statement, const std::string* path)
      : statement_(statement), path_(path) {}
  sqlite3_stmt* statement_;
  const std::string* path_;
  int bound_ = 0;
};

class Database {
 public:
  // Opens or creates a file: WAL, synchronous=FULL. Errors: kIo, kResourceExhausted, kCorruptData;
  // they name the file.
  static Result<std::unique_ptr<Database>> Open(const std::string& path);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  // Errors also: kCorruptData, a table or column is missing.
  Result<Statement> Prepare(const char* sql);
  // Any number of statements without values.
  Status Execute(const char* sql);
  // Of a statement without rows, or whose rows do not matter.
  Status Run(Statement& statement);
  int64_t LastInsertId() const;
  int64_t ChangedRows() const;

 private:
  Database(sqlite3* database, std::string path) : database_(database), path_(std::move(path)) {}
  sqlite3* database_;
  std::string path_;
};

// Rolled back unless committed.
class Transaction {
 public:
  static Result<Transaction> Begin(Database& database);
  Transaction(Transaction&& other) noexcept;
  Transaction& operator=(Transaction&&) = delete;
  ~Transaction();
  Status Commit();

 private:
  explicit Transaction(Database* database) : database_(database) {}
  Database* database_;
};

}  // namespace patina::daemon
