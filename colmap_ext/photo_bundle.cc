#include "colmap_ext/photo_bundle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <set>
#include <utility>

#include <Eigen/Cholesky>
#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "colmap_ext/lens_prior.h"
#include "colmap_ext/reduced_normal.h"
#include "colmap_ext/reprojection_cost.h"
#include "colmap_ext/solver_log.h"
#include "core/projections.h"
#include "core/robust_kernel.h"
#include "core/similarity.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// More photos than this have a sparse reduced system. In one room it is full: of 120 photos with a
// lens each dense matrices take two thirds of the time (tests/benchmark/scale/lens_cost.cc).
constexpr size_t kMaxDensePhotos = 200;
constexpr int kMaxBundleSteps = 60;
// Of what photos differ by, the share that lenses leave over, at least: of fewer photos than
// parameters nothing is left.
constexpr double kLeastFreeShare = 0.3;
// Fewer leave a photo's pose open.
constexpr int kMinObservations = 6;
// How exactly the scale is held, a share.
constexpr double kScaleShare = 1e-3;
// What a pose is known to before any photo is asked: radians, and extents of all the photos.
constexpr double kPoseSpread = 10;
// More unknowns than these would need too large a dense matrix for their covariance.
constexpr int kMaxUnknowns = 4000;

Eigen::VectorXd ParamsOf(const Camera& camera) {
  return Eigen::Map<const Eigen::VectorXd>(camera.params.data(),
                                           static_cast<int>(camera.params.size()));
}

// The observations that an adjustment uses: of points that two photos see.
struct Observed {
  uint32_t image_id = 0;
  Eigen::Vector2d x_in_img;
};
using ObservedPoints = std::map<uint64_t, std::vector<Observed>>;

ObservedPoints FindObserved(const SparseModel& model, const LensSet& lenses) {
  std::vector<CameraProjection> projections;
  for (const Lens& lens : lenses.lenses) projections.emplace_back(lens.camera);
  ObservedPoints observed;
  for (const auto& [id, point] : model.points) {
    std::vector<Observed> seen;
    for (const TrackElement& element : point.track) {
      const SparseImage& image = model.images.at(element.image_id);
      const CameraProjection& projection = projections[lenses.of_image.at(element.image_id)];
      if (!projection.ImgFromCam(image.cam_from_model * point.x_in_model)) continue;
      seen.push_back({element.image_id, image.points2d[element.point2d_index]});
    }
    if (seen.size() >= 2) observed.emplace(id, std::move(seen));
  }
  return observed;
}

// Photos that their observations hold; the first of them holds the frame.
std::set<uint32_t> HeldImages(const ObservedPoints& observed) {
  std::map<uint32_t, int> count;
  for (const auto& [id, seen] : observed) {
    for (const Observed& one : seen) ++count[one.image_id];
  }
  std::set<uint32_t> held;
  for (const auto& [id, number] : count) {
    if (number >= kMinObservations) held.insert(id);
  }
  return held;
}

// A measurement of the distance between the first photo and the one farthest from it: what holds
// the scale, which photos leave open, and changes nothing else.
struct ScaleHold {
  uint32_t image_id = 0;                            // the farther one
  double distance = 0;                              // of the model
  Eigen::RowVector3d by = Eigen::Vector3d::Zero();  // its place, over the standard deviation
};

ScaleHold FindScaleHold(const SparseModel& model, const std::set<uint32_t>& held) {
  const auto place = [&](uint32_t id) {
    return model.images.at(id).cam_from_model.TargetOriginInSource();
  };
  const Eigen::Vector3d first = place(*held.begin());
  ScaleHold hold;
  hold.image_id = *held.begin();
  for (const uint32_t id : held) {
    if ((place(id) - first).norm() > (place(hold.image_id) - first).norm()) hold.image_id = id;
  }
  const Eigen::Vector3d apart = place(hold.image_id) - first;
  hold.distance = apart.norm();
  if (hold.distance > 0) hold.by = apart.transpose() / (kScaleShare * apart.squaredNorm());
  return hold;
}

