#pragma once
// The file behind COLMAP's database.db, read as data: its schema may hold expressions, views and
// triggers of somebody else's, and none of them is run (docs/reliability.md).

#include <cstdint>
#include <cstring>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>

#include "core/error.h"

namespace roomtex {

inline constexpr uint64_t kMaxNumImages = 2147483647;  // COLMAP's Database::kMaxNumImages
inline constexpr char kDatabaseRemedy[] =
    "Give the database.db that COLMAP wrote, or make it again with colmap feature_extractor";

// All tables that COLMAP has had since 3.7.
const std::set<std::string>& KnownTables();

// An ordinary table, neither a view nor the table of a module.
bool HasTable(const SQLite::Database& sqlite, const std::string& table);

struct TableColumn {
  std::string name, type;
  bool not_null = false;
  int key = 0;  // place in the primary key, from 1; 0 = no part of it
};

std::vector<TableColumn> ColumnsOf(const SQLite::Database& sqlite, const std::string& table);

// Values of the current row of a statement; an InputError that names the row where they are not
// what COLMAP writes.
class DatabaseRow {
 public:
  DatabaseRow(const std::string& path, const char* table, SQLite::Statement& statement)
      : path_(path), table_(table), statement_(statement) {}

  // Named after its first column, the key.
  std::string Position() const {
    return std::string("table ") + table_ + ", " + statement_.getColumnName(0) + " " +
           statement_.getColumn(0).getString();
  }
  [[noreturn]] void Fail(const std::string& finding) const {
    throw InputError(path_, Position(), finding, kDatabaseRemedy);
  }

  int64_t Integer(int column, int64_t least, int64_t largest) const {
    const SQLite::Column value = statement_.getColumn(column);
    if (!value.isInteger() || value.getInt64() < least || value.getInt64() > largest) {
      Fail(std::string(statement_.getColumnName(column)) + " is " +
           (value.isBlob() ? "a blob" : "\"" + value.getString().substr(0, 40) + "\"") +
           ", expected a whole number from " + std::to_string(least) + " to " +
           std::to_string(largest));
    }
    return value.getInt64();
  }
  uint32_t Id(int column) const {
    return static_cast<uint32_t>(Integer(column, 0, static_cast<int64_t>(kMaxNumImages)));
  }
  std::string Text(int column) const {
    const SQLite::Column value = statement_.getColumn(column);
    if (!value.isText() || value.getBytes() == 0) {
      Fail(std::string(statement_.getColumnName(column)) + " is not a text");
    }
    return value.getString();
  }

  // A blob of rows x columns numbers of type T, in row order; NULL counts as no bytes.
  template <typename T>
  std::vector<T> Blob(int column, int64_t num_rows, int64_t num_columns) const {
    const SQLite::Column value = statement_.getColumn(column);
    const size_t num_bytes = value.isNull() ? 0 : static_cast<size_t>(value.getBytes());
    const size_t expected = static_cast<size_t>(num_rows) * static_cast<size_t>(num_columns);
    if ((!value.isNull() && !value.isBlob()) || num_bytes != expected * sizeof(T)) {
      Fail(std::string(statement_.getColumnName(column)) + " holds " + std::to_string(num_bytes) +
           " bytes, expected " + std::to_string(expected * sizeof(T)) + " for " +
           std::to_string(num_rows) + " x " + std::to_string(num_columns) + " values");
    }
    std::vector<T> values(expected);
    if (expected > 0) std::memcpy(values.data(), value.getBlob(), num_bytes);
    return values;
  }

 private:
  const std::string& path_;
  const char* table_;
  SQLite::Statement& statement_;
};

// Open from construction to destruction, read only: also in a folder that may not be written and
// with a WAL file beside it, whose rows are seen; the file and its WAL stay as they are. Throws
// InputError: missing, not SQLite, truncated.
class DatabaseFile {
 public:
  explicit DatabaseFile(const std::string& path);
  ~DatabaseFile();

  const std::string& path() const { return path_; }
  const SQLite::Database& sqlite() const { return *sqlite_; }

  // Throws InputError if the table or one of these columns is not there.
  void RequireColumns(const char* table, const std::vector<std::string>& columns) const;

  // What `read` returns, SQLite's errors told as InputErrors.
  template <typename Read>
  auto Guarded(const Read& read) const {
    try {
      return read();
    } catch (const SQLite::Exception& error) {
      throw ErrorFromSqlite(error);
    }
  }

  // Calls use(row) for every row of `query`; `table` is for messages.
  template <typename Use>
  void ForEachRow(const char* table, const std::string& query, const Use& use,
                  int64_t parameter = -1) const {
    Guarded([&] {
      SQLite::Statement statement(*sqlite_, query);
      if (statement.getBindParameterCount() > 0) statement.bind(1, parameter);
      const DatabaseRow row(path_, table, statement);
      RowIsRead();
      while (statement.executeStep()) {
        use(row);
        RowIsRead();
      }
    });
  }

  // To be called after every row of a statement on sqlite(): one that works much longer than a row
  // can take is ended.
  void RowIsRead() const { steps_ = 0; }

 private:
  class TemporaryCopy;

  InputError ErrorFromSqlite(const SQLite::Exception& error) const;
  void Open();

  std::string path_;
  std::unique_ptr<TemporaryCopy> copy_;
  std::unique_ptr<SQLite::Database> sqlite_;
  mutable int64_t steps_ = 0;  // of SQLite's machine, since the last row
};

}  // namespace roomtex
