#include "tests/benchmark/planar/planar_sets.h"

#include <cstdio>
#include <stdexcept>

#include "tests/colmap_ext/wall_sequence.h"

namespace roomtex {
namespace {

using Scene = SimulatedViewsOptions::Scene;
using Kind = PlanarSet::Kind;
using Matches = PlanarSet::Matches;

std::string Percent(double share) {
  char text[16];
  std::snprintf(text, sizeof(text), "%g %%", 100 * share);
  return text;
}

std::string SceneName(const PlanarSet& set) {
  switch (set.scene) {
    case Scene::kWall:
      return "wall";
    case Scene::kRelief:
      return "relief " + Percent(set.relief);
    case Scene::kCorner:
      return "corner";
    case Scene::kRoom:
      return "room";
  }
  return "";
}

const char* KindName(Kind kind) {
  switch (kind) {
    case Kind::kGrid:
      return "";
    case Kind::kWeakTriples:
      return "weak triples, ";
    case Kind::kTurnOnly:
      return "turned only, ";
    case Kind::kGhost:
      return "ghost view, ";
    case Kind::kShiftedPair:
      return "repeated texture, ";
    case Kind::kWrongLens:
      return "distortion not told, ";
    case Kind::kNeighborsOnly:
      return "neighbours only, ";
  }
  return "";
}

const char* MatchesName(Matches matches) {
  return matches == Matches::kFew ? "few" : matches == Matches::kMany ? "many" : "photos";
}

// Stable over platforms; different names give different sets.
int FirstSeed(const std::string& name) {
  uint32_t hash = 2166136261u;  // FNV-1a
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619u;
  return static_cast<int>(hash % 1000) * 200;
}

// Points in the scene, of which two neighbours share about 45 %.
int NumPoints(const PlanarSet& set, int random_seed) {
  switch (set.matches) {
    case Matches::kFew:
      return 160 + random_seed * 37 % 140;
    case Matches::kMany:
      return 800;
    case Matches::kPhotos:
      return 2500;
  }
  return 0;
}

// The keypoints stay those of a lens with distortion, the database tells of none.
SimulatedViews ForgetDistortion(SimulatedViews views) {
  for (auto& [camera_id, camera] : views.cameras) {
    camera.model = CameraModel::kPinhole;
    camera.params.resize(4);
  }
  return views;
}

PlanarSet Set(Scene scene, double relief, double fov, double noise_px, double outliers, int views,
              Matches matches, Kind kind = Kind::kGrid) {
  PlanarSet set;
  set.kind = kind;
  set.scene = scene;
  set.relief = relief;
  set.field_of_view_deg = fov;
  set.noise_px = noise_px;
  set.outlier_share = outliers;
  set.num_views = views;
  set.matches = matches;
  return set;
}

}  // namespace

std::string PlanarSet::Name() const {
  if (kind == Kind::kWeakTriples || kind == Kind::kGhost) return KindName(kind) + SceneName(*this);
  char text[160];
  std::snprintf(text, sizeof(text), "%s%s, %g deg, %g px, %s outliers, %d views, %s",
                KindName(kind), SceneName(*this).c_str(), field_of_view_deg, noise_px,
                Percent(outlier_share).c_str(), num_views, MatchesName(matches));
  return text;
}

std::vector<GridRow> GridRows() {
  const std::pair<Scene, double> scenes[] = {{Scene::kWall, 0},      {Scene::kRelief, 0.01},
                                             {Scene::kRelief, 0.03}, {Scene::kRelief, 0.10},
                                             {Scene::kCorner, 0},    {Scene::kRoom, 0}};
  std::vector<GridRow> rows;
  for (const auto& [scene, relief] : scenes) {
    for (const double fov : {58.0, 28.0}) {
      for (const double noise_px : {0.5, 1.0}) {
        GridRow row;
        for (const double outliers : {0.0, 0.1, 0.3}) {
          for (const int num_views : {3, 4, 8}) {
            for (const Matches matches : {Matches::kFew, Matches::kMany}) {
              row.cells.push_back(Set(scene, relief, fov, noise_px, outliers, num_views, matches));
            }
          }
        }
        char text[80];
        std::snprintf(text, sizeof(text), "%s, %g deg, %g px", SceneName(row.cells[0]).c_str(), fov,
                      noise_px);
        row.name = text;
        rows.push_back(std::move(row));
      }
    }
  }
  return rows;
}

std::vector<PlanarSet> MapperRows() {
  return {
      Set(Scene::kWall, 0, 28, 0.5, 0.1, 4, Matches::kFew),  // COLMAP 3.8: 18 of 30
      Set(Scene::kWall, 0, 28, 0.5, 0.1, 3, Matches::kFew),
      Set(Scene::kWall, 0, 28, 0.5, 0.1, 8, Matches::kFew),
      Set(Scene::kWall, 0, 28, 1.0, 0.1, 4, Matches::kMany),
      Set(Scene::kWall, 0, 58, 0.5, 0.1, 4, Matches::kMany),
      Set(Scene::kWall, 0, 58, 1.0, 0.3, 4, Matches::kMany),
      Set(Scene::kRelief, 0.01, 28, 0.5, 0.1, 4, Matches::kFew),
      Set(Scene::kRelief, 0.03, 28, 1.0, 0.1, 4, Matches::kMany),
      Set(Scene::kRelief, 0.10, 58, 1.0, 0.3, 4, Matches::kMany),
      Set(Scene::kCorner, 0, 28, 0.5, 0.1, 4, Matches::kFew),
      Set(Scene::kCorner, 0, 58, 1.0, 0.1, 4, Matches::kMany),
      Set(Scene::kRoom, 0, 28, 1.0, 0.3, 4, Matches::kFew),
      Set(Scene::kRoom, 0, 58, 0.5, 0.1, 4, Matches::kMany),
      Set(Scene::kRoom, 0, 58, 0.5, 0.1, 12, Matches::kPhotos),
  };
}

std::vector<PlanarSet> SequenceRows() {
  return {Set(Scene::kWall, 0, 58, 0.5, 0.05, 8, Matches::kPhotos, Kind::kWeakTriples),
          Set(Scene::kRelief, 0.05, 58, 0.5, 0.05, 8, Matches::kPhotos, Kind::kWeakTriples)};
}

std::vector<PlanarSet> AdversarialRows() {
  return {
      Set(Scene::kWall, 0, 58, 0.5, 0.1, 2, Matches::kMany),
      Set(Scene::kWall, 0, 28, 0.5, 0.1, 2, Matches::kFew),
      Set(Scene::kRelief, 0.01, 28, 1.0, 0.1, 2, Matches::kMany),
      Set(Scene::kRoom, 0, 58, 0.5, 0.1, 2, Matches::kMany),
      Set(Scene::kWall, 0, 28, 1.0, 0.3, 3, Matches::kFew),
      Set(Scene::kWall, 0, 58, 0.5, 0.1, 5, Matches::kMany, Kind::kTurnOnly),
      Set(Scene::kRoom, 0, 58, 0.5, 0.1, 5, Matches::kMany, Kind::kTurnOnly),
      Set(Scene::kRelief, 0.05, 58, 0.5, 0.05, 8, Matches::kPhotos, Kind::kGhost),
      Set(Scene::kWall, 0, 58, 0.5, 0.05, 8, Matches::kPhotos, Kind::kGhost),
      Set(Scene::kWall, 0, 58, 0.5, 0.1, 4, Matches::kMany, Kind::kShiftedPair),
      Set(Scene::kWall, 0, 58, 0.5, 0.1, 6, Matches::kMany, Kind::kShiftedPair),
      Set(Scene::kWall, 0, 58, 0.5, 0.1, 8, Matches::kMany, Kind::kWrongLens),
      Set(Scene::kWall, 0, 28, 1.0, 0.1, 12, Matches::kMany, Kind::kNeighborsOnly),
  };
}

SimulatedViews MakeSet(const PlanarSet& set, int seed) {
  if (set.kind == Kind::kWeakTriples) return WeakWallSequence(set.scene, 1000 + seed);
  if (set.kind == Kind::kGhost) {
    return WithGhostView(WeakWallSequence(set.scene, 1000 + seed), kGhostId);
  }
  SimulatedViewsOptions options;
  options.random_seed = FirstSeed(set.Name()) + seed;
  options.scene = set.scene;
  options.relief = set.relief;
  options.field_of_view_deg = set.field_of_view_deg;
  options.baseline = set.field_of_view_deg < 40 ? 0.3 : 0.5;
  options.noise_px = set.noise_px;
  options.outlier_share = set.outlier_share;
  options.num_views = set.num_views;
  options.num_points = NumPoints(set, options.random_seed);
  options.only_turn = set.kind == Kind::kTurnOnly;
  options.distortion = set.kind == Kind::kWrongLens;
  if (set.kind == Kind::kShiftedPair) {
    options.period = 0.4;
    // Every pair of neighbours in turn: those with most matches too.
    const uint32_t first = static_cast<uint32_t>(1 + seed % (set.num_views - 1));
    return WithShiftedPair(SimulateViews(options), first, first + 1);
  }
  if (set.kind == Kind::kWrongLens) return ForgetDistortion(SimulateViews(options));
  if (set.kind == Kind::kNeighborsOnly) {
    options.num_points = 2500;
    return WithoutTriples(SimulateViews(options), seed);
  }
  return SimulateViews(options);
}

PlanarSet FindSet(const std::string& name) {
  for (const GridRow& row : GridRows()) {
    for (const PlanarSet& set : row.cells) {
      if (set.Name() == name) return set;
    }
  }
  for (const auto& rows : {MapperRows(), SequenceRows(), AdversarialRows()}) {
    for (const PlanarSet& set : rows) {
      if (set.Name() == name) return set;
    }
  }
  throw std::runtime_error("no set is called \"" + name + "\"");
}

}  // namespace roomtex