class PhotoProblem {
 public:
  PhotoProblem(const SparseModel& model, const LensSet& lenses, const ObservedPoints& observed,
               double sigma_px, const std::set<uint32_t>& known_poses)
      : lenses_(lenses), loss_(kReprojectionHuber * sigma_px) {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    problem_ = std::make_unique<ceres::Problem>(options);
    for (const auto& [id, image] : model.images) {
      pose_index_[id] = poses_.size();
      poses_.emplace_back(image.cam_from_model);
    }
    params_.resize(lenses.lenses.size());
    for (size_t i = 0; i < params_.size(); ++i) {
      const std::vector<double>& params = lenses.lenses[i].camera.params;
      std::copy(params.begin(), params.end(), params_[i].begin());
    }
    points_.reserve(observed.size());  // Ceres keeps pointers into it
    for (const auto& [id, seen] : observed) {
      points_.push_back(model.points.at(id).x_in_model);
      for (const Observed& one : seen) Add(one, points_.back().data());
    }
    AddPriors(sigma_px);
    if (known_poses.empty()) {
      HoldFrame(model, HeldImages(observed), sigma_px);
    } else {
      HoldPoses(known_poses);
    }
  }

  bool Solve(double min_gain) {
    ceres::Solver::Options o;
    o.linear_solver_type =
        poses_.size() > kMaxDensePhotos ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
    o.max_num_iterations = kMaxBundleSteps;
    o.function_tolerance = min_gain;
    o.parameter_tolerance = 1e-10;
    o.gradient_tolerance = 1e-12;
    o.num_threads = 1;
    o.logging_type = ceres::SILENT;
    o.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    const auto order = [&](double* block, int group) {
      if (problem_->HasParameterBlock(block)) {
        o.linear_solver_ordering->AddElementToGroup(block, group);
      }
    };
    for (Eigen::Vector3d& point : points_) order(point.data(), 0);
    for (PoseParameters& pose : poses_) order(pose.values, 1);
    for (auto& params : params_) order(params.data(), 2);
    ceres::Solver::Summary summary;
    SilenceCeres();
    ceres::Solve(o, problem_.get(), &summary);
    return summary.IsSolutionUsable();
  }

  void Write(const ObservedPoints& observed, PhotoBundle* result) const {
    for (const auto& [id, index] : pose_index_) {
      result->model.images.at(id).cam_from_model = poses_[index].CamFromScan();
    }
    size_t next = 0;
    for (const auto& [id, seen] : observed) {
      result->model.points.at(id).x_in_model = points_[next++];
    }
    for (size_t i = 0; i < params_.size(); ++i) {
      std::vector<double>& params = result->lenses.lenses[i].camera.params;
      std::copy_n(params_[i].begin(), params.size(), params.begin());
    }
  }

 private:
  void Add(const Observed& one, double* point) {
    PoseParameters& pose = poses_[pose_index_.at(one.image_id)];
    const int index = lenses_.of_image.at(one.image_id);
    const Lens& lens = lenses_.lenses[index];
    auto* const cost = new ReprojectionCost(pose, lens.camera, one.x_in_img, 1, lens.free);
    if (lens.free) {
      problem_->AddResidualBlock(cost, &loss_, pose.values, point, params_[index].data());
    } else {
      problem_->AddResidualBlock(cost, &loss_, pose.values, point);
    }
  }

  void HoldPoses(const std::set<uint32_t>& known_poses) {
    for (const uint32_t id : known_poses) {
      double* const pose = poses_[pose_index_.at(id)].values;
      if (problem_->HasParameterBlock(pose)) problem_->SetParameterBlockConstant(pose);
    }
  }

