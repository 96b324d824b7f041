// roomtex-texture: the scan in colour.

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>

#include "colmap_ext/sparse_model.h"
#include "core/command_line.h"
#include "core/cpu_stages.h"
#include "core/error.h"
#include "core/free_vectors.h"
#include "core/input_guard.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/resource_limits.h"
#include "core/standard_files.h"
#include "importers/rtpi.h"
#include "importers/scan_reader.h"
#include "importers/scan_record.h"
#include "texture/colorize.h"
#include "texture/earlier_results.h"
#include "texture/output/decimate_parts.h"
#include "texture/output/evidence.h"
#include "texture/output/write_e57.h"
#include "texture/output/write_glb.h"
#include "texture/output/write_obj.h"
#include "texture/output/write_ply.h"
#include "texture/output/write_texture.h"
#include "texture/output/write_web_glb.h"
#include "texture/sampling/mesh_front.h"
#include "texture/sampling/photo_list.h"
#include "texture/sampling/photo_pass.h"
#include "texture/texels/grid_image.h"
#include "texture/texels/texture_scale.h"
#include "texture/texture_report.h"

namespace roomtex {
namespace {

struct TextureOptions {
  std::string input_path, output_path, scan_poses, supplement_path;
  std::vector<std::string> scan_paths;
  PhotoSources sources;
  ScanReaderOptions scan_reader;
  ScanBound bound;
  bool accept_untrusted = false, strict = false;
  ColorizeOptions colorize;
  GlbOptions glb;
  WebOptions web;
  std::string image_format = "png";
  bool output_web = true, output_normals = false, output_obj = false, output_e57 = false,
       e57_images = false;
  bool output_evidence = true;
};

void AddPathOptions(TextureOptions* o, Command* command) {
  command->AddInputPath(
      "input_path", &o->input_path,
      "Folder of the COLMAP model in the scan frame, as roomtex-align writes it.");
  command->AddInputPath("image_path", &o->sources.image_path,
                        "Folder of the photos, as COLMAP was given it.");
  command->AddInputPaths("scan_path", &o->scan_paths,
                         "Range scan: .rtpi, .ptx, .e57, .pcd, .las, a mesh or a cloud. Not "
                         "needed for a model of roomtex-align, which remembers its scans and how "
                         "they were read. " +
                             BytesPerSampleHelp(kTextureBytesPerSample, true),
                         Command::Kind::kOptional);
  command->AddInputPath("supplement_path", &o->supplement_path,
                        "supplement.ply of roomtex-dense: what the photos saw and the scan did not "
                        "is coloured as one more mesh, behind the scans.",
                        Command::Kind::kOptional);
  command->AddBool(
      "accept_untrusted", &o->accept_untrusted,
      std::string(kAcceptUntrustedHelp) + " The same of a supplement that is not trusted.");
  command->AddBool("strict", &o->strict, kStrictHelp);
  command->AddBool("use_doubtful", &o->sources.use_doubtful, kUseDoubtfulHelp);
  command->AddOutputPath("output_path", &o->output_path,
                         "Folder to write model.ply, model.glb, texture.png, report.json (and "
                         "model.rtpi) into. Of scans with more than --max_samples these show the "
                         "thinned scans, and station_0, station_1 ... hold the same files of each "
                         "scan in full, written as each is finished.");
  command->AddInputPath("database_path", &o->sources.database_path,
                        "COLMAP database: its intrinsics are used instead of the model's, by image "
                        "name; not for a model of roomtex-align, whose poses go with its own "
                        "intrinsics.",
                        Command::Kind::kOptional);
  command->AddInputPath(
      "associations_path", &o->sources.associations_path,
      "CSV patterned_image,plain_image: colour comes from the plain twin of every "
      "registered patterned photo.",
      Command::Kind::kOptional);
  command->AddInputPath("scan_poses", &o->scan_poses, ScanPosesHelp(), Command::Kind::kOptional);
  command->Add(FieldsOf(&o->scan_reader));
  command->Add(FieldsOf(&o->bound));
}

void AddTextureOptions(TextureOptions* o, Command* command) {
  const OptionFields colorize = FieldsOf(&o->colorize);
  command->Add(colorize.Only({"Texture.scale"}));
  command->Add(FieldsOf(&o->colorize.atlas));
  command->Add(colorize.Only({"Texture.max_memory_mb"}));
}

void AddWriteOptions(TextureOptions* o, Command* command) {
  command->AddBool("output_web", &o->output_web,
                   "Also write model_web.glb: fewer triangles, compressed, the same texture as "
                   "JPEG, for web pages and to give away.");
  command->AddBool("output_normals", &o->output_normals,
                   "model.ply has normals, too: nx, ny, nz behind views, zero where no triangle "
                   "is.");
  command->AddBool("output_obj", &o->output_obj,
                   "Also write model.obj, model.mtl and their texture images model_0.png ... into "
                   "the output folder, with the triangles of --Mesh.max_triangles; the up axis "
                   "stays the scan's.");
  command->AddBool("output_e57", &o->output_e57,
                   "Also write model.e57: all stations in one E57 (structured where there is a "
                   "grid), with intensity, colour and pose.");
  command->AddBool("E57.images", &o->e57_images,
                   "model.e57 also holds the photos, undistorted, with their cameras and poses: "
                   "what programs for splatting read. Writes model.e57, too.");
  command->AddBool("output_evidence", &o->output_evidence,
                   "Also write evidence.ply: a point per vertex of model.ply, in its order, with "
                   "scan intensity, number of photos and their disagreement, for roomtex-view and "
                   "CloudCompare; 21 bytes a vertex.");
  command->AddOutputPath(
      "debug_path", &o->colorize.debug_path,
      "Folder for pictures of what was seen and decided: per photo depth map, depth boundaries, "
      "how it sees the scan and what it gives; per scan the photo that dominates, number of "
      "photos, disagreement. Its README.txt is the legend.",
      Command::Kind::kOptional);
  command->AddChoice(
      "Texture.image_format", &o->image_format, {"png", "jpeg"},
      "Texture images of model.glb and model.obj. png keeps every texel and draws no "
      "rings around print; jpeg (quality 95) takes a fourth of its room. The mesh "
      "mostly weighs more than either.");
  command->Add(FieldsOf(&o->glb));
  command->Add(FieldsOf(&o->web));
}

void AddColorOptions(ColorizeOptions* o, Command* command) {
  command->Add(FieldsOf(o).Only({"Texture.unseen"}));
  command->Add(FieldsOf(&o->exposure));
  command->Add(FieldsOf(&o->registration));
  command->Add(FieldsOf(&o->occlusion));
  command->Add(FieldsOf(&o->blend));
  command->Add(FieldsOf(&o->detail));
  command->Add(FieldsOf(&o->surface));
  command->Add(FieldsOf(&o->mesh));
}

void WriteRtpiCopy(const Scan& scan, const ColoredScan& colored, const std::string& path) {
  std::vector<Eigen::Matrix<uint8_t, 3, 1>> colors;
  colors.reserve(colored.samples.rgb.size());
  for (const auto& [r, g, b] : colored.samples.rgb) colors.emplace_back(r, g, b);
  WriteColoredRtpi(scan.path, colors, path);
}

std::string StationFolder(size_t number) { return "station_" + std::to_string(number); }

const char kReportName[] = "report.json", kResponseName[] = "response.txt";

// What a run writes into one folder.
struct OutputNames {
  std::string ply = "model.ply", glb = "model.glb";
  std::string evidence, web, obj, e57;      // "" = not wanted
  std::vector<std::string> textures, rtpi;  // one per scan; "" = it has none

