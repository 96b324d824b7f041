#pragma once
// Small COLMAP databases for tests, as COLMAP 3.8 and 4.x lay them out.

#include <string>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>

#include "colmap_ext/database.h"

namespace roomtex {

class DatabaseMaker {
 public:
  enum class Schema { k38, k41 };

  DatabaseMaker(const std::string& path, Schema schema)
      : sqlite_(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE), schema_(schema) {
    Run("CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER "
        "NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB, "
        "prior_focal_length INTEGER NOT NULL)");
    const std::string pose_columns =
        schema == Schema::k38 ? ", prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL, "
                                "prior_tx REAL, prior_ty REAL, prior_tz REAL"
                              : "";
    Run("CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT "
        "NULL UNIQUE, camera_id INTEGER NOT NULL" +
        pose_columns + ")");
    Run("CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, "
        "cols INTEGER NOT NULL, data BLOB)");
    Run("CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols "
        "INTEGER NOT NULL, data BLOB)");
    Run("CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT "
        "NULL, cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, "
        "qvec BLOB, tvec BLOB)");
    if (schema == Schema::k41) {
      Run("CREATE TABLE rigs (rig_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, ref_sensor_id "
          "INTEGER NOT NULL, ref_sensor_type INTEGER NOT NULL)");
      Run("CREATE TABLE frames (frame_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, rig_id "
          "INTEGER NOT NULL)");
      Run("CREATE TABLE rig_sensors (rig_id INTEGER NOT NULL, sensor_id INTEGER NOT NULL, "
          "sensor_type INTEGER NOT NULL, sensor_from_rig BLOB)");
      Run("CREATE TABLE frame_data (frame_id INTEGER NOT NULL, data_id INTEGER NOT NULL, "
          "sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL)");
      Run("CREATE TABLE pose_priors (pose_prior_id INTEGER PRIMARY KEY NOT NULL, position BLOB, "
          "corr_data_id INTEGER, corr_sensor_id INTEGER, corr_sensor_type INTEGER)");
      Run("PRAGMA user_version = 4010100");
    }
  }

  void Run(const std::string& sql) { sqlite_.exec(sql); }
  void UseWal() { sqlite_.exec("PRAGMA journal_mode = WAL"); }

  void AddCamera(const Camera& camera) {
    SQLite::Statement insert(sqlite_, "INSERT INTO cameras VALUES (?, ?, ?, ?, ?, ?)");
    insert.bind(1, static_cast<int64_t>(camera.camera_id));
    insert.bind(2, static_cast<int>(camera.model));
    insert.bind(3, camera.width);
    insert.bind(4, camera.height);
    BindBlob(&insert, 5, camera.params);
    insert.bind(6, camera.has_prior_focal_length ? 1 : 0);
    insert.exec();
    const std::string id = std::to_string(camera.camera_id);
    if (schema_ == Schema::k41) Run("INSERT INTO rigs VALUES (" + id + ", " + id + ", 0)");
  }

  void AddImage(uint32_t image_id, const std::string& name, uint32_t camera_id) {
    SQLite::Statement insert(sqlite_,
                             "INSERT INTO images (image_id, name, camera_id) VALUES (?, ?, ?)");
    insert.bind(1, static_cast<int64_t>(image_id));
    insert.bind(2, name);
    insert.bind(3, static_cast<int64_t>(camera_id));
    insert.exec();
    if (schema_ == Schema::k38) return;
    const std::string id = std::to_string(image_id), camera = std::to_string(camera_id);
    Run("INSERT INTO frames VALUES (" + id + ", " + camera + ")");
    Run("INSERT INTO frame_data VALUES (" + id + ", " + id + ", " + camera + ", 0)");
  }

  // num_columns 2, 4 or 6; the columns behind x and y hold numbers that nobody may take for
  // positions.
  void AddKeypoints(uint32_t image_id, const std::vector<Eigen::Vector2d>& x_in_img,
                    int num_columns) {
    std::vector<float> values;
    for (const Eigen::Vector2d& x : x_in_img) {
      values.push_back(static_cast<float>(x.x()));
      values.push_back(static_cast<float>(x.y()));
      for (int k = 2; k < num_columns; ++k) values.push_back(-1000.0f - k);
    }
    AddRow("keypoints (image_id, rows, cols, data)", image_id, x_in_img.size(), num_columns, values,
           "");
  }

  // num_columns bytes per feature, 128 of SIFT.
  void AddDescriptors(uint32_t image_id, const std::vector<uint8_t>& bytes, int num_columns = 128) {
    Run("CREATE TABLE IF NOT EXISTS descriptors (image_id INTEGER PRIMARY KEY NOT NULL, rows "
        "INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB)");
    AddRow("descriptors (image_id, rows, cols, data)", image_id,
           bytes.size() / static_cast<size_t>(num_columns), num_columns, bytes, "");
  }

  void AddPair(uint32_t image_id1, uint32_t image_id2, const std::vector<uint32_t>& matches,
               int config = 2) {
    AddRow("two_view_geometries (pair_id, rows, cols, data, config)",
           static_cast<int64_t>(PairIdFromImages(image_id1, image_id2)), matches.size() / 2, 2,
           matches, ", " + std::to_string(config));
  }

 private:
  template <typename T>
  static void BindBlob(SQLite::Statement* statement, int index, const std::vector<T>& values) {
    if (values.empty()) {
      statement->bind(index);
    } else {
      statement->bind(index, values.data(), static_cast<int>(values.size() * sizeof(T)));
    }
  }

  template <typename T>
  void AddRow(const std::string& table, int64_t id, size_t num_rows, int num_columns,
              const std::vector<T>& values, const std::string& more) {
    SQLite::Statement insert(sqlite_, "INSERT INTO " + table + " VALUES (?, ?, ?, ?" + more + ")");
    insert.bind(1, id);
    insert.bind(2, static_cast<int64_t>(num_rows));
    insert.bind(3, num_columns);
    BindBlob(&insert, 4, values);
    insert.exec();
  }

  SQLite::Database sqlite_;
  Schema schema_;
};

}  // namespace roomtex
