#include "texture/registration/registration_options.h"

#include "core/option_fields.h"

namespace roomtex {

void RegistrationOptions::Declare(OptionFields* fields) {
  fields->Choice("Registration.mode", &mode, {"auto", "pose", "warp", "measure", "none"},
                 "Photos that show the same surface in different places are brought together: by "
                 "their poses, or by a smooth warp of each photo as well; auto: by whichever of "
                 "these makes them agree where nothing was fitted, or not at all; measure: the "
                 "report says how far they are off, and the colours are made without. Photos that "
                 "agree stay as they are.");
  fields
      ->Number("Registration.turn_deg", &turn_deg,
               "How far a pose may be turned wrongly, one standard deviation, degrees. Larger = "
               "held less by the alignment.")
      .Above(0)
      .AtMost(90)
      .Says("must be positive, at most 90 degrees");
  fields
      ->Number("Registration.move", &move,
               "How far a pose may be off its place, one standard deviation, metres. Larger = "
               "held less by the alignment.")
      .Positive();
  fields
      ->Number("Registration.row_turn_deg", &row_turn_deg,
               "How far a camera may turn while the rows of its photo are read (rolling shutter), "
               "one standard deviation, degrees; 0 = not at all. Larger = held less.")
      .Within(0, 90, "degrees");
  fields
      ->Number("Registration.warp_px", &warp_px,
               "How far a warp may shift what a photo shows, one standard deviation, pixels of a "
               "photo of 1280. Larger = bent more.")
      .Positive();
  fields
      ->Number("Registration.warp_step_px", &warp_step_px,
               "How much a warp's shift may change over 1/28 of the photo, one standard deviation, "
               "pixels of a photo of 1280. Larger = bent more.")
      .Positive();
  fields
      ->Number("Registration.least_px", &least_px,
               "Photos that are off by less, in the mean over the photos, are left as they are; "
               "pixels of a photo of 1280.")
      .NotNegative();
}

std::vector<std::string> RegistrationOptions::Problems() const { return ProblemsOf(*this); }

}  // namespace roomtex