  void HoldFrame(const SparseModel& model, const std::set<uint32_t>& held, double sigma_px) {
    if (held.size() < 2) return;
    problem_->SetParameterBlockConstant(poses_[pose_index_.at(*held.begin())].values);
    const ScaleHold hold = FindScaleHold(model, held);
    if (hold.by.isZero(0)) return;
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(1, 6);
    a.rightCols<3>() = sigma_px * hold.by;
    double* const pose = poses_[pose_index_.at(hold.image_id)].values;
    problem_->AddResidualBlock(
        new ceres::NormalPrior(a, Eigen::Map<const Eigen::Matrix<double, 6, 1>>(pose)), nullptr,
        pose);
  }

  void AddPriors(double sigma_px) {
    for (size_t i = 0; i < params_.size(); ++i) {
      const Lens& lens = lenses_.lenses[i];
      if (!lens.free || !problem_->HasParameterBlock(params_[i].data())) continue;
      problem_->AddResidualBlock(
          new ceres::NormalPrior(sigma_px * LensPrior(lens.told, lens.hold_centre),
                                 ParamsOf(lens.told)),
          nullptr, params_[i].data());
    }
  }

  const LensSet& lenses_;
  std::map<uint32_t, size_t> pose_index_;
  std::vector<PoseParameters> poses_;
  std::vector<std::array<double, kMaxCameraParams>> params_;
  std::vector<Eigen::Vector3d> points_;
  ceres::HuberLoss loss_;
  std::unique_ptr<ceres::Problem> problem_;
};

// Sets cost and redundancy, and the covariances of the lenses. Where no poses are known one photo
// and the distance of another from it hold frame and scale, which no lens depends on.
class PhotoNormal {
 public:
  PhotoNormal(const ObservedPoints& observed, double sigma_px,
              const std::set<uint32_t>& known_poses, PhotoBundle* result)
      : observed_(observed),
        sigma_px_(sigma_px),
        scale_is_open_(known_poses.empty()),
        result_(*result) {
    for (const auto& [id, image] : result_.model.images) {
      poses_.emplace(id, PoseParameters(image.cam_from_model));
    }
    held_ = HeldImages(observed);
    for (const uint32_t id : held_) {
      if (scale_is_open_ ? id == *held_.begin() : known_poses.count(id) > 0) continue;
      pose_offset_[id] = num_unknowns_;
      num_unknowns_ += 6;
    }
    for (const Lens& lens : result_.lenses.lenses) {
      lens_offset_.push_back(lens.free ? num_unknowns_ : -1);
      if (lens.free) num_unknowns_ += static_cast<int>(lens.camera.params.size());
    }
  }

  void Evaluate() {
    const bool wanted =
        num_unknowns_ <= kMaxUnknowns && std::any_of(lens_offset_.begin(), lens_offset_.end(),
                                                     [](int offset) { return offset >= 0; });
    ReducedNormal normal(wanted ? num_unknowns_ : 0);
    size_t num_observations = 0;
    for (const auto& [id, seen] : observed_) {
      std::vector<NormalTerms> observations;
      std::vector<Term> terms = TermsOf(id, seen);
      for (Term& term : terms) {
        result_.cost += term.cost;
        observations.push_back(std::move(term.normal));
      }
      num_observations += observations.size();
      if (wanted && observations.size() >= 2) {
        normal.AddPoint(observations, Eigen::Matrix3d::Zero());
      }
    }
    result_.redundancy = 2.0 * static_cast<double>(num_observations) -
                         3.0 * static_cast<double>(observed_.size()) - num_unknowns_ +
                         (scale_is_open_ ? 1 : 0);
    result_.covariances.assign(result_.lenses.lenses.size(), Eigen::MatrixXd());
    if (wanted) FindCovariances(&normal);
  }

 private:
  // An observation's part of the normal equations, by the weight of Huber's cost.
  struct Term {
    uint32_t image_id = 0;
    NormalTerms normal;
    Eigen::Vector2d residual;
    double cost = 0;
  };

