#include "colmap_ext/database.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numeric>
#include <set>
#include <system_error>
#include <tuple>

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>
#include <unistd.h>

#include "core/error.h"
#include "core/output_file.h"
#include "core/partial_path.h"
#include "core/text.h"

namespace roomtex {
namespace fs = std::filesystem;
namespace {

constexpr int kBusyMilliseconds = 3000;
constexpr uint64_t kMaxNumImages = 2147483647;  // COLMAP's Database::kMaxNumImages
constexpr char kDatabaseRemedy[] =
    "Give the database.db that COLMAP wrote, or make it again with colmap feature_extractor";

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

// A copy of the database and its WAL in a folder of its own, removed at the end.
class TemporaryCopy {
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

// What SQLite's result code means to the user.
InputError ErrorFromSqlite(const std::string& path, const SQLite::Exception& error) {
  const std::string said = std::string(" (SQLite: ") + error.what() + ")";
  switch (error.getErrorCode()) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return InputError(path, "", "is being written by another program",
                        "Wait until COLMAP has finished");
    case SQLITE_NOTADB:
      return InputError(path, "", "is not an SQLite database", kDatabaseRemedy);
    case SQLITE_CORRUPT:
      return InputError(path, "", "is damaged or cut off" + said, kDatabaseRemedy);
    case SQLITE_READONLY:
      return InputError(path, "", "was left half written by a program that was stopped" + said,
                        "Open it once with colmap or sqlite3, which restores it");
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_IOERR:
      return InputError(path, "", "cannot be read" + said, "Check the rights of file and folder");
    case SQLITE_FULL:
      return InputError(path, "", "cannot be copied: the disk is full", "Make space");
    case SQLITE_AUTH:
    case SQLITE_INTERRUPT:
      return InputError(path, "",
                        "holds programs (a view, a trigger or an expression) where COLMAP has "
                        "plain tables" +
                            said,
                        kDatabaseRemedy);
    case SQLITE_NOMEM:
      throw std::bad_alloc();
    default:
      return InputError(path, "", "cannot be read as COLMAP's database" + said, kDatabaseRemedy);
  }
}

// An ordinary table, neither a view nor the table of a module.
bool HasTable(const SQLite::Database& sqlite, const std::string& table) {
  SQLite::Statement statement(
      sqlite, "SELECT rootpage FROM sqlite_master WHERE type = 'table' AND name = ?");
  statement.bind(1, table);
  return statement.executeStep() && statement.getColumn(0).getInt() > 0;
}

struct TableColumn {
  std::string name, type;
  bool not_null = false;
  int key = 0;  // place in the primary key, from 1; 0 = no part of it
};

std::vector<TableColumn> ColumnsOf(const SQLite::Database& sqlite, const std::string& table) {
  std::vector<TableColumn> columns;
  SQLite::Statement statement(sqlite, "PRAGMA table_info(\"" + table + "\")");
  while (statement.executeStep()) {
    columns.push_back({statement.getColumn(1).getString(), statement.getColumn(2).getString(),
                       statement.getColumn(3).getInt() != 0, statement.getColumn(5).getInt()});
  }
  return columns;
}

// Values of the current row of a statement; an InputError that names the row where they are not
// what COLMAP writes.
class Row {
 public:
  Row(const std::string& path, const char* table, SQLite::Statement& statement)
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

// The images of a row whose first column is a pair id.
std::pair<uint32_t, uint32_t> PairOfRow(const Row& row) {
  const auto pair_id = static_cast<uint64_t>(row.Integer(0, 0, INT64_MAX));
  const std::pair<uint32_t, uint32_t> pair = ImagesFromPairId(pair_id);
  if (pair_id / kMaxNumImages >= kMaxNumImages || pair.first >= pair.second) {
    row.Fail("is not the id of a pair of two images");
  }
  return pair;
}

}  // namespace

uint64_t PairIdFromImages(uint32_t image_id1, uint32_t image_id2) {
  return kMaxNumImages * std::min(image_id1, image_id2) + std::max(image_id1, image_id2);
}

std::pair<uint32_t, uint32_t> ImagesFromPairId(uint64_t pair_id) {
  return {static_cast<uint32_t>(pair_id / kMaxNumImages),
          static_cast<uint32_t>(pair_id % kMaxNumImages)};
}

struct Database::Impl {
  std::string path;
  std::unique_ptr<TemporaryCopy> copy;
  std::unique_ptr<SQLite::Database> sqlite;
  mutable int64_t steps = 0;  // of SQLite's machine, since the last row

