#include "colmap_ext/database_file.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <system_error>

#include <sqlite3.h>

#include "core/output_file.h"
#include "core/partial_path.h"
#include "core/resource_limits.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr int kBusyMilliseconds = 3000;
constexpr int64_t kMuchMemory = int64_t{1} << 30;  // bytes; no database needs as much at once

// What the first 100 bytes of an SQLite file say (sqlite.org/fileformat.html, section 1.3).
struct SqliteHeader {
  bool uses_wal = false;
  uint64_t num_bytes = 0;  // 0 = not known
};

SqliteHeader ReadHeader(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  unsigned char header[100] = {};
  stream.read(reinterpret_cast<char*>(header), sizeof(header));
  if (stream.gcount() == 0)
    throw InputError(path, "", "is empty, expected a database", kDatabaseRemedy);
  if (stream.gcount() < static_cast<std::streamsize>(sizeof(header)) ||
      std::memcmp(header, "SQLite format 3", 16) != 0) {
    throw InputError(path, "byte 0", "is not an SQLite database", kDatabaseRemedy);
  }
  const auto big_endian = [&header](int first, int count) {
    uint64_t value = 0;
    for (int i = 0; i < count; ++i) value = value << 8 | header[first + i];
    return value;
  };
  SqliteHeader result;
  result.uses_wal = header[18] == 2 || header[19] == 2;
  const uint64_t page_size = big_endian(16, 2) == 1 ? 65536 : big_endian(16, 2);
  const bool size_is_valid = big_endian(24, 4) == big_endian(92, 4);
  if (size_is_valid) result.num_bytes = page_size * big_endian(28, 4);
  return result;
}

// file: address with the characters that mean something in it escaped.
std::string SqliteUri(const std::string& path, const std::string& query) {
  std::string uri = "file:";
  for (const char c : fs::absolute(path).string()) {
    if (c == '%' || c == '?' || c == '#') {
      const char* digits = "0123456789ABCDEF";
      uri += std::string("%") + digits[c >> 4] + digits[c & 15];
    } else {
      uri += c;
    }
  }
  return uri + "?" + query;
}

// A database of somebody else's is data: its schema may hold expressions, views and triggers, and
// none of them is run. What we ask reads stored columns of COLMAP's tables and counts rows.
int Authorize(void*, int action, const char* first, const char* second, const char*, const char*) {
  const std::string what = first == nullptr ? "" : first;
  switch (action) {
    case SQLITE_SELECT:
      return SQLITE_OK;
    case SQLITE_READ:
      return KnownTables().count(what) > 0 || what == "sqlite_master" || what == "sqlite_schema"
                 ? SQLITE_OK
                 : SQLITE_DENY;
    case SQLITE_FUNCTION:
      return second != nullptr && std::strcmp(second, "count") == 0 ? SQLITE_OK : SQLITE_DENY;
    case SQLITE_PRAGMA:
      return what == "table_info" || (what == "user_version" && second == nullptr) ? SQLITE_OK
                                                                                   : SQLITE_DENY;
    default:
      return SQLITE_DENY;
  }
}

// Steps of SQLite's machine from one row to the next; a row of a table takes some dozens.
constexpr int64_t kMaxStepsPerRow = 500'000'000;
constexpr int kStepsPerLook = 100'000;

int LookAtWork(void* steps) {
  auto* const count = static_cast<int64_t*>(steps);
  *count += kStepsPerLook;
  return *count > kMaxStepsPerRow ? 1 : 0;
}

void Distrust(sqlite3* handle, int64_t* steps) {
  sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  sqlite3_set_authorizer(handle, Authorize, nullptr);
  sqlite3_progress_handler(handle, kStepsPerLook, LookAtWork, steps);
}

}  // namespace

// A copy of the database and its WAL in a folder of its own, removed at the end.
class DatabaseFile::TemporaryCopy {
 public:
  explicit TemporaryCopy(const std::string& path) try
      : folder_(fs::temp_directory_path().string()) {
    std::error_code error;
    fs::copy_file(path, database(), error);
    if (!error) fs::copy_file(path + "-wal", database() + "-wal", error);
    if (!error) return;
    throw InputError(path, "", "cannot be copied with its WAL file (" + error.message() + ")",
                     "Set TMPDIR to a folder with space for the database");
  } catch (const std::system_error&) {
    throw InputError(path, "", "has a WAL file beside it that needs a copy, but none can be made",
                     "Set TMPDIR to a folder that may be written");
  }

  std::string database() const { return folder_ / "database.db"; }

 private:
  PartialFolder folder_;
};

// All tables that COLMAP has had since 3.7.
const std::set<std::string>& KnownTables() {
  static const std::set<std::string> tables = {
      "cameras",     "images",      "keypoints", "descriptors", "matches", "two_view_geometries",
      "pose_priors", "rig_sensors", "rigs",      "frame_data",  "frames"};
  return tables;
}

// An ordinary table, neither a view nor the table of a module.
bool HasTable(const SQLite::Database& sqlite, const std::string& table) {
  SQLite::Statement statement(
      sqlite, "SELECT rootpage FROM sqlite_master WHERE type = 'table' AND name = ?");
  statement.bind(1, table);
  return statement.executeStep() && statement.getColumn(0).getInt() > 0;
}

