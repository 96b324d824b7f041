#include "dense/dense.h"

#include <algorithm>
#include <filesystem>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "colmap_ext/dense_workspace.h"
#include "colmap_ext/sparse_model.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/random_stream.h"
#include "core/text.h"
#include "dense/stereo_views.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

constexpr int kJpegQuality = 95;
// Bytes on the disk, per pixel of all pictures, at the peak: .first and .new, or .new, .depth and
// .estimate (floats), the grey picture and the JPEG.
constexpr double kDiskBytesPerPixel = 42;
constexpr int kAsked = 8;          // photos whose depth is tried in another
constexpr int kSmallestSide = 32;  // pixels of a picture: smaller ones hold no window
constexpr int kPointColumns = 48;  // of the raster of a photo's points

class DenseRun {
 public:
  DenseRun(const DenseOptions& options, const std::string& folder, uint64_t seed, int num_threads,
           Progress* progress)
      : options_(options),
        workspace_{folder},
        aside_(folder + "/aside"),
        seed_(seed),
        num_threads_(num_threads),
        progress_(progress) {
    MakeFolder(aside_);
  }
  ~DenseRun() {
    std::error_code ignored;
    fs::remove_all(aside_, ignored);
  }

  void Undistort(const std::vector<DensePhoto>& photos, std::vector<PhotoLeftOut>* left_out) {
    std::vector<std::string> problems(photos.size());
    std::vector<std::optional<Camera>> cameras(photos.size());
    ParallelFor(num_threads_, 0, static_cast<int>(photos.size()), [&](int i) {
      const auto pinhole = PinholeCamera(photos[i].camera, options_.pinhole);
      const std::string path = workspace_.ImagePath(photos[i].name);
      if (!pinhole || std::min(pinhole->width, pinhole->height) < kSmallestSide) {
        problems[i] =
            "It is a panorama, or too little of it is left without its distortion: cut "
            "panoramas into faces (roomtex-import).";
        return;
      }
      cv::Mat taken;
      try {
        taken = ReadPhoto(photos[i].path, photos[i].pixels);
      } catch (const InputError& error) {
        problems[i] = error.what();
        return;
      }
      const cv::Mat picture = UndistortPhoto(taken, photos[i].camera, *pinhole).picture;
      std::vector<uchar> bytes;
      if (!cv::haveImageWriter(path) ||
          !cv::imencode(fs::path(path).extension().string(), picture, bytes,
                        {cv::IMWRITE_JPEG_QUALITY, kJpegQuality})) {
        cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
      }
      OutputFile file(path);
      file.stream().write(reinterpret_cast<const char*>(bytes.data()),
                          static_cast<std::streamsize>(bytes.size()));
      file.Commit();
      cv::Mat grey;
      cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
      WriteLossless(grey, GreyPath(photos[i].name));
      cameras[i] = pinhole;
      progress_->Tick();
    });
    for (size_t i = 0; i < photos.size(); ++i) {
      if (cameras[i]) {
        views_.push_back({photos[i].name, *cameras[i], photos[i].cam_from_scan, {}});
      } else {
        left_out->push_back({photos[i].name, problems[i]});
      }
    }
  }

  DenseResult Run(const std::vector<Scan>& scans) {
    progress_->Stage("space");
    const ScanSpace space(scans, num_threads_);
    FindNeighbours(space, options_.MaxNeighbours(), &views_);
    DenseResult result;
    progress_->Stage("depth", static_cast<int>(views_.size()));
    for (size_t i = 0; i < views_.size(); ++i) {
      result.photos.push_back(Estimate(static_cast<int>(i), space));
      progress_->Tick();
    }
    progress_->Stage("refinement", static_cast<int>(views_.size()));
    for (int i = 0; i < static_cast<int>(views_.size()); ++i) {
      Refine(i, space);
      progress_->Tick();
    }
    for (int i = 0; i < static_cast<int>(views_.size()); ++i) RemoveAside(i, ".new");
    progress_->Stage("fusion", static_cast<int>(views_.size()));
    SupplementBuilder builder(options_.fusion);
    for (size_t i = 0; i < views_.size(); ++i) {
      result.photos[i].share_new = Confirm(static_cast<int>(i), space, &builder);
      progress_->Tick();
    }
    result.supplement = builder.supplement();
    progress_->Stage("write");
    WriteModel();
    return result;
  }

