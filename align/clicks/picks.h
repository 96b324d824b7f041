#pragma once
// Picks (core/pick_table.h) of the photos of sparse models.

#include <string>
#include <vector>

#include "colmap_ext/sparse_model.h"
#include "core/pick_table.h"

namespace roomtex {

// The fewest picks in one photo that fix its pose (thesis 7.1.1), and the fewest over several
// photos that place a sparse model (spread_picks.h).
inline constexpr int kMinPicksPerPhoto = 6;
// A name that no model has becomes that of their one photo which has it in a folder (`photo.jpg` is
// `scanner/photo.jpg` there): picks of roomtex-import --E57.picks in a model of roomtex-auto. Of
// several none is taken.
void NamePicksAsInModels(const std::vector<const SparseModel*>& models, std::vector<Pick>* picks);

// Throws InputError: a name that is in none of the models (with the nearest one that is), a pixel
// outside its photo.
// `among`: what the names are looked up in, for the message.
void CheckPickNames(const std::string& path, const std::vector<Pick>& picks,
                    const std::vector<const SparseModel*>& models,
                    const std::string& among = "in the sparse model");
// Names of the photos of all models.
std::vector<std::string> PhotoNames(const std::vector<const SparseModel*>& models);
// Throws the same InputError for a name that an option gives: none of `names`, which are `among`.
void CheckPhotoName(const std::string& option, const std::string& name,
                    const std::vector<std::string>& names, const std::string& among);
// As CheckPickNames(), and for fewer than kMinPicksPerPhoto picks that count, over all photos.
void CheckPicksAgainstModel(const std::string& path, const std::vector<Pick>& picks,
                            const SparseModel& model);

}  // namespace roomtex