std::vector<TableColumn> ColumnsOf(const SQLite::Database& sqlite, const std::string& table) {
  std::vector<TableColumn> columns;
  SQLite::Statement statement(sqlite, "PRAGMA table_info(\"" + table + "\")");
  while (statement.executeStep()) {
    columns.push_back({statement.getColumn(1).getString(), statement.getColumn(2).getString(),
                       statement.getColumn(3).getInt() != 0, statement.getColumn(5).getInt()});
  }
  return columns;
}

// What SQLite's result code means to the user.
InputError DatabaseFile::ErrorFromSqlite(const SQLite::Exception& error) const {
  const std::string said = std::string(" (SQLite: ") + error.what() + ")";
  switch (error.getErrorCode()) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return InputError(path_, "", "is being written by another program",
                        "Wait until COLMAP has finished");
    case SQLITE_NOTADB:
      return InputError(path_, "", "is not an SQLite database", kDatabaseRemedy);
    case SQLITE_CORRUPT:
      return InputError(path_, "", "is damaged or cut off" + said, kDatabaseRemedy);
    case SQLITE_READONLY:
      return InputError(path_, "", "was left half written by a program that was stopped" + said,
                        "Open it once with colmap or sqlite3, which restores it");
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_IOERR:
      return InputError(path_, "", "cannot be read" + said, "Check the rights of file and folder");
    case SQLITE_FULL:
      return InputError(path_, "", "cannot be copied: the disk is full", "Make space");
    case SQLITE_AUTH:
    case SQLITE_INTERRUPT:
      return InputError(path_, "",
                        "holds programs (a view, a trigger or an expression) where COLMAP has "
                        "plain tables" +
                            said,
                        kDatabaseRemedy);
    case SQLITE_NOMEM:
      // SQLite says so of some damaged headers, too.
      if (AvailableMemory() > kMuchMemory) {
        return InputError(path_, "",
                          "is damaged: to read it SQLite asks for more memory than there is",
                          kDatabaseRemedy);
      }
      throw std::bad_alloc();
    default:
      return InputError(path_, "", "cannot be read as COLMAP's database" + said, kDatabaseRemedy);
  }
}

DatabaseFile::DatabaseFile(const std::string& path) : path_(path) { Open(); }

DatabaseFile::~DatabaseFile() = default;

// A database in WAL mode whose WAL is empty is whole in itself: `immutable` reads it without
// leaving -shm and -wal files beside it, and in a folder that may not be written. With rows in the
// WAL, SQLite needs the -shm file; where that is missing it would make one, so a copy is read
// instead.
void DatabaseFile::Open() {
  RequireFile(path_, "Check --database_path: it is COLMAP's database.db");
  const SqliteHeader header = ReadHeader(path_);
  std::error_code error;
  const uintmax_t wal_bytes = fs::file_size(path_ + "-wal", error);
  const bool has_wal = header.uses_wal && !error && wal_bytes > 0;
  const uint64_t num_bytes = fs::file_size(path_);
  if (!has_wal && num_bytes < header.num_bytes) {
    throw InputError(
        path_, BytePosition(static_cast<long long>(num_bytes)),
        "is cut off: its header promises " + std::to_string(header.num_bytes) + " bytes",
        kDatabaseRemedy);
  }
  if (has_wal && !fs::exists(path_ + "-shm", error)) copy_ = std::make_unique<TemporaryCopy>(path_);
  const bool immutable = header.uses_wal && !has_wal;
  const auto open = [&](const std::string& file, const char* query) {
    sqlite_ = std::make_unique<SQLite::Database>(
        SqliteUri(file, query), SQLite::OPEN_READONLY | SQLite::OPEN_URI, kBusyMilliseconds);
    sqlite_->exec("PRAGMA cell_size_check = ON");
    Distrust(sqlite_->getHandle(), &steps_);
    sqlite_->execAndGet("SELECT COUNT(*) FROM sqlite_master");
  };
  Guarded([&] {
    try {
      open(copy_ ? copy_->database() : path_, immutable ? "mode=ro&immutable=1" : "mode=ro");
    } catch (const SQLite::Exception& failure) {
      if (failure.getErrorCode() != SQLITE_CANTOPEN || !has_wal || copy_) throw;
      copy_ = std::make_unique<TemporaryCopy>(path_);
      open(copy_->database(), "mode=ro");
    }
  });
}

void DatabaseFile::RequireColumns(const char* table,
                                  const std::vector<std::string>& columns) const {
  std::vector<TableColumn> present;
  Guarded([&] {
    if (!HasTable(*sqlite_, table)) {
      throw InputError(
          path_, "",
          std::string("is an SQLite database, but not COLMAP's: it has no table ") + table,
          kDatabaseRemedy);
    }
    present = ColumnsOf(*sqlite_, table);
  });
  for (const std::string& column : columns) {
    const auto has_name = [&](const TableColumn& other) { return other.name == column; };
    if (std::any_of(present.begin(), present.end(), has_name)) continue;
    throw InputError(path_, std::string("table ") + table,
                     "is not COLMAP's: it has no column " + column, kDatabaseRemedy);
  }
}

}  // namespace roomtex
