#pragma once
// Which files of a folder are photos.

#include <string>
#include <vector>

namespace roomtex {

// By its ending: .jpg, .jpeg, .png, .tif, .tiff, .bmp, .webp, in capitals, too.
bool IsPhotoName(const std::string& path);

// Names of the photos in a folder and, with `below`, in the folders below it, as COLMAP names them
// (relative to the folder), in order. Hidden files and folders are left out; links to folders are
// not followed, as COLMAP does not. Throws InputError with `remedy`: missing, cannot be listed, no
// photos.
std::vector<std::string> ListPhotoFiles(const std::string& folder, const std::string& remedy,
                                        bool below = true);

// A sentence without its full stop on photos of kinds that nothing here reads, as those of
// telephones (HEIC) and raw ones, unless the same lies beside them as a photo that is read; "" =
// there are none.
std::string NoteOnOtherPhotos(const std::string& folder);

// Photos that ListPhotoFiles() leaves out since they or a folder that they lie in are hidden, as
// copies that other programs keep. COLMAP takes them all the same, unless it gets a list.
bool HasHiddenPhotos(const std::string& folder);

}  // namespace roomtex