  size_t num_views() const { return views_.size(); }

 private:
  std::string Aside(int view, const std::string& what) const {
    return aside_ + "/" + std::to_string(view) + what;
  }
  void RemoveAside(int view, const std::string& what) const {
    std::error_code ignored;
    fs::remove(Aside(view, what), ignored);
  }
  std::string GreyPath(const std::string& name) const {
    return PathInside(aside_ + "/grey", name + ".pgm");
  }
  static void WriteLossless(const cv::Mat& picture, const std::string& path) {
    if (cv::imwrite(path, picture)) return;
    throw InputError(path, "", "cannot be written", "Check the space on the disk");
  }

  StereoPicture Load(int view) const {
    StereoPicture picture;
    picture.camera = views_[view].camera;
    picture.cam_from_scan = views_[view].cam_from_scan;
    picture.grey = cv::imread(GreyPath(views_[view].name), cv::IMREAD_GRAYSCALE);
    return picture;
  }

  std::vector<StereoPicture> LoadSources(const StereoView& view) const {
    std::vector<StereoPicture> sources;
    for (const int other : view.neighbours) {
      if (static_cast<int>(sources.size()) == options_.patch_match.num_sources) break;
      sources.push_back(Load(other));
    }
    return sources;
  }

  bool Correlates(float score) const {
    return score >= static_cast<float>(options_.fusion.min_correlation);
  }

  // Photo by photo.
  DenseResult::Photo Estimate(int i, const ScanSpace& space) const {
    const StereoView& view = views_[i];
    const StereoPicture reference = Load(i);
    const OpenSpace open(space, reference, options_.fusion.distance_to_scan, num_threads_);
    const DepthEstimate estimate = EstimateDepth(
        reference, LoadSources(view), open, options_.patch_match, MixBits(seed_, i), num_threads_);
    cv::Mat1f is_new = estimate.depth.clone();
    for (int y = 0; y < is_new.rows; ++y) {
      for (int x = 0; x < is_new.cols; ++x) {
        const float scan = open.scan_depth()(y, x);
        const bool of_scan = scan > 0 && IsSameDepth(is_new(y, x), scan);
        if (of_scan || !Correlates(estimate.score(y, x))) is_new(y, x) = 0;
      }
    }
    cv::Mat1f compared;
    estimate.compared.convertTo(compared, CV_32F);  // 20 bits at most: exact
    WriteDenseArray({estimate.depth, estimate.score, estimate.normals[0], estimate.normals[1],
                     estimate.normals[2], compared},
                    Aside(i, ".first"));
    WriteDenseArray({is_new, estimate.normals[0], estimate.normals[1], estimate.normals[2]},
                    Aside(i, ".new"));
    return {view.name, static_cast<int>(view.neighbours.size()), estimate.share_open, 0};
  }

  // With what the others have found.
  void Refine(int i, const ScanSpace& space) const {
    const StereoView& view = views_[i];
    const StereoPicture reference = Load(i);
    const OpenSpace open(space, reference, options_.fusion.distance_to_scan, num_threads_);
    const std::vector<cv::Mat1f> arrays = ReadDenseArray(Aside(i, ".first"));
    RemoveAside(i, ".first");
    cv::Mat1i compared;
    arrays[5].convertTo(compared, CV_32S);
    const DepthEstimate first{arrays[0], {arrays[2], arrays[3], arrays[4]}, arrays[1], compared, 0};
    const auto found = [&](int k) -> DepthOfSource {
      const int other = view.neighbours[k];
      const std::vector<cv::Mat1f> its = ReadDenseArray(Aside(other, ".new"));
      return {views_[other].camera, views_[other].cam_from_scan, its[0], {its[1], its[2], its[3]}};
    };
    const int num_found = std::min(static_cast<int>(view.neighbours.size()), kAsked);
    const DepthEstimate estimate =
        RefineDepth(reference, LoadSources(view), open, first, num_found, found,
                    options_.patch_match, MixBits(seed_, i, 1), num_threads_);
    // The scan's depth where only it can be, elsewhere what was found.
    cv::Mat1f depth = open.scan_depth().clone();
    cv::Mat1f is_open(depth.size(), 0.0f);
    for (int y = 0; y < depth.rows; ++y) {
      for (int x = 0; x < depth.cols; ++x) {
        if (!open.IsOpen(x, y)) continue;
        depth(y, x) = Correlates(estimate.score(y, x)) ? estimate.depth(y, x) : 0;
        is_open(y, x) = 1;
      }
    }
    WriteDenseArray({depth}, Aside(i, ".depth"));
    WriteDenseArray(
        {is_open, estimate.score, estimate.normals[0], estimate.normals[1], estimate.normals[2]},
        Aside(i, ".estimate"));
  }

