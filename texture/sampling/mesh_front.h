#pragma once
// Which side of a mesh is its front, where the file cannot be trusted to say it.

#include <cstddef>
#include <vector>

#include "core/command_line.h"
#include "core/scan.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

// Of a mesh whose file does not say where it was scanned from (Scan::station_is_assumed): triangles
// that share an edge are wound alike, and each connected piece that photos see from behind, by
// twice as many rays as from the front, is turned to them. Room models are often wound outwards, or
// each wall as it came. Pieces that no photo sees stay. Gives the number of triangles turned; 0 for
// every other scan, which is left as it is.
size_t TurnMeshToPhotos(const std::vector<PhotoView>& photos, int num_threads, Scan* mesh);
// All of a command's scans; warns of those that were turned.
void TurnMeshesToPhotos(const std::vector<PhotoView>& photos, const Command::Context& context,
                        std::vector<Scan>* scans);

}  // namespace roomtex
