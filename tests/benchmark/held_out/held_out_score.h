#pragma once
// How well a coloured scan predicts a photo that it was not made from.

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"
#include "core/similarity.h"
#include "texture/render/mesh_renderer.h"

namespace roomtex {

// What a photo would look like from a pose.
struct Prediction {
  cv::Mat3b picture;
  cv::Mat1b seen;  // 255 where all of a pixel shows the scan
};

class PhotoPredictor {
 public:
  // mesh must outlive this.
  PhotoPredictor(const ColoredMesh& mesh, int num_threads)
      : renderer_(mesh), caster_(mesh.points, mesh.triangles), num_threads_(num_threads) {}

  Prediction Predict(const Camera& camera, const Rigid& cam_from_scan) const;

  // The pose from which the prediction is most like the photo: Gauss-Newton over the pixels of the
  // prediction from the pose given, coarse to fine (Lucas and Kanade 1981 with the six unknowns of
  // a pose). The pose given, if it does not get better.
  Rigid RefinePose(const Camera& camera, const Rigid& cam_from_scan, const cv::Mat& photo) const;

 private:
  cv::Mat3d PointsSeen(const Camera& camera, const Rigid& cam_from_scan) const;

  MeshRenderer renderer_;
  RayCaster caster_;
  int num_threads_;
};

struct HeldOutScore {
  double psnr = 0;  // dB, of sRGB bytes after one gain per channel in linear light
  // Sum of the squared gradients of the prediction, over that of the photo. 1 = as sharp.
  double gradient_energy = 0;
  // Between prediction and photo, of what a Gaussian of sigma 2 pixels takes away.
  double detail_correlation = 0;
  double share_seen = 0;  // of the photo
};

// The prediction after the gain per channel that brings its light to the photo's.
cv::Mat3b WithPhotoGains(const Prediction& prediction, const cv::Mat& photo);

// Over the pixels that the prediction shows, three pixels away from where it does not.
HeldOutScore ScorePrediction(const Prediction& prediction, const cv::Mat& photo);

}  // namespace roomtex
