#pragma once
// What two rooms share, and how they stand to each other by it. A photo that is registered in both
// rooms (the same file, whatever its name), or a scan to which both were aligned, says by itself
// where one room stands in the other: both are metric, nothing is open.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "align/join/room_record.h"

namespace roomtex {

// Frames first and second: `room` of two rooms.
struct SharedView {
  enum class Kind { kPhoto, kScan };
  Kind kind = Kind::kPhoto;
  std::string name;
  Rigid first_from_second;                  // by this view alone
  Eigen::Vector3d x_in_first, x_in_second;  // where the camera or the scanner stood
  // Of first_from_second at that place: along and about an axis, metres and radians.
  double position_sigma = 0, rotation_sigma = 0;
  bool agrees = false;  // with first_from_second of the link
};

using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct RoomLink {
  int first = 0, second = 0;  // indices of rooms, first < second
  std::vector<SharedView> views;
  // Least squares over the views that agree; most views do, or it is that of the most.
  Rigid first_from_second;
  // Of (turn, shift) as Moved() in core/twist.h has them. Errors of a room's photos are mostly that
  // of the whole room: many photos count as much as one of their geometry.
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Vector3d x_in_first = Eigen::Vector3d::Zero();  // the doorway: amid the views that agree

  int NumAgreeing() const;
  bool HasScan() const;  // among those that agree
};

// How far a relation is from another one at a place, and how exactly that is known.
struct Misfit {
  double offset = 0, turn = 0;              // metres, radians
  double offset_sigma = 0, turn_sigma = 0;  // along and about an axis
  // More than four standard deviations, and more than 6 mm or 0.1 degrees.
  bool Contradicts() const;
};
Misfit MisfitOf(const SharedView& view, const Rigid& first_from_second);
Misfit MisfitOf(const RoomLink& link, const Rigid& first_from_second);

// Variances of a relation at a point: summed over the axes, m^2 and rad^2.
struct RelationVariance {
  double position = 0, rotation = 0;
};
RelationVariance VarianceAt(const RoomLink& link, const Eigen::Vector3d& x_in_first);

// Of all pairs of rooms that share photos, by their indices; of those that share a scan or the
// frame of a file, each with the first such room. Scans that both read in different ways are no
// link; a sentence for each in *problems.
std::vector<RoomLink> FindRoomLinks(const std::vector<RoomRecord>& rooms,
                                    std::vector<std::string>* problems);

// first_from_second, covariance, x_in_first and `agrees` of a link's views: the view with which
// most agree decides, and all that agree give the relation.
void FitRoomLink(RoomLink* link);

}  // namespace roomtex
