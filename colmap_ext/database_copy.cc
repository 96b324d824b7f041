// Copies of a database, with other cameras or more matches: what COLMAP is given instead of the
// user's, and what commands write.

#include <algorithm>

#include <SQLiteCpp/SQLiteCpp.h>

#include "colmap_ext/database.h"
#include "colmap_ext/database_file.h"
#include "core/text.h"

namespace roomtex {
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

// Copies the columns that both tables have. insert_verb: "INSERT OR IGNORE" to keep rows that are
// there.
void CopyRows(const DatabaseFile& from, const SQLite::Database& to, const std::string& table,
              const char* insert_verb = "INSERT") {
  const std::vector<TableColumn> known = ColumnsOf(to, table);
  std::string names, places;
  int num_columns = 0;
  if (!HasTable(from.sqlite(), table)) return;
  for (const TableColumn& column : ColumnsOf(from.sqlite(), table)) {
    const auto has_name = [&](const TableColumn& other) { return other.name == column.name; };
    if (std::none_of(known.begin(), known.end(), has_name)) continue;
    names += (num_columns == 0 ? "" : ", ") + QuotedName(column.name);
    places += num_columns == 0 ? "?" : ", ?";
    ++num_columns;
  }
  if (num_columns == 0) return;
  SQLite::Statement read(from.sqlite(), "SELECT " + names + " FROM \"" + table + "\"");
  SQLite::Statement insert(to, std::string(insert_verb) + " INTO \"" + table + "\" (" + names +
                                   ") VALUES (" + places + ")");
  from.RowIsRead();
  while (read.executeStep()) {
    from.RowIsRead();
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
void CopyTables(const DatabaseFile& from, SQLite::Database* to, const WithRows& with_rows) {
  SQLite::Statement version(from.sqlite(), "PRAGMA user_version");
  version.executeStep();
  to->exec("PRAGMA user_version = " + std::to_string(version.getColumn(0).getInt()));
  for (const std::string& table : KnownTables()) {
    if (!HasTable(from.sqlite(), table)) continue;
    MakeTable(table, ColumnsOf(from.sqlite(), table), to);
    if (with_rows(table)) CopyRows(from, *to, table);
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

[[noreturn]] void ThrowNotWritten(const std::string& path, const SQLite::Exception& error) {
  throw InputError(path, "", std::string("cannot be changed (") + error.what() + ")",
                   "Make room in the folder of temporary files (TMPDIR)");
}

// The statement's parameters: model, width, height, params, prior_focal_length, camera_id.
void ExecuteWith(uint32_t camera_id, const Camera& camera, SQLite::Statement* statement) {
  statement->bind(1, static_cast<int>(camera.model));
  statement->bind(2, camera.width);
  statement->bind(3, camera.height);
  statement->bindNoCopy(4, camera.params.data(),
                        static_cast<int>(camera.params.size() * sizeof(double)));
  statement->bind(5, camera.has_prior_focal_length ? 1 : 0);
  statement->bind(6, static_cast<int64_t>(camera_id));
  statement->exec();
  statement->reset();
}

// Whether every camera of a database of COLMAP 3.12 to 4.x is a rig of its own and every photo a
// frame: what its feature_extractor writes.
bool HasOnlyTrivialRigs(const SQLite::Database& sqlite) {
  const auto has_rows = [&](const std::string& query) {
    SQLite::Statement statement(sqlite, query);
    return statement.executeStep();
  };
  if (sqlite.tableExists("rig_sensors") && has_rows("SELECT 1 FROM rig_sensors")) return false;
  return !sqlite.tableExists("frame_data") ||
         !has_rows("SELECT 1 FROM frame_data GROUP BY frame_id HAVING COUNT(*) > 1");
}

// Makes every camera a rig of its own, and every photo a frame, with the camera's and the photo's
// number, as COLMAP numbers those of models without rigs.
void MakeTrivialRigs(const std::map<uint32_t, Camera>& cameras,
                     const std::map<uint32_t, DatabaseImage>& images, SQLite::Database* sqlite) {
  constexpr char kCameraSensor[] = "0";  // COLMAP's SensorType::CAMERA
  for (const char* table : {"rigs", "frames", "frame_data"}) {
    if (sqlite->tableExists(table)) sqlite->exec(std::string("DELETE FROM ") + table);
  }
  for (const auto& [camera_id, camera] : cameras) {
    const std::string id = std::to_string(camera_id);
    sqlite->exec("INSERT INTO rigs(rig_id, ref_sensor_id, ref_sensor_type) VALUES(" + id + ", " +
                 id + ", " + kCameraSensor + ")");
  }
  const bool has_frames = sqlite->tableExists("frames") && sqlite->tableExists("frame_data");
  const std::vector<TableColumn> columns = ColumnsOf(*sqlite, "pose_priors");
  const bool has_priors =
      std::any_of(columns.begin(), columns.end(),
                  [](const TableColumn& column) { return column.name == "corr_sensor_id"; });
  for (const auto& [image_id, image] : images) {
    const std::string id = std::to_string(image_id), camera = std::to_string(image.camera_id);
    if (has_priors) {
      sqlite->exec("UPDATE pose_priors SET corr_sensor_id = " + camera +
                   " WHERE corr_data_id = " + id + " AND corr_sensor_type = " + kCameraSensor);
    }
    if (!has_frames) continue;
    sqlite->exec("INSERT INTO frames(frame_id, rig_id) VALUES(" + id + ", " + camera + ")");
    sqlite->exec("INSERT INTO frame_data(frame_id, data_id, sensor_id, sensor_type) VALUES(" + id +
                 ", " + id + ", " + camera + ", " + kCameraSensor + ")");
  }
}

}  // namespace

void Database::CopyForMapper(const std::string& path, Schema schema) const {
  file_->Guarded([&] {
    SQLite::Database copy(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    copy.exec("PRAGMA journal_mode = OFF");
    copy.exec("PRAGMA synchronous = OFF");
    SQLite::Transaction transaction(copy);
    if (schema == Schema::kColmap39) {
      for (const char* table : kTables39) copy.exec(table);
      for (const char* table : {"cameras", "images", "keypoints", "two_view_geometries"}) {
        CopyRows(*file_, copy, table);
      }
    } else {
      CopyTables(*file_, &copy, [](const std::string& table) {
        return table != "descriptors" && table != "matches";
      });
    }
    transaction.commit();
  });
}

void Database::CopyWithCameras(const std::string& path,
                               const std::map<uint32_t, Camera>& cameras) const {
  file_->Guarded([&] {
    SQLite::Database copy(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    copy.exec("PRAGMA journal_mode = MEMORY");  // no file beside it
    SQLite::Transaction transaction(copy);
    CopyTables(*file_, &copy, [](const std::string&) { return true; });
    SQLite::Statement update(copy,
                             "UPDATE cameras SET model = ?, width = ?, height = ?, params = ?, "
                             "prior_focal_length = ? WHERE camera_id = ?");
    for (const auto& [camera_id, camera] : cameras) ExecuteWith(camera_id, camera, &update);
    transaction.commit();
  });
}

void Database::CopyWithMatches(const std::string& path,
                               const std::vector<const Database*>& copies) const {
  const std::map<uint32_t, DatabaseImage> images = ReadImages();
  const std::map<uint32_t, size_t> keypoints = CountKeypoints();
  for (const Database* const copy : copies)
    RequireSameFeatures(*copy, this->path(), images, keypoints);
  file_->Guarded([&] {
    SQLite::Database merged(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    merged.exec("PRAGMA journal_mode = MEMORY");  // no file beside it
    SQLite::Transaction transaction(merged);
    CopyTables(*file_, &merged, [](const std::string&) { return true; });
    for (const Database* const copy : copies) {
      copy->file_->Guarded([&] {
        for (const char* table : {"matches", "two_view_geometries"}) {
          CopyRows(*copy->file_, merged, table, "INSERT OR IGNORE");
        }
      });
    }
    transaction.commit();
  });
}

void Database::KeepPairsBetween(const std::string& copy_path,
                                const std::set<uint32_t>& image_ids) try {
  SQLite::Database copy(copy_path, SQLite::OPEN_READWRITE);
  std::vector<int64_t> others;
  SQLite::Statement read(copy, "SELECT pair_id FROM two_view_geometries");
  while (read.executeStep()) {
    const int64_t pair_id = read.getColumn(0).getInt64();
    const auto [image_id1, image_id2] = ImagesFromPairId(static_cast<uint64_t>(pair_id));
    if (image_ids.count(image_id1) == 0 || image_ids.count(image_id2) == 0) {
      others.push_back(pair_id);
    }
  }
  SQLite::Transaction transaction(copy);
  SQLite::Statement remove(copy, "DELETE FROM two_view_geometries WHERE pair_id = ?");
  for (const int64_t pair_id : others) {
    remove.bind(1, pair_id);
    remove.exec();
    remove.reset();
  }
  transaction.commit();
} catch (const SQLite::Exception& error) {
  ThrowNotWritten(copy_path, error);
}

bool Database::SetCameras(const std::string& copy_path, const std::map<uint32_t, Camera>& cameras,
                          const std::map<uint32_t, DatabaseImage>& images) try {
  SQLite::Database copy(copy_path, SQLite::OPEN_READWRITE);
  const bool has_rigs = copy.tableExists("rigs");
  if (has_rigs && !HasOnlyTrivialRigs(copy)) return false;
  SQLite::Transaction transaction(copy);
  if (has_rigs) MakeTrivialRigs(cameras, images, &copy);
  copy.exec("DELETE FROM cameras");
  SQLite::Statement add(copy,
                        "INSERT INTO cameras(model, width, height, params, prior_focal_length, "
                        "camera_id) VALUES(?, ?, ?, ?, ?, ?)");
  for (const auto& [camera_id, camera] : cameras) ExecuteWith(camera_id, camera, &add);
  SQLite::Statement update(copy, "UPDATE images SET camera_id = ? WHERE image_id = ?");
  for (const auto& [image_id, image] : images) {
    update.bind(1, static_cast<int64_t>(image.camera_id));
    update.bind(2, static_cast<int64_t>(image_id));
    update.exec();
    update.reset();
  }
  transaction.commit();
  return true;
} catch (const SQLite::Exception& error) {
  ThrowNotWritten(copy_path, error);
}

}  // namespace roomtex