  std::vector<Term> TermsOf(uint64_t point_id, const std::vector<Observed>& seen) const {
    const Eigen::Vector3d& x_in_model = result_.model.points.at(point_id).x_in_model;
    std::vector<Term> terms;
    for (const Observed& one : seen) {
      Term term;
      if (FindTerm(one, x_in_model, &term)) terms.push_back(std::move(term));
    }
    return terms;
  }

  bool FindTerm(const Observed& one, const Eigen::Vector3d& x_in_model, Term* term) const {
    const int index = result_.lenses.of_image.at(one.image_id);
    const Lens& lens = result_.lenses.lenses[index];
    const PoseParameters& pose = poses_.at(one.image_id);
    const ReprojectionCost cost(pose, lens.camera, one.x_in_img, 1 / sigma_px_, lens.free);
    const double* const parameters[3] = {pose.values, x_in_model.data(), lens.camera.params.data()};
    NormalTerms& normal = term->normal;
    Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
    NormalTerms::Block by_lens;
    by_lens.by.setZero(2, static_cast<int>(lens.camera.params.size()));
    double* jacobians[3] = {by_pose.data(), normal.by_point.data(), by_lens.by.data()};
    if (!cost.Evaluate(parameters, term->residual.data(), jacobians)) return false;
    term->image_id = one.image_id;
    const double deviations = term->residual.norm();
    term->cost = HuberCost(deviations, kReprojectionHuber);
    const double weight = std::sqrt(HuberWeight(deviations, kReprojectionHuber));
    const auto offset = pose_offset_.find(one.image_id);
    if (offset != pose_offset_.end()) {
      normal.blocks.push_back({offset->second, weight * by_pose});
    }
    if (lens_offset_[index] >= 0) {
      by_lens.offset = lens_offset_[index];
      by_lens.by *= weight;
      normal.blocks.push_back(std::move(by_lens));
    }
    normal.by_point *= weight;
    term->residual *= weight;
    return true;
  }

  void FindCovariances(ReducedNormal* normal) {
    if (scale_is_open_ && !pose_offset_.empty()) {
      const ScaleHold hold = FindScaleHold(result_.model, held_);
      const auto offset = pose_offset_.find(hold.image_id);
      if (offset != pose_offset_.end()) {
        normal->AddInformation(offset->second + 3, hold.by.transpose() * hold.by);
      }
      AddPosePriors(hold.distance, normal);
    }
    for (size_t i = 0; i < lens_offset_.size(); ++i) {
      if (lens_offset_[i] < 0) continue;
      const Lens& lens = result_.lenses.lenses[i];
      const Eigen::MatrixXd prior = LensPrior(lens.told, lens.hold_centre);
      normal->AddInformation(lens_offset_[i], prior.transpose() * prior);
    }
    std::vector<size_t> freed;
    std::vector<UnknownBlock> blocks;
    for (size_t i = 0; i < lens_offset_.size(); ++i) {
      if (lens_offset_[i] < 0) continue;
      freed.push_back(i);
      blocks.push_back(
          {lens_offset_[i], static_cast<int>(result_.lenses.lenses[i].camera.params.size())});
    }
    const std::vector<Eigen::MatrixXd> covariances = normal->Covariances(blocks);
    for (size_t k = 0; k < covariances.size(); ++k) result_.covariances[freed[k]] = covariances[k];
    int num_params = 0;
    for (const UnknownBlock& block : blocks) num_params += block.size;
    // With a lens for every photo nothing is left by which photos could differ.
    const bool is_shared = num_params <= 2 * static_cast<int>(held_.size());
    if (!covariances.empty() && is_shared) FindScatter(*normal, blocks);
  }