  double Confirm(int i, const ScanSpace& space, SupplementBuilder* builder) {
    const StereoView& view = views_[i];
    const std::vector<cv::Mat1f> arrays = ReadDenseArray(Aside(i, ".estimate"));
    RemoveAside(i, ".estimate");
    const cv::Mat1f depth = ReadDenseArray(Aside(i, ".depth"))[0];
    const cv::Mat1b is_open = arrays[0] > 0;
    DepthEstimate estimate{depth.clone(), {arrays[2], arrays[3], arrays[4]}, arrays[1], {}, 0};
    estimate.depth.setTo(0, is_open == 0);
    cv::Mat1f scan_only = depth.clone();
    scan_only.setTo(0, is_open);
    std::vector<DepthOfView> others;
    for (const int other : view.neighbours) {
      others.push_back({&views_[other], ReadDenseArray(Aside(other, ".depth"))[0]});
    }
    const ConfirmedDepth confirmed =
        ConfirmDepth(view, estimate, scan_only, others, space, options_.fusion, num_threads_);
    AddPoints(i, confirmed.depth, others);
    WriteDenseArray({confirmed.depth}, workspace_.DepthMapPath(view.name, "geometric"));
    WriteDenseArray(NormalsOfDepth(confirmed.depth, view.camera.params, 3),
                    workspace_.NormalMapPath(view.name, "geometric"));
    builder->Add(view, confirmed, estimate.score,
                 cv::imread(workspace_.ImagePath(view.name),
                            cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION));
    return static_cast<double>(cv::countNonZero(confirmed.is_new)) /
           static_cast<double>(confirmed.is_new.total());
  }

  // A few places that several photos see: by these COLMAP's steps know which photos overlap.
  void AddPoints(int i, const cv::Mat1f& depth, const std::vector<DepthOfView>& others) {
    const StereoView& view = views_[i];
    const CameraProjection projection(view.camera);
    const Rigid scan_from_cam = view.cam_from_scan.Inverse();
    const int step = std::max(1, depth.cols / kPointColumns);
    for (int y = step / 2; y < depth.rows; y += step) {
      for (int x = step / 2; x < depth.cols; x += step) {
        if (!(depth(y, x) > 0)) continue;
        SparsePoint point;
        point.x_in_model = scan_from_cam * (*projection.RayFromImg({x + 0.5, y + 0.5}) *
                                            static_cast<double>(depth(y, x)));
        std::vector<std::pair<int, Eigen::Vector2d>> sights = {{i, {x + 0.5, y + 0.5}}};
        for (const DepthOfView& other : others) {
          const CameraProjection other_projection(other.view->camera);
          const Eigen::Vector3d in_cam = other.view->cam_from_scan * point.x_in_model;
          const auto at = other_projection.ImgFromCam(in_cam);
          if (!at || !other_projection.InImage(*at)) continue;
          const double seen =
              other.depth(std::min(static_cast<int>(at->y()), other.depth.rows - 1),
                          std::min(static_cast<int>(at->x()), other.depth.cols - 1));
          if (std::abs(seen - in_cam.z()) > options_.fusion.max_depth_difference * in_cam.z())
            continue;
          sights.emplace_back(static_cast<int>(other.view - views_.data()), *at);
        }
        if (sights.size() < 2) continue;
        const uint64_t id = model_.points.size() + 1;
        for (const auto& [number, at] : sights) {
          SparseImage& image = model_.images[static_cast<uint32_t>(number + 1)];
          point.track.push_back(
              {static_cast<uint32_t>(number + 1), static_cast<uint32_t>(image.points2d.size())});
          image.points2d.push_back(at);
          image.point3d_ids.push_back(id);
        }
        model_.points[id] = std::move(point);
      }
    }
  }