  // in_full: the scans are whole, not thinned.
  OutputNames(const TextureOptions& options, const std::vector<Scan>& scans, bool in_full) {
    if (options.output_evidence) evidence = "evidence.ply";
    if (options.output_web) web = "model_web.glb";
    if (options.output_obj) obj = "model.obj";
    if (options.output_e57 || options.e57_images) e57 = "model.e57";
    for (size_t s = 0; s < scans.size(); ++s) {
      const std::string number = s == 0 ? "" : "_" + std::to_string(s);
      textures.push_back(scans[s].organised ? "texture" + number + ".png" : "");
      rtpi.push_back(scans[s].is_rtpi && in_full ? "model" + number + ".rtpi" : "");
    }
  }

  // Of an OBJ also the files beside it; how many texture images there are is known in the end.
  std::vector<std::string> All() const {
    std::vector<std::string> names = {ply, glb, evidence, web, obj, e57};
    if (!obj.empty()) names.insert(names.end(), {"model.mtl", "model_0.png", "model_0.jpg"});
    names.insert(names.end(), textures.begin(), textures.end());
    names.insert(names.end(), rtpi.begin(), rtpi.end());
    names.erase(std::remove(names.begin(), names.end(), ""), names.end());
    return names;
  }
};

// Before the work that leads to them.
void ProtectInputs(const TextureOptions& options, const std::vector<Scan>& scans, bool by_station) {
  std::vector<std::string> names = OutputNames(options, scans, !by_station).All();
  names.insert(names.end(), {kReportName, kResponseName});
  for (size_t s = 0; by_station && s < scans.size(); ++s) {
    Scan alike;  // without the samples
    alike.organised = scans[s].organised;
    alike.is_rtpi = scans[s].is_rtpi;
    for (const std::string& name : OutputNames(options, {alike}, true).All()) {
      names.push_back(StationFolder(s) + "/" + name);
    }
  }
  for (const std::string& name : names) RequireReplaceable(options.output_path + "/" + name);
}

// Files of an earlier run that this one does not write would be taken for its own.
void WarnOfOlderFiles(const std::vector<std::string>& written, TextureOptions options,
                      const Command::Context& context) {
  options.output_evidence = options.output_web = options.output_obj = options.output_e57 = true;
  Scan scan;
  scan.organised = scan.is_rtpi = true;
  std::vector<std::string> names = OutputNames(options, {scan, scan}, true).All();
  names.insert(names.end(), {kResponseName, StationFolder(0)});
  const std::string& folder = options.output_path;
  std::string older;
  for (const std::string& name : names) {
    const bool is_written = std::find(written.begin(), written.end(), name) != written.end();
    if (is_written || !std::filesystem::exists(folder + "/" + name)) continue;
    older += (older.empty() ? "" : ", ") + name;
  }
  if (!older.empty()) {
    context.Warn(folder + " also holds what this run did not write: " + older);
  }
}

// Files with fewer triangles: for the web, for modelling programs.
void WriteDecimated(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                    const TextureOptions& options, const OutputNames& names, int num_threads,
                    OutputSet* set, Json* report) {
  std::vector<std::vector<TexturedPart>> parts =
      MakeMeshParts(scans, colored, options.glb.max_texture_size);
  DecimateParts(scans, options.web.max_triangles, num_threads, &parts);
  (*report)["web_triangles"] = CountTriangles(parts);
  if (!names.web.empty()) {
    WriteWebGlb(scans, colored, parts, set->Path(names.web), options.web);
  }
  if (!names.obj.empty()) {
    WriteColoredObj(scans, colored, parts, options.image_format == "jpeg",
                    [set](const std::string& name) { return set->Path(name); });
  }
}

// Of the stage `write`. steps: of its progress; seconds with a scan of 16 M samples.
struct FileWriter {
  int steps;
  std::function<void()> write;
};
using FileWriters = std::vector<FileWriter>;

FileWriters GridWriters(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                        const OutputNames& names, OutputSet* set) {
  FileWriters files;
  for (size_t s = 0; s < scans.size(); ++s) {
    const Scan& scan = scans[s];
    const ColoredScan& colors = colored[s];
    const std::string &texture = names.textures[s], &rtpi = names.rtpi[s];
    if (!texture.empty()) {
      files.push_back({1, [&colors, set, texture] {
                         const ColorGrid& grid =
                             colors.texture.num_columns > 0 ? colors.texture : colors.samples;
                         WritePng(ImageOfGrid(grid), set->Path(texture));
                       }});
    }
    if (!rtpi.empty()) {
      files.push_back(
          {1, [&scan, &colors, set, rtpi] { WriteRtpiCopy(scan, colors, set->Path(rtpi)); }});
    }
  }
  return files;
}

// Fills `web_triangles`.
void WriteAll(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
              const std::vector<PhotoView>& photos, const TextureOptions& options, bool in_full,
              const Command::Context& context, OutputSet* set, Json* report) {
  const CpuTimer timer(CpuStage::kWrite, CpuTimer::Scope::kProcess);
  const OutputNames names(options, scans, in_full);
  GlbOptions glb = options.glb;
  glb.jpeg = options.image_format == "jpeg";
  FileWriters files = {
      {4, [&] { WriteColoredPly(scans, colored, set->Path(names.ply), options.output_normals); }},
      {4, [&] { WriteColoredGlb(scans, colored, set->Path(names.glb), glb); }},
  };
  if (!names.evidence.empty()) {
    files.push_back({1, [&] { WriteEvidence(scans, colored, set->Path(names.evidence)); }});
  }
  for (auto& file : GridWriters(scans, colored, names, set)) files.push_back(std::move(file));
  if (!names.web.empty() || !names.obj.empty()) {
    files.push_back({30, [&] {
                       WriteDecimated(scans, colored, options, names, context.options.num_threads,
                                      set, report);
                     }});
  }
  if (!names.e57.empty()) {
    files.push_back({4, [&] {
                       WriteColoredE57(scans, colored, options.e57_images ? &photos : nullptr,
                                       set->Path(names.e57));
                     }});
  }
  int num_steps = 0;
  for (const FileWriter& file : files) num_steps += file.steps;
  context.progress.Stage("write", num_steps);
  for (const FileWriter& file : files) {
    file.write();
    for (int i = 0; i < file.steps; ++i) context.progress.Tick();
  }
}

// The scans in full, of which `coarse` shows the thinned ones: one after the other, each written
// before the next one is read. index_of: of each scan of `placed` in `coarse`. The report's
// `stations`.
void ColorizeStations(const PlacedScans& placed, const std::vector<size_t>& index_of,
                      const TextureOptions& options, const ColorizeOptions& colorize,
                      ColorizeResult* coarse, const Command::Context& context) {
  const int num_threads = context.options.num_threads;
  context.report["stations"] = Json::array();
  ForEachFullScan(placed, [&](size_t number, Scan scan) {
    context.progress.Note(StationFolder(number) + ": " + scan.path);
    // A mesh is held in full, and turned to the photos, already.
    if (scan.kind() == Scan::Kind::kMesh) scan.triangles = placed.scans[number].triangles;
    const std::vector<Scan> station = {std::move(scan)};
    const ColorizeResult result = ColorizeStation(station, index_of[number], colorize, num_threads,
                                                  &context.progress, coarse);
    Json one = {{"folder", StationFolder(number)},
                {"path", station[0].path},
                {"name", station[0].name},
                {"num_photos", result.photos.size()},
                {"num_vertices", result.num_vertices},
                {"num_colored", result.num_colored},
                {"texture_scale", result.texture_scale}};
    // A set of its own: of fifty stations, what is finished is there when the rest is killed.
    OutputSet outputs(options.output_path + "/" + StationFolder(number));
    WriteAll(station, result.scans, result.photos, options, true, context, &outputs, &one);
    outputs.Commit();
    context.report["stations"].push_back(std::move(one));
  });
}

// Behind the scans: its vertices are the last ones of model.ply, its mesh the last node of
// model.glb.
void AddSupplement(const std::string& path, bool with_colors, PlacedScans* placed) {
  ScanReaderOptions reader;
  reader.colors = with_colors;
  Scan supplement = ReadScan(path, reader);
  if (supplement.kind() != Scan::Kind::kMesh) {
    throw InputError(path, "", "is no triangle mesh",
                     "Give the supplement.ply that roomtex-dense wrote");
  }
  placed->scans.push_back(std::move(supplement));
}

void WarnOfScansWithoutColors(const std::vector<Scan>& scans, const Command::Context& context) {
  for (size_t i = 0; i < scans.size(); ++i) {
    if (!scans[i].colors.empty()) continue;
    context.Warn(ScanName(scans, i) +
                 " has no colours of its own: what no photo sees of it is grey");
  }
}

void Texture(const TextureOptions& options, const Command::Context& context) {
  ColorizeOptions colorize = options.colorize;
  if (colorize.texture_scale == 1 && colorize.atlas.mode == "auto") colorize.atlas.mode = "0";
  colorize.atlas.max_page_size = options.glb.max_texture_size;
  if (options.output_web || options.output_obj) {
    colorize.atlas.decimated_to = options.web.max_triangles;
  }
  std::vector<std::string> problems = options.scan_reader.Problems();
  AppendProblems(options.bound.Problems(), &problems);
  AppendProblems(colorize.Problems(), &problems);
  AppendProblems(options.glb.Problems(), &problems);
  AppendProblems(options.web.Problems(), &problems);
  ThrowIfProblems(problems);
  RequireScans(options.scan_paths, options.input_path);
  RequireOutsidePhotos(options.output_path, options.sources.image_path);

  context.progress.Stage("read model");
  const AlignmentRecord alignment = ReadAlignmentRecord(options.input_path);
  RequireAlignedModel(alignment);
  const SparseModel model = ReadSparseModel(options.input_path);
  PhotoList list = ListPhotosOf(model, alignment, options.sources, options.strict, context);
  TakeOverTrust(alignment, options.accept_untrusted, context);
  if (!options.supplement_path.empty()) {
    TakeOverTrustOfResult(options.supplement_path, "roomtex-dense", options.accept_untrusted,
                          context);
  }

  context.progress.Stage("read scan");
  const double max_samples = options.bound.max_samples;
  const bool own_colors = colorize.unseen == "scan";
  ScanReaderOptions reader = options.scan_reader;
  reader.colors = own_colors;
  const SampleWork work("colouring", kTextureBytesPerSample, max_samples, kTextureBytesPerSample);
  PlacedScans placed = ReadScansOfModel(
      alignment, {options.scan_paths, options.scan_poses, reader, max_samples}, context);
  const bool by_station = placed.stride > 1;
  context.report["sample_stride"] = placed.stride;
  if (by_station) {
    context.progress.Note(
        "The scans have more than --max_samples: exposures are found on one of every " +
        std::to_string(placed.stride) +
        " columns and rows, then each station is coloured in full.");
  }
  if (!options.supplement_path.empty()) {
    AddSupplement(options.supplement_path, own_colors, &placed);
  }
  if (own_colors) WarnOfScansWithoutColors(placed.scans, context);
  TurnMeshesToPhotos(list.photos, context, &placed.scans);
  // The files appear together, or none of them.
  const auto outputs = std::make_shared<OutputSet>(options.output_path);
  ProtectInputs(options, placed.scans, by_station);
  FillScansReport(placed, &context.report);

  // Colours do not depend on the order in which the scans were named.
  const std::vector<size_t> as_named = placed.SortByPath();
  colorize.keep_occluders = by_station;
  ColorizeResult result = ColorizeUsable(placed.scans, colorize, options.strict,
                                         context.options.num_threads, &context.progress, &list);
  const std::vector<size_t> index_of = placed.ScanOrder(as_named);
  placed.Reorder(as_named);
  std::vector<ColoredScan> colored;
  for (const size_t index : index_of) colored.push_back(std::move(result.scans[index]));
  result.scans = std::move(colored);
  const std::vector<Scan>& scans = placed.scans;
  ReportPhotosLeftOut(list.left_out, context);
  FillColorReport(list.photos, colorize, result, context);
  if (!options.supplement_path.empty()) {
    context.report["supplement"] = SupplementReport(scans, result.scans, options.supplement_path);
  }
  JudgeColors(list.photos, result, context);
  const bool wants_detail = colorize.blend.mode == "select" || colorize.blend.detail;
  for (size_t i = 0; i < scans.size(); ++i) {
    if (wants_detail && scans[i].kind() != Scan::Kind::kGrid && result.scans[i].atlas.empty()) {
      context.Warn(ScanName(scans, i) +
                   " has no grid, and detail needs neighbours: --Blend.mode and --Blend.detail "
                   "change nothing there");
    }
    if (scans[i].kind() != Scan::Kind::kMesh || colorize.atlas.mode != "1" ||
        !result.scans[i].atlas.empty())
      continue;
    context.Warn(ScanName(scans, i) +
                 " got no atlas: no photo looks at it, or it falls into too many small charts. "
                 "Decimate or smooth the mesh.");
  }
  if (result.exposure.response == "bracket" || result.exposure.response == "estimate") {
    result.exposure.tones[0]->response.Write(outputs->Path(kResponseName));
  }

  WriteAll(scans, result.scans, result.photos, options, !by_station, context, outputs.get(),
           &context.report.keys());
  if (by_station) {
    // Of the thinned scans no more is needed than where they stand, and what they hide.
    result.scans.clear();
    for (Scan& scan : placed.scans) FreeVectors(&scan.points, &scan.intensity, &scan.colors);
    colorize.debug_path.clear();
    ColorizeStations(placed, index_of, options, colorize, &result, context);
  }
  context.report["files"] = outputs->names();
  std::vector<std::string> written = outputs->names();
  if (by_station) written.push_back(StationFolder(0));
  WarnOfOlderFiles(written, options, context);
  CommitWithReport(kReportName, outputs);
  Json cpu = Json::object();
  for (const auto& [stage, seconds] : CpuSecondsByStage()) cpu[stage] = seconds;
  context.report["cpu_seconds"] = cpu;
  AnswerAtEnd(options.output_path + "/model.ply\n");
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::TextureOptions options;
  options.colorize.texture_scale = 0;  // the command chooses it
  roomtex::Command command(
      "roomtex-texture", "Colours a range scan from registered photos (thesis chapter 8).",
      "roomtex-texture --input_path aligned --image_path images --scan_path room.rtpi "
      "--output_path textured");
  roomtex::AddPathOptions(&options, &command);
  roomtex::AddTextureOptions(&options, &command);
  roomtex::AddWriteOptions(&options, &command);
  roomtex::AddColorOptions(&options.colorize, &command);
  return command.Run(argc, argv, [&options](const roomtex::Command::Context& context) {
    roomtex::Texture(options, context);
  });
}
