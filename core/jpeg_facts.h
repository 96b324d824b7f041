#pragma once
// What a JPEG says of itself, without its being decoded (ITU T.81, annex B).

#include <vector>

namespace roomtex {

struct JpegFacts {
  bool is_whole = false;   // the end-of-image marker is there; bytes behind it are allowed
  int num_components = 0;  // of a pixel: 1 grey, 3 colours, 4 inks; 0 = not said up to there
  bool has_adobe_marker = false;
};

// bytes: of a file that begins with a start-of-image marker.
JpegFacts FindJpegFacts(const std::vector<unsigned char>& bytes);

}  // namespace roomtex