  void WriteModel() {
    std::vector<std::string> names;
    for (const StereoView& view : views_) {
      const auto id = static_cast<uint32_t>(names.size() + 1);
      names.push_back(view.name);
      model_.cameras[id] = view.camera;
      model_.cameras[id].camera_id = id;
      SparseImage& image = model_.images[id];
      image.image_id = image.camera_id = id;
      image.name = view.name;
      image.cam_from_model = view.cam_from_scan;
    }
    UpdateReprojectionErrors(&model_);
    WriteSparseModel(model_, workspace_.folder + "/sparse");
    WriteStereoConfiguration(names, workspace_);
  }

  const DenseOptions& options_;
  DenseWorkspace workspace_;
  std::string aside_;
  uint64_t seed_;
  int num_threads_;
  Progress* progress_;
  std::vector<StereoView> views_;
  SparseModel model_;  // image k + 1 is view k
};

// Throws InputError if the disk has not the space for what lies there while depth is found.
void RequireDisk(const std::vector<DensePhoto>& photos, const PinholeOptions& options,
                 const std::string& folder) {
  double num_pixels = 0;
  for (const DensePhoto& photo : photos) {
    const auto pinhole = PinholeCamera(photo.camera, options);
    if (pinhole) num_pixels += static_cast<double>(pinhole->width) * pinhole->height;
  }
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  const double needed = kDiskBytesPerPixel * num_pixels;
  if (error || needed <= static_cast<double>(space.available)) return;
  const auto gigabytes = [](double bytes) { return Number(bytes / 1e9, 1) + " GB"; };
  throw InputError(folder, "",
                   "finding depth in " + std::to_string(photos.size()) + " photos takes " +
                       gigabytes(needed) + " of the disk, and " +
                       gigabytes(static_cast<double>(space.available)) + " are free",
                   "Give a smaller --max_image_size, or an --output_path on another disk");
}

}  // namespace

int DenseOptions::MaxNeighbours() const {
  return std::max(SupplementOptions::kMaxConfirming, patch_match.num_sources);
}

void DenseOptions::Declare(OptionFields* fields) {
  fields
      ->Int("max_image_size", &pinhole.max_image_size,
            "Longest side of the pictures that depth is found in, pixels; 0 = as fine as the "
            "photos. Time and disk grow with its square: 42 bytes a pixel and photo while it runs, "
            "16 of them stay.")
      .Within(64, 100000, "pixels")
      .Or(0);
  fields
      ->Number("max_field_of_view", &pinhole.max_field_deg,
               "Largest angle between opposite sides of an undistorted fisheye photo, degrees.")
      .Within(10, 170, "degrees");
}

std::vector<std::string> DenseOptions::Problems() const {
  std::vector<std::string> problems = ProblemsOf(*this);
  AppendProblems(patch_match.Problems(), &problems);
  AppendProblems(fusion.Problems(), &problems);
  return problems;
}

DenseResult MakeDense(const std::vector<Scan>& scans, const std::vector<DensePhoto>& photos,
                      const DenseOptions& options, const std::string& folder, uint64_t seed,
                      int num_threads, Progress* progress, std::vector<PhotoLeftOut>* left_out) {
  RequireDisk(photos, options.pinhole, folder);
  progress->Stage("undistort", static_cast<int>(photos.size()));
  DenseRun run(options, folder, seed, num_threads, progress);
  run.Undistort(photos, left_out);
  if (run.num_views() == 0) {
    throw InputError(photos.empty() ? folder : photos[0].path, "",
                     "and no other photo can be used" +
                         (left_out->empty() ? "" : ": " + AsClause(left_out->at(0).reason)),
                     "");
  }
  DenseResult result = run.Run(scans);
  WriteSupplement(result.supplement, scans.at(0), folder + "/supplement.ply");
  return result;
}

}  // namespace roomtex