  // Runs `read` with SQLite's errors told as InputErrors.
  template <typename Read>
  auto Guarded(const Read& read) const {
    try {
      return read();
    } catch (const SQLite::Exception& error) {
      throw ErrorFromSqlite(path, error);
    }
  }

  // Calls use(row) for every row of `query`; `table` is for messages.
  template <typename Use>
  void ForEachRow(const char* table, const std::string& query, const Use& use,
                  int64_t parameter = -1) const {
    Guarded([&] {
      SQLite::Statement statement(*sqlite, query);
      if (statement.getBindParameterCount() > 0) statement.bind(1, parameter);
      const Row row(path, table, statement);
      steps = 0;
      while (statement.executeStep()) {
        use(row);
        steps = 0;
      }
    });
  }

  // Calls use(values, num_columns) for every keypoint of an image.
  void ForEachKeypoint(uint32_t image_id,
                       const std::function<void(const float*, int64_t)>& use) const;
  void Open();
  void RequireColumns(const char* table, const std::vector<std::string>& columns) const;
};

// A database in WAL mode whose WAL is empty is whole in itself: `immutable` reads it without
// leaving -shm and -wal files beside it, and in a folder that may not be written. With rows in the
// WAL, SQLite needs the -shm file; where that is missing it would make one, so a copy is read
// instead.
void Database::Impl::Open() {
  RequireFile(path, "Check --database_path: it is COLMAP's database.db");
  const SqliteHeader header = ReadHeader(path);
  std::error_code error;
  const uintmax_t wal_bytes = fs::file_size(path + "-wal", error);
  const bool has_wal = header.uses_wal && !error && wal_bytes > 0;
  const uint64_t num_bytes = fs::file_size(path);
  if (!has_wal && num_bytes < header.num_bytes) {
    throw InputError(
        path, BytePosition(static_cast<long long>(num_bytes)),
        "is cut off: its header promises " + std::to_string(header.num_bytes) + " bytes",
        kDatabaseRemedy);
  }
  if (has_wal && !fs::exists(path + "-shm", error)) copy = std::make_unique<TemporaryCopy>(path);
  const bool immutable = header.uses_wal && !has_wal;
  const auto open = [&](const std::string& file, const char* query) {
    sqlite = std::make_unique<SQLite::Database>(
        SqliteUri(file, query), SQLite::OPEN_READONLY | SQLite::OPEN_URI, kBusyMilliseconds);
    sqlite->exec("PRAGMA cell_size_check = ON");
    Distrust(sqlite->getHandle(), &steps);
    sqlite->execAndGet("SELECT COUNT(*) FROM sqlite_master");
  };
  Guarded([&] {
    try {
      open(copy ? copy->database() : path, immutable ? "mode=ro&immutable=1" : "mode=ro");
    } catch (const SQLite::Exception& failure) {
      if (failure.getErrorCode() != SQLITE_CANTOPEN || !has_wal || copy) throw;
      copy = std::make_unique<TemporaryCopy>(path);
      open(copy->database(), "mode=ro");
    }
  });
}

void Database::Impl::RequireColumns(const char* table,
                                    const std::vector<std::string>& columns) const {
  std::vector<TableColumn> present;
  Guarded([&] {
    if (!HasTable(*sqlite, table)) {
      throw InputError(
          path, "",
          std::string("is an SQLite database, but not COLMAP's: it has no table ") + table,
          kDatabaseRemedy);
    }
    present = ColumnsOf(*sqlite, table);
  });
  for (const std::string& column : columns) {
    const auto has_name = [&](const TableColumn& other) { return other.name == column; };
    if (std::any_of(present.begin(), present.end(), has_name)) continue;
    throw InputError(path, std::string("table ") + table,
                     "is not COLMAP's: it has no column " + column, kDatabaseRemedy);
  }
}

Database::Database(const std::string& path) : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  impl_->Open();
  impl_->RequireColumns("cameras",
                        {"camera_id", "model", "width", "height", "params", "prior_focal_length"});
  impl_->RequireColumns("images", {"image_id", "name", "camera_id"});
  impl_->RequireColumns("keypoints", {"image_id", "rows", "cols", "data"});
  impl_->RequireColumns("two_view_geometries", {"pair_id", "rows", "cols", "data", "config"});
}

Database::~Database() = default;

const std::string& Database::path() const { return impl_->path; }

std::map<uint32_t, Camera> Database::ReadCameras() const {
  std::map<uint32_t, Camera> cameras;
  impl_->ForEachRow(
      "cameras",
      "SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras "
      "ORDER BY camera_id",
      [&](const Row& row) {
        Camera camera;
        camera.camera_id = row.Id(0);
        camera.model = static_cast<CameraModel>(row.Integer(1, 0, kNumCameraModels - 1));
        camera.width = static_cast<int>(row.Integer(2, 1, INT32_MAX));
        camera.height = static_cast<int>(row.Integer(3, 1, INT32_MAX));
        camera.params = row.Blob<double>(4, NumCameraParams(static_cast<int>(camera.model)), 1);
        camera.has_prior_focal_length = row.Integer(5, INT32_MIN, INT32_MAX) != 0;
        const std::vector<std::string> problems = camera.Problems();
        if (!problems.empty()) row.Fail(problems[0]);
        cameras.emplace_hint(cameras.end(), camera.camera_id, std::move(camera));
      });
  return cameras;
}

std::map<uint32_t, DatabaseImage> Database::ReadImages() const {
  std::set<uint32_t> camera_ids;
  impl_->ForEachRow("cameras", "SELECT camera_id FROM cameras",
                    [&](const Row& row) { camera_ids.insert(row.Id(0)); });
  std::map<uint32_t, DatabaseImage> images;
  std::set<std::string> names;
  impl_->ForEachRow("images", "SELECT image_id, camera_id, name FROM images ORDER BY image_id",
                    [&](const Row& row) {
                      DatabaseImage image{row.Id(0), row.Id(1), row.Text(2)};
                      if (camera_ids.count(image.camera_id) == 0) {
                        row.Fail("names camera " + std::to_string(image.camera_id) +
                                 ", which the table cameras does not hold");
                      }
                      if (!names.insert(image.name).second)
                        row.Fail("has the name of another image");
                      images.emplace_hint(images.end(), image.image_id, std::move(image));
                    });
  return images;
}

std::map<uint32_t, size_t> Database::CountKeypoints() const {
  std::map<uint32_t, size_t> counts;
  impl_->ForEachRow("keypoints", "SELECT image_id, rows FROM keypoints ORDER BY image_id",
                    [&](const Row& row) {
                      counts[row.Id(0)] = static_cast<size_t>(row.Integer(1, 0, INT32_MAX));
                    });
  return counts;
}

void Database::Impl::ForEachKeypoint(
    uint32_t image_id,
    const std::function<void(const float* values, int64_t num_columns)>& use) const {
  ForEachRow(
      "keypoints", "SELECT image_id, rows, cols, data FROM keypoints WHERE image_id = ?",
      [&](const Row& row) {
        const int64_t num_rows = row.Integer(1, 0, INT32_MAX);
        const int64_t num_columns = row.Integer(2, 0, INT32_MAX);
        if (num_rows > 0 && num_columns != 2 && num_columns != 4 && num_columns != 6) {
          row.Fail("keypoints have " + std::to_string(num_columns) +
                   " columns, expected 2, 4 or 6");
        }
        const std::vector<float> values = row.Blob<float>(3, num_rows, num_columns);
        for (int64_t i = 0; i < num_rows; ++i) {
          const float* keypoint = values.data() + i * num_columns;
          if (!std::isfinite(keypoint[0]) || !std::isfinite(keypoint[1])) {
            row.Fail("keypoint " + std::to_string(i) + " is not a finite position");
          }
          use(keypoint, num_columns);
        }
      },
      image_id);
}

std::vector<Eigen::Vector2d> Database::ReadKeypoints(uint32_t image_id) const {
  std::vector<Eigen::Vector2d> keypoints;
  impl_->ForEachKeypoint(image_id, [&](const float* values, int64_t) {
    keypoints.emplace_back(values[0], values[1]);
  });
  return keypoints;
}

namespace {

// COLMAP's columns: x, y; then scale and orientation, or an affine shape by rows.
float KeypointScale(const float* values, int64_t num_columns) {
  const float scale =
      num_columns == 4   ? values[2]
      : num_columns == 6 ? (std::hypot(values[2], values[4]) + std::hypot(values[3], values[5])) / 2
                         : 1.0f;
  return std::isfinite(scale) ? scale : 0.0f;
}

}  // namespace

DatabaseFeatures Database::ReadLargestFeatures(uint32_t image_id, int max_features) const {
  std::vector<Eigen::Vector2d> x_in_img;
  std::vector<float> scales;
  impl_->ForEachKeypoint(image_id, [&](const float* values, int64_t num_columns) {
    x_in_img.emplace_back(values[0], values[1]);
    scales.push_back(KeypointScale(values, num_columns));
  });
  std::vector<size_t> order(scales.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const size_t count = std::min(order.size(), static_cast<size_t>(std::max(0, max_features)));
  std::partial_sort(
      order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(),
      [&](size_t a, size_t b) { return scales[a] != scales[b] ? scales[a] > scales[b] : a < b; });
  DatabaseFeatures features;
  bool has_row = false;
  impl_->RequireColumns("descriptors", {"image_id", "rows", "cols", "data"});
  impl_->ForEachRow(
      "descriptors", "SELECT image_id, rows, cols, data FROM descriptors WHERE image_id = ?",
      [&](const Row& row) {
        has_row = true;
        const int64_t num_rows = row.Integer(1, 0, INT32_MAX);
        const int64_t num_columns = row.Integer(2, 0, INT32_MAX);
        if (num_rows > 0 && num_columns != kSiftSize) {
          row.Fail("descriptors have " + std::to_string(num_columns) +
                   " bytes, expected the 128 of SIFT");
        }
        if (num_rows != static_cast<int64_t>(scales.size())) {
          row.Fail("has " + std::to_string(num_rows) + " descriptors for " +
                   std::to_string(scales.size()) + " keypoints");
        }
        const std::vector<uint8_t> bytes = row.Blob<uint8_t>(3, num_rows, num_columns);
        features.descriptors.reserve(count * kSiftSize);
        for (size_t i = 0; i < count; ++i) {
          const uint8_t* first = bytes.data() + order[i] * kSiftSize;
          features.descriptors.insert(features.descriptors.end(), first, first + kSiftSize);
          features.x_in_img.push_back(x_in_img[order[i]]);
        }
      },
      image_id);
  if (!has_row && !scales.empty()) {
    throw InputError(path(), "table descriptors, image_id " + std::to_string(image_id),
                     "is missing, but the image has keypoints", kDatabaseRemedy);
  }
  return features;
}

std::map<std::pair<uint32_t, uint32_t>, size_t> Database::CountMatches() const {
  const std::map<uint32_t, DatabaseImage> images = ReadImages();
  std::map<std::pair<uint32_t, uint32_t>, size_t> counts;
  impl_->ForEachRow("two_view_geometries",
                    "SELECT pair_id, rows FROM two_view_geometries ORDER BY pair_id",
                    [&](const Row& row) {
                      const auto pair = PairOfRow(row);
                      if (images.count(pair.first) == 0 || images.count(pair.second) == 0) return;
                      counts[pair] = static_cast<size_t>(row.Integer(1, 0, INT32_MAX));
                    });
  return counts;
}

std::vector<DatabasePair> Database::ReadPairs(int min_matches) const {
  const std::map<uint32_t, DatabaseImage> images = ReadImages();
  const std::map<uint32_t, size_t> num_keypoints = CountKeypoints();
  const auto count_of = [&](uint32_t image_id) {
    const auto found = num_keypoints.find(image_id);
    return found == num_keypoints.end() ? size_t{0} : found->second;
  };
  std::vector<DatabasePair> pairs;
  impl_->ForEachRow(
      "two_view_geometries",
      "SELECT pair_id, rows, cols, data, config FROM two_view_geometries WHERE rows >= ? "
      "ORDER BY pair_id",
      [&](const Row& row) {
        DatabasePair pair;
        std::tie(pair.image_id1, pair.image_id2) = PairOfRow(row);
        if (images.count(pair.image_id1) == 0 || images.count(pair.image_id2) == 0) return;
        const int64_t num_rows = row.Integer(1, 0, INT32_MAX);
        const int64_t num_columns = row.Integer(2, 0, INT32_MAX);
        if (num_rows > 0 && num_columns != 2) {
          row.Fail("matches have " + std::to_string(num_columns) + " columns, expected 2");
        }
        const std::vector<uint32_t> values = row.Blob<uint32_t>(3, num_rows, num_columns);
        pair.config = static_cast<int>(row.Integer(4, INT32_MIN, INT32_MAX));
        const size_t limit1 = count_of(pair.image_id1), limit2 = count_of(pair.image_id2);
        pair.matches.reserve(static_cast<size_t>(num_rows));
        for (size_t i = 0; i + 1 < values.size(); i += 2) {
          if (values[i] >= limit1 || values[i + 1] >= limit2) {
            row.Fail("match " + std::to_string(i / 2) + " joins keypoints " +
                     std::to_string(values[i]) + " and " + std::to_string(values[i + 1]) +
                     " of images " + std::to_string(pair.image_id1) + " and " +
                     std::to_string(pair.image_id2) + ", which have " + std::to_string(limit1) +
                     " and " + std::to_string(limit2));
          }
          pair.matches.emplace_back(static_cast<int>(values[i]), static_cast<int>(values[i + 1]));
        }
        pairs.push_back(std::move(pair));
      },
      min_matches);
  return pairs;
}

namespace {

// Tables as COLMAP up to 3.9 expects them (its documentation of the database format).
constexpr const char* kTables39[] = {
    "CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT "
    "NULL, width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB, prior_focal_length "
    "INTEGER "
    "NOT NULL)",
    "CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL "
    "UNIQUE, camera_id INTEGER NOT NULL, prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz "
    "REAL, prior_tx REAL, prior_ty REAL, prior_tz REAL)",
    "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols "
    "INTEGER NOT NULL, data BLOB)",
    "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT "
    "NULL, "
    "cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, "
    "tvec BLOB)"};

std::string QuotedName(const std::string& name) {
  std::string quoted = "\"";
  for (const char c : name) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

// Makes a table with these columns and nothing else: no default, check, trigger or index of the
// other one. COLMAP adds its own indices when it opens a database.
void MakeTable(const std::string& table, const std::vector<TableColumn>& columns,
               SQLite::Database* to) {
  static const std::set<std::string> types = {"INTEGER", "REAL", "BLOB", "TEXT"};
  std::string definition, keys;
  const auto num_keys =
      std::count_if(columns.begin(), columns.end(), [](const auto& c) { return c.key > 0; });
  for (const TableColumn& column : columns) {
    definition += (definition.empty() ? "" : ", ") + QuotedName(column.name);
    if (types.count(column.type) > 0) definition += " " + column.type;
    if (num_keys == 1 && column.key > 0) definition += " PRIMARY KEY";
    if (column.not_null) definition += " NOT NULL";
    if (num_keys > 1 && column.key > 0) {
      keys += (keys.empty() ? ", PRIMARY KEY (" : ", ") + QuotedName(column.name);
    }
  }
  if (!keys.empty()) keys += ")";
  to->exec("CREATE TABLE " + QuotedName(table) + " (" + definition + keys + ")");
}

// Copies the columns that both tables have; `steps` is what LookAtWork counts. insert_verb: "INSERT
// OR IGNORE" to keep rows that are there.
void CopyRows(const SQLite::Database& from, const SQLite::Database& to, const std::string& table,
              int64_t* steps, const char* insert_verb = "INSERT") {
  const std::vector<TableColumn> known = ColumnsOf(to, table);
  std::string names, places;
  int num_columns = 0;
  if (!HasTable(from, table)) return;
  for (const TableColumn& column : ColumnsOf(from, table)) {
    const auto has_name = [&](const TableColumn& other) { return other.name == column.name; };
    if (std::none_of(known.begin(), known.end(), has_name)) continue;
    names += (num_columns == 0 ? "" : ", ") + QuotedName(column.name);
    places += num_columns == 0 ? "?" : ", ?";
    ++num_columns;
  }
  if (num_columns == 0) return;
  SQLite::Statement read(from, "SELECT " + names + " FROM \"" + table + "\"");
  SQLite::Statement insert(to, std::string(insert_verb) + " INTO \"" + table + "\" (" + names +
                                   ") VALUES (" + places + ")");
  *steps = 0;
  while (read.executeStep()) {
    *steps = 0;
    for (int i = 0; i < num_columns; ++i) {
      const SQLite::Column value = read.getColumn(i);
      if (value.isNull()) {
        insert.bind(i + 1);
      } else if (value.isInteger()) {
        insert.bind(i + 1, value.getInt64());
      } else if (value.isFloat()) {
        insert.bind(i + 1, value.getDouble());
      } else if (value.isBlob()) {
        insert.bindNoCopy(i + 1, value.getBlob(), value.getBytes());
      } else {
        insert.bind(i + 1, value.getString());
      }
    }
    insert.exec();
    insert.reset();
  }
}

// COLMAP's tables of `from` in `to`, with their rows where `with_rows` says so.
template <typename WithRows>
void CopyTables(const SQLite::Database& from, SQLite::Database* to, int64_t* steps,
                const WithRows& with_rows) {
  SQLite::Statement version(from, "PRAGMA user_version");
  version.executeStep();
  to->exec("PRAGMA user_version = " + std::to_string(version.getColumn(0).getInt()));
  for (const std::string& table : KnownTables()) {
    if (!HasTable(from, table)) continue;
    MakeTable(table, ColumnsOf(from, table), to);
    if (with_rows(table)) CopyRows(from, *to, table, steps);
  }
}

void RequireSameFeatures(const Database& copy, const std::string& path,
                         const std::map<uint32_t, DatabaseImage>& images,
                         const std::map<uint32_t, size_t>& keypoints) {
  const char* const remedy = "Give copies that were made of it after colmap feature_extractor";
  const std::map<uint32_t, DatabaseImage> others = copy.ReadImages();
  if (others.size() != images.size()) {
    throw InputError(copy.path(), "",
                     "has " + std::to_string(others.size()) + " photos, " + path + " has " +
                         std::to_string(images.size()),
                     remedy);
  }
  const std::map<uint32_t, size_t> other_keypoints = copy.CountKeypoints();
  const auto count = [](const std::map<uint32_t, size_t>& counts, uint32_t image_id) {
    const auto found = counts.find(image_id);
    return found == counts.end() ? size_t{0} : found->second;
  };
  for (const auto& [image_id, image] : images) {
    const auto other = others.find(image_id);
    if (other != others.end() && other->second.name == image.name &&
        count(other_keypoints, image_id) == count(keypoints, image_id)) {
      continue;
    }
    throw InputError(copy.path(), "image " + std::to_string(image_id),
                     "is not " + Quoted(image.name) + " with the keypoints that it has in " + path,
                     remedy);
  }
}

}  // namespace

void Database::CopyForMapper(const std::string& path, Schema schema) const {
  impl_->Guarded([&] {
    const SQLite::Database& from = *impl_->sqlite;
    SQLite::Database copy(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    copy.exec("PRAGMA journal_mode = OFF");
    copy.exec("PRAGMA synchronous = OFF");
    SQLite::Transaction transaction(copy);
    if (schema == Schema::kColmap39) {
      for (const char* table : kTables39) copy.exec(table);
      for (const char* table : {"cameras", "images", "keypoints", "two_view_geometries"}) {
        CopyRows(from, copy, table, &impl_->steps);
      }
    } else {
      CopyTables(from, &copy, &impl_->steps, [](const std::string& table) {
        return table != "descriptors" && table != "matches";
      });
    }
    transaction.commit();
  });
}

size_t Database::CountPairs() const {
  size_t count = 0;
  impl_->ForEachRow(
      "two_view_geometries", "SELECT COUNT(*) FROM two_view_geometries WHERE rows > 0",
      [&](const Row& row) { count = static_cast<size_t>(row.Integer(0, 0, INT64_MAX)); });
  return count;
}

void Database::CopyWithCameras(const std::string& path,
                               const std::map<uint32_t, Camera>& cameras) const {
  impl_->Guarded([&] {
    SQLite::Database copy(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    copy.exec("PRAGMA journal_mode = MEMORY");  // no file beside it
    SQLite::Transaction transaction(copy);
    CopyTables(*impl_->sqlite, &copy, &impl_->steps, [](const std::string&) { return true; });
    SQLite::Statement update(copy,
                             "UPDATE cameras SET model = ?, width = ?, height = ?, params = ?, "
                             "prior_focal_length = ? WHERE camera_id = ?");
    for (const auto& [camera_id, camera] : cameras) {
      update.bind(1, static_cast<int>(camera.model));
      update.bind(2, camera.width);
      update.bind(3, camera.height);
      update.bindNoCopy(4, camera.params.data(),
                        static_cast<int>(camera.params.size() * sizeof(double)));
      update.bind(5, camera.has_prior_focal_length ? 1 : 0);
      update.bind(6, static_cast<int64_t>(camera_id));
      update.exec();
      update.reset();
    }
    transaction.commit();
  });
}

void Database::CopyWithMatches(const std::string& path,
                               const std::vector<const Database*>& copies) const {
  const std::map<uint32_t, DatabaseImage> images = ReadImages();
  const std::map<uint32_t, size_t> keypoints = CountKeypoints();
  for (const Database* const copy : copies)
    RequireSameFeatures(*copy, this->path(), images, keypoints);
  impl_->Guarded([&] {
    SQLite::Database merged(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    merged.exec("PRAGMA journal_mode = MEMORY");  // no file beside it
    SQLite::Transaction transaction(merged);
    CopyTables(*impl_->sqlite, &merged, &impl_->steps, [](const std::string&) { return true; });
    for (const Database* const copy : copies) {
      copy->impl_->Guarded([&] {
        for (const char* table : {"matches", "two_view_geometries"}) {
          CopyRows(*copy->impl_->sqlite, merged, table, &copy->impl_->steps, "INSERT OR IGNORE");
        }
      });
    }
    transaction.commit();
  });
}

bool Database::SetCameras(const std::string& copy_path, const std::map<uint32_t, Camera>& cameras,
                          const std::map<uint32_t, DatabaseImage>& images) {
  SQLite::Database copy(copy_path, SQLite::OPEN_READWRITE);
  if (copy.tableExists("rigs")) return false;
  SQLite::Transaction transaction(copy);
  copy.exec("DELETE FROM cameras");
  SQLite::Statement add(copy,
                        "INSERT INTO cameras(camera_id, model, width, height, params, "
                        "prior_focal_length) VALUES(?, ?, ?, ?, ?, ?)");
  for (const auto& [camera_id, camera] : cameras) {
    add.bind(1, static_cast<int64_t>(camera_id));
    add.bind(2, static_cast<int>(camera.model));
    add.bind(3, camera.width);
    add.bind(4, camera.height);
    add.bindNoCopy(5, camera.params.data(),
                   static_cast<int>(camera.params.size() * sizeof(double)));
    add.bind(6, camera.has_prior_focal_length ? 1 : 0);
    add.exec();
    add.reset();
  }
  SQLite::Statement update(copy, "UPDATE images SET camera_id = ? WHERE image_id = ?");
  for (const auto& [image_id, image] : images) {
    update.bind(1, static_cast<int64_t>(image.camera_id));
    update.bind(2, static_cast<int64_t>(image_id));
    update.exec();
    update.reset();
  }
  transaction.commit();
  return true;
}

}  // namespace roomtex