  // Two halves of a model that few points connect leave their scales open to each other, the more
  // so as only a part of the points is asked. No lens depends on that. extent: distance of the
  // farthest photo from the first.
  void AddPosePriors(double extent, ReducedNormal* normal) const {
    if (!(extent > 0)) return;
    Eigen::Matrix<double, 6, 1> sigmas;
    sigmas << Eigen::Vector3d::Constant(kPoseSpread),
        Eigen::Vector3d::Constant(kPoseSpread * extent);
    const Eigen::MatrixXd information = sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
    for (const auto& [id, offset] : pose_offset_) normal->AddInformation(offset, information);
  }

  // To first order the residuals of a photo move the lenses by `lenses_by` times its part of the
  // gradient, points eliminated.
  void FindScatter(const ReducedNormal& normal, const std::vector<UnknownBlock>& blocks) {
    const Eigen::MatrixXd lenses_by = normal.CovarianceColumns(blocks);
    if (lenses_by.size() == 0) return;
    const Eigen::Index count = lenses_by.cols();
    Eigen::MatrixXd covariance(count, count);
    Eigen::Index row = 0;
    for (const UnknownBlock& block : blocks) {
      covariance.middleRows(row, block.size) = lenses_by.middleRows(block.offset, block.size);
      row += block.size;
    }
    std::map<uint32_t, Eigen::VectorXd> moved;
    for (const uint32_t id : held_) moved.emplace(id, Eigen::VectorXd::Zero(count));
    for (const auto& [id, seen] : observed_) {
      const std::vector<Term> terms = TermsOf(id, seen);
      Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
      std::vector<Eigen::MatrixXd> by_lenses;  // of each residual
      Eigen::MatrixXd point_by = Eigen::MatrixXd::Zero(3, count);
      for (const Term& term : terms) {
        Eigen::MatrixXd by = Eigen::MatrixXd::Zero(2, count);
        for (const NormalTerms::Block& block : term.normal.blocks) {
          by += block.by * lenses_by.middleRows(block.offset, block.by.cols());
        }
        information += term.normal.by_point.transpose() * term.normal.by_point;
        point_by += term.normal.by_point.transpose() * by;
        by_lenses.push_back(std::move(by));
      }
      if (terms.size() < 2) continue;
      const Eigen::Matrix3d inverse = information.inverse();
      if (!inverse.allFinite()) continue;
      point_by = inverse * point_by;
      for (size_t k = 0; k < terms.size(); ++k) {
        const auto at = moved.find(terms[k].image_id);
        if (at == moved.end()) continue;
        at->second +=
            (by_lenses[k] - terms[k].normal.by_point * point_by).transpose() * terms[k].residual;
      }
    }
    const Eigen::LDLT<Eigen::MatrixXd> factor(covariance);
    std::vector<double> squares;
    for (const auto& [id, move] : moved) squares.push_back(move.dot(factor.solve(move)));
    const double num = static_cast<double>(squares.size()), dims = static_cast<double>(count);
    const double median_of_chi_square = dims * std::pow(1 - 2 / (9 * dims), 3);
    // The lenses have taken up a part of what the photos differ by.
    const double free_share = std::max(1 - dims / num, kLeastFreeShare);
    result_.scatter_by_photo = num * Median(std::move(squares)) / median_of_chi_square / free_share;
  }

  const ObservedPoints& observed_;
  const double sigma_px_;
  const bool scale_is_open_;
  PhotoBundle& result_;
  std::map<uint32_t, PoseParameters> poses_;
  std::map<uint32_t, int> pose_offset_;
  std::set<uint32_t> held_;
  std::vector<int> lens_offset_;  // -1 = held
  int num_unknowns_ = 0;
};

}  // namespace

double KeypointNoise(const SparseModel& model) {
  const auto projections = ProjectionsOf(model.cameras);
  std::vector<double> errors;
  double num_points = 0;
  for (const auto& [id, point] : model.points) {
    num_points += point.track.size() >= 2;
    for (const TrackElement& element : point.track) {
      const SparseImage& image = model.images.at(element.image_id);
      const auto x =
          projections.at(image.camera_id).ImgFromCam(image.cam_from_model * point.x_in_model);
      if (x) errors.push_back((*x - image.points2d[element.point2d_index]).norm());
    }
  }
  const double num_equations = 2.0 * static_cast<double>(errors.size());
  const double num_unknowns = 3.0 * num_points + 6.0 * static_cast<double>(model.images.size());
  const double free_share = std::max(0.2, 1 - num_unknowns / std::max(1.0, num_equations));
  return std::max(0.1, Median(std::move(errors)) / kMedianLengthPerSigma / std::sqrt(free_share));
}

