#pragma once
// Whether a scan brings photos of its own, for roomtex-auto's choice; roomtex-import reads them.

#include <string>

#include "workflow/auto_options.h"

namespace roomtex {

// An E57 that lists a photo with a pose and a camera. Looks at its list of contents alone: false,
// too, for what cannot be read, which the commands say.
bool HoldsPosedPhotos(const std::string& path);

bool HasPhotoSource(const AutoOptions& options);  // photos, panoramas or a video of the user's
// Why the scanner's photos are not used whatever the scans hold; "" = they may be.
std::string WhyNoScannerPhotos(const AutoOptions& options);
// The first of the scans that has some, if they are to be used; "" = none.
std::string FindScannerScan(const AutoOptions& options);

}  // namespace roomtex
