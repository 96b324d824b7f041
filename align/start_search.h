#pragma once
// Starts without a click, fitted to the scan's surface and ranked by what the photos' rays say of
// them: the search (align/search) finds where the model could be, this says where it fits.

#include <optional>
#include <vector>

#include "align/alignment_input.h"
#include "align/search/geometry_search.h"
#include "align/search/search_cloud.h"
#include "align/search/search_hint.h"
#include "align/trust/appearance_search.h"
#include "align/trust/gradient_shift.h"
#include "align/trust/sight_agreement.h"

namespace roomtex {

struct StartSearchOptions {
  GeometrySearchOptions geometry;
  int num_finalists = 10;  // that are fitted with all points
  int num_threads = -1;    // changes nothing
};

struct FittedStart {
  Similarity scan_from_sparse;  // on the surface; of a mirrored model: of its mirror image
  double score = 0;             // StartHypothesis::score before the fit
  bool settled = false;         // the fit came to rest
  int num_on_surface = 0;       // sparse points
  double rms = 0;               // metres, their distances
  SightAgreement sights;
  std::optional<GradientAgreement> photos;  // of the best starts (start_photos.h)
  bool looks_alike = false;                 // photos and scan there (AddStartThatLooksAlike)
};

// Metres; where sparse points and surface agree within this, photos of this room do so, too.
inline constexpr double kExactRms = 0.01;

// Where on the scan photos show what it shows, in cells of 15 cm: all, and those farther than
// kObjectReach from whatever place has most of them around it. One rug or shelf may stand in
// another room, too, and whatever photos show of it agrees.
struct CellSpread {
  int num_cells = 0, num_apart = 0;
};
inline constexpr double kObjectReach = 1.5;  // metres
// So many apart are more than one object: 0 of a rug that another room had, too; 19 to 46 where
// places were right (docs/automatic.md).
inline constexpr int kFewestApart = 10;
CellSpread FindCellSpread(const std::vector<Pick>& picks);

// Where photos and scan look alike (start_appearance.h), the best first; may be nowhere.
struct AppearanceEvidence {
  std::vector<AppearancePlace> places;
  std::vector<Pick> agreeing;  // what photos show of the scan at the first of them, weight 1
  CellSpread spread;           // of these
};

// Photos that were each placed alone (start_placed_photos.h), and where those of them that agree
// with each other put the model.
struct PlacedPhotoEvidence {
  int num_asked = 0, num_placed = 0, num_agreeing = 0;
  std::optional<Similarity> scan_from_sparse;
  std::vector<Pick> agreeing;  // what the photos that agree show of the scan, weight 1
  CellSpread spread;           // of these
};

struct StartSearch {
  int num_hypotheses = 0;
  std::vector<HintRay> hints;                  // of the user; none of the starts contradicts them
  bool up_known = false;                       // in the model, by the photos
  std::vector<Eigen::Vector3d> ups_in_sparse;  // the likeliest first
  std::vector<Eigen::Vector3d> ups_in_scan;
  SearchCloud cloud;
  // Clearly different ones, those first that the photos' rays agree with most.
  std::vector<FittedStart> starts;
  // The same for the mirror image of the model, which is nowhere: how well a wrong start fits here.
  std::vector<FittedStart> mirrored;
  std::optional<AppearanceEvidence> appearance;      // if photos and scan were asked
  std::optional<PlacedPhotoEvidence> placed_photos;  // if each photo was
  // What photos show of the scan at the start that looks alike, weight 1.
  std::vector<Pick> alike_picks;
};

// Metres; what a fitted start may still be off where a hint has it.
inline constexpr double kHintSlack = 0.25;

// The scales that are searched are this coarse.
inline constexpr double kMaxStartScaleChange = 0.15;

// Metres; starts that put half of the points nearer together are one.
inline constexpr double kSameStart = 0.15;

// Fits a start to the surface and to picks (noise sigma_px), and asks the rays again.
// gate: metres, FitToSurface().
void FitStart(const AlignmentInput& input, const SearchCloud& cloud, const std::vector<Pick>& picks,
              double sigma_px, double gate, const SimilarityFitOptions& options,
              FittedStart* start);

StartSearch SearchStarts(const AlignmentInput& input, const std::vector<NearHint>& near,
                         const AlignmentOptions& options, const StartSearchOptions& search);

// Of several starts at one place the best, in the order of what the rays say, so many at most.
std::vector<FittedStart> DistinctStarts(const SearchCloud& cloud, std::vector<FittedStart> starts,
                                        int most);

// Where a start puts the middle of the photos' places.
Eigen::Vector3d PhotosMiddle(const StartSearch& search, int start);

// Metres: how far apart two starts put what the photos see, at the median over its points.
double DistanceBetween(const SearchCloud& cloud, const Similarity& a, const Similarity& b);

}  // namespace roomtex