PhotoBundle AdjustPhotos(const SparseModel& model, const LensSet& lenses, double sigma_px,
                         const std::set<uint32_t>& known_poses, double min_gain) {
  PhotoBundle result;
  result.model = model;
  result.lenses = lenses;
  const ObservedPoints observed = FindObserved(model, lenses);
  if (observed.empty() || model.images.size() < 2) return result;
  PhotoProblem problem(model, lenses, observed, sigma_px, known_poses);
  if (problem.Solve(min_gain)) {
    problem.Write(observed, &result);
    result.usable = std::all_of(result.lenses.lenses.begin(), result.lenses.lenses.end(),
                                [](const Lens& lens) { return lens.camera.Problems().empty(); });
    if (!result.usable) {
      result.model = model;
      result.lenses = lenses;
    }
  }
  PhotoNormal(observed, sigma_px, known_poses, &result).Evaluate();
  return result;
}

SparseModel PutBack(SparseModel adjusted, const SparseModel& input) {
  const size_t num_images = input.images.size(), num_points = input.points.size();
  Eigen::Matrix3Xd from(3, num_images + num_points), to(3, num_images + num_points);
  int i = 0;
  for (const auto& [id, image] : input.images) {
    from.col(i) = adjusted.images.at(id).cam_from_model.TargetOriginInSource();
    to.col(i++) = image.cam_from_model.TargetOriginInSource();
  }
  for (const auto& [id, point] : input.points) {
    from.col(i) = adjusted.points.at(id).x_in_model;
    to.col(i++) = point.x_in_model;
  }
  TransformModel(FitSimilarity(from, to), &adjusted);
  return adjusted;
}

LensSet LensesOf(const SparseModel& model) {
  LensSet lenses;
  std::map<uint32_t, int> index;
  for (const auto& [id, camera] : model.cameras) {
    index[id] = static_cast<int>(lenses.lenses.size());
    lenses.lenses.push_back({camera, camera, false});
  }
  for (const auto& [id, image] : model.images) lenses.of_image[id] = index.at(image.camera_id);
  return lenses;
}

SparseModel AdjustedByPhotos(const SparseModel& model, double sigma_px) {
  PhotoBundle bundle = AdjustPhotos(model, LensesOf(model), sigma_px);
  return bundle.usable ? PutBack(std::move(bundle.model), model) : model;
}

SparseModel WithLenses(const SparseModel& model, const LensSet& lenses) {
  SparseModel result = model;
  uint32_t next_id = result.cameras.empty() ? 1 : result.cameras.rbegin()->first + 1;
  std::map<uint32_t, int> kept;                          // camera, lens that keeps it
  std::map<std::pair<uint32_t, int>, uint32_t> divided;  // camera and lens, new camera
  for (auto& [id, image] : result.images) {
    const uint32_t camera_id = model.images.at(id).camera_id;
    const int lens = lenses.of_image.at(id);
    const auto [at, is_first] = kept.emplace(camera_id, lens);
    if (at->second != lens) {
      const auto [other, is_new] = divided.emplace(std::pair(camera_id, lens), next_id);
      if (is_new) ++next_id;
      image.camera_id = other->second;
    }
    Camera camera = lenses.lenses[lens].camera;
    camera.camera_id = image.camera_id;
    camera.has_prior_focal_length = model.cameras.at(camera_id).has_prior_focal_length;
    result.cameras[image.camera_id] = std::move(camera);
  }
  return result;
}

}  // namespace roomtex
