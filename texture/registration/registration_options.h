#pragma once
// How photos that are off are brought to agree, and how far they may move.

#include <string>
#include <vector>

namespace roomtex {

class OptionFields;

struct RegistrationOptions {
  // "none": photos are taken as they are. "measure": how far they are off is found, but not
  // corrected. "pose": their poses are corrected. "warp": and what poses leave, by a smooth field
  // of shifts per photo. "auto": first the poses, then warps, each kept only if photos agree better
  // on a part of the surface that was kept aside, and are no less like the scan there.
  std::string mode = "auto";
  // How far poses may be off, one standard deviation of each axis: what the photos say of each
  // other counts against that. Larger = held less by the alignment.
  double turn_deg = 0.03;
  double move = 0.002;  // metres
  // The same of how far a photo turned while its rows were read (rolling shutter), from the first
  // to the last; rows along its longer side. 0 = all at once. Larger = held less.
  double row_turn_deg = 0.1;
  // The same of a warp, pixels of a picture whose longer side has 1280 (or as many as the photo, if
  // those are fewer): shifts, and how they change over 1/28 of that side. Larger = bent more.
  double warp_px = 2;
  double warp_step_px = 0.5;
  // Photos are left as they are if they are off by less in the mean over all, and none by three
  // times that: so much is noise. Such pixels, each photo by the median over what it sees. Larger =
  // photos are left alone more often.
  double least_px = 0.25;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

}  // namespace roomtex
